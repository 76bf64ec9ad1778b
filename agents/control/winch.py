"""The winch inverted: which command turns the drum by a wanted angle during a control step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import kernel
from aframe_env.dynamics.winch import drum_state, plan
from aframe_env.scenario import Scenario

FloatArray = npt.NDArray[np.float64]

_BISECTIONS = 48  # a hair of the speed range: below 1e-13 rad/s


class WinchModel:
    """The winches of N rows, without their limit switches: commands for wanted turns, and reckoned drum speeds."""

    def __init__(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        winches = [s.crane.winch for s in scenarios]
        self.radius = np.array([w.drum_radius for w in winches])
        """(N,) m."""
        self.max_speed = np.array([w.max_speed for w in winches])
        """(N,) rad/s."""
        self.max_acceleration = np.array([w.max_acceleration for w in winches])
        """(N,) rad/s²."""
        self._lag = np.array([w.lag for w in winches])
        self._period = control_period
        self.speed = np.zeros(len(winches))
        """(N,) rad/s, reckoned from the commands since the start; a lift begins with the drum at rest."""

    def command(self, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Commands (N,) rad/s that turn the drums by ``turn`` (N,) rad, or as near as may be, and how far they turn.

        The reckoned speed is carried to the end of the control step.
        """
        command, turned = np.empty_like(turn), np.empty_like(turn)
        _kernel()(turn, self.max_speed, self.max_acceleration, self._lag, self._period, self.speed, command, turned)
        return command, turned


@cache
def _kernel() -> Callable[..., None]:

    @kernel
    def invert(turn, limit, acceleration, lag, period, speed, command, turned):  # type: ignore[no-untyped-def]
        for i in range(turn.shape[0]):
            low, high = -limit[i], limit[i]
            angle, after = 0.0, 0.0
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + high)
                way, ramp, error, _, _ = plan(middle, speed[i], acceleration[i], lag[i], period)
                end = error * math.exp((ramp - period) / lag[i]) if lag[i] > 0.0 and ramp < period else error
                angle, after = drum_state(
                    period,
                    0.0,
                    speed[i],
                    middle,
                    acceleration[i],
                    lag[i],
                    way,
                    ramp,
                    error,
                    end,
                    -np.inf,
                    np.inf,
                )
                if angle < turn[i]:
                    low = middle
                else:
                    high = middle
            command[i], turned[i], speed[i] = middle, angle, after

    return invert
