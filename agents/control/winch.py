"""Inverse of the winch: the command that turns the drum by a wanted angle during a control step."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from aframe_env.dynamics.compiling import kernel, scalar
from aframe_env.dynamics.winch import drum_state, plan
from aframe_env.scenario.crane import Crane
from agents.control.filters import ALL, FloatArray, Rows

_TURN: Final = 0
_SPEED: Final = 1

_BISECTIONS: Final = 48  # a hair of the speed range: below 1e-13 rad/s


class WinchModel:
    """The winches of N rows, without their limit switches: commands for wanted turns, and reckoned drum speeds."""

    def __init__(self, rows: int, control_period: float) -> None:
        self.radius, self.max_speed, self.max_acceleration, self.lag = np.ones((4, rows))
        """(N,) m, rad/s, rad/s², s."""
        self._period = control_period
        self.speed = np.zeros(rows)
        """(N,) rad/s, reckoned from the commands since the start; a lift begins with the drum at rest."""

    def start(self, cranes: Sequence[Crane], rows: Rows = ALL) -> None:
        """Begin hoists with these cranes in these rows."""
        winches = [crane.winch for crane in cranes]
        self.radius[rows] = [w.drum_radius for w in winches]
        self.max_speed[rows] = [w.max_speed for w in winches]
        self.max_acceleration[rows] = [w.max_acceleration for w in winches]
        self.lag[rows] = [w.lag for w in winches]
        self.speed[rows] = 0.0

    def command(self, turn: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Find commands (N,) rad/s that turn the drums by ``turn`` (N,) rad, or as near as may be, and their turns.

        The reckoned speed is carried to the end of the control step.
        """
        command = self.invert(turn)
        return command, self.turn(command)

    def invert(self, turn: FloatArray) -> FloatArray:
        """Find commands (N,) rad/s that would turn the drums by ``turn`` (N,) rad, or as near as may be."""
        command = np.empty_like(turn)
        _kernels().invert(self.speed, self.max_speed, self.max_acceleration, self.lag, self._period, turn, command)
        return command

    def reach(self, speed: FloatArray) -> FloatArray:
        """Find commands (N,) rad/s after which the drums turn at ``speed`` (N,) rad/s, or as near as may be.

        The reckoned speed is carried to the end of the control step.
        """
        command = np.empty_like(speed)
        _kernels().reach(self.speed, self.max_speed, self.max_acceleration, self.lag, self._period, speed, command)
        return command

    def turn(self, command: FloatArray) -> FloatArray:
        """Find turns (N,) rad of the drums at these commands (N,) rad/s, and carry the reckoned speed on."""
        turned = np.empty_like(command)
        limited = np.clip(command, -self.max_speed, self.max_speed)
        _kernels().follow(self.speed, self.max_acceleration, self.lag, self._period, limited, turned)
        return turned


class _Kernels(NamedTuple):
    invert: Callable[..., None]
    follow: Callable[..., None]
    reach: Callable[..., None]


@scalar
def _advance(command: float, speed: float, acceleration: float, lag: float, period: float) -> tuple[float, float]:
    """Turn [rad] and speed [rad/s] at the end of a control step."""
    way, ramp, error, _, _ = plan(command, speed, acceleration, lag, period)
    end = error * math.exp((ramp - period) / lag) if lag > 0.0 and ramp < period else error
    return drum_state(period, 0.0, speed, command, acceleration, lag, way, ramp, error, end, -math.inf, math.inf)


@scalar
def _bisect(
    wanted: float, quantity: int, speed: float, limit: float, acceleration: float, lag: float, period: float
) -> float:
    """Find the command [rad/s] within ± ``limit`` after which the turn or the speed is as ``wanted``, or nearly so."""
    low, high = -limit, limit
    middle = 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        turn, reached = _advance(middle, speed, acceleration, lag, period)
        if (turn if quantity == _TURN else reached) < wanted:
            low = middle
        else:
            high = middle
    return middle


@scalar
def command_for(turn: float, speed: float, limit: float, acceleration: float, lag: float, period: float) -> float:
    """Find the command [rad/s] within ± ``limit`` that turns the drum by ``turn`` [rad] in a control step, if any."""
    return _bisect(turn, _TURN, speed, limit, acceleration, lag, period)


@scalar
def command_to_reach(
    wanted: float, speed: float, limit: float, acceleration: float, lag: float, period: float
) -> float:
    """Find the command [rad/s] within ± ``limit`` after which the drum turns at ``wanted`` [rad/s], or nearly so."""
    if lag == 0.0:
        return min(max(wanted, -limit), limit)
    return _bisect(wanted, _SPEED, speed, limit, acceleration, lag, period)


@cache
def _kernels() -> _Kernels:
    @kernel
    def invert(speed, limit, acceleration, lag, period, turn, command):  # type: ignore[no-untyped-def]
        for i in range(turn.shape[0]):
            command[i] = command_for(turn[i], speed[i], limit[i], acceleration[i], lag[i], period)

    @kernel
    def follow(speed, acceleration, lag, period, command, turned):  # type: ignore[no-untyped-def]
        for i in range(command.shape[0]):
            turned[i], speed[i] = _advance(command[i], speed[i], acceleration[i], lag[i], period)

    @kernel
    def reach(speed, limit, acceleration, lag, period, wanted, command):  # type: ignore[no-untyped-def]
        for i in range(wanted.shape[0]):
            command[i] = command_to_reach(wanted[i], speed[i], limit[i], acceleration[i], lag[i], period)
            _, speed[i] = _advance(command[i], speed[i], acceleration[i], lag[i], period)

    return _Kernels(invert, follow, reach)
