"""An open-loop drive as a policy: the drum speeds that bring the drum onto φ_H(t) and keep it there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue
from agents.drives.functions import Drive
from agents.drives.optimisation import OptimisedDrive
from agents.policy import FloatArray, Knowledge


@dataclass
class DrivePolicy:
    """Follow a drive in every row, by the clock and the winch's limits alone."""

    name: str
    drives: Sequence[OptimisedDrive]
    """Drives, one for each row."""
    knows: Knowledge = Knowledge.CLOCK
    """FUTURE where the drives were optimised for the very scenarios that they run in."""
    _follower: Follower = field(init=False)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the winch's limits are looked at."""
        self._follower = Follower([found.drive for found in self.drives], scenarios, control_period)

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s."""
        return self._follower.command(time)


class Follower:
    """Open-loop tracking: brings drums onto their drives and keeps them there, without any measurement.

    It reckons where its own commands have brought the drum, as the winch ramps at its limit of acceleration. A drive
    that starts under way is caught up with first, since the drum starts at rest.
    """

    def __init__(self, drives: Sequence[Drive], scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes with a drive each."""
        if len(scenarios) != len(drives):
            raise InvalidValue(f"drives: {len(drives)} drives for {len(scenarios)} scenarios")
        self._period = control_period
        winches = [s.crane.winch for s in scenarios]
        self._limits = np.array([[w.max_speed for w in winches], [w.max_acceleration for w in winches]])
        # Sampled at the control steps once and for all; after its end a drive stands still.
        steps = max((int(drive.duration / control_period) for drive in drives), default=0) + 2
        times = np.arange(steps) * control_period
        self._drives = np.zeros((2, len(drives), steps))
        for i, drive in enumerate(drives):
            self._drives[0, i] = drive.angle(np.minimum(times, drive.duration))
            self._drives[1, i] = np.where(times < drive.duration, drive.speed(times), 0.0)
        self._angle = np.zeros(len(scenarios))
        self._speed = np.zeros(len(scenarios))

    def command(self, time: float) -> FloatArray:
        """Drum speeds (N,) rad/s that bring the drums to φ_H(t + T) at the end of the control step T."""
        period, (most, a) = self._period, self._limits
        step, last = round(time / period), self._drives.shape[2] - 1
        now = self._drives[0, :, min(step, last)]
        later, speed = self._drives[:, :, min(step + 1, last)]
        # A command that differs by δ from the speed ramps at a: it turns the drum by δ T - sign(δ) δ²/(2 a) more.
        extra = later - self._angle - self._speed * period
        exact = self._speed + np.sign(extra) * a * (period - np.sqrt(np.maximum(0.0, period**2 - 2.0 * abs(extra) / a)))
        # Farther away: approach as fast as leaves room to brake at a quarter of the limit.
        behind = now - self._angle
        approach = speed + np.sign(behind) * np.minimum(abs(behind) / period, np.sqrt(0.5 * a * abs(behind)))
        command = np.clip(np.where(abs(extra) < 0.375 * a * period**2, exact, approach), -most, most)
        change = np.clip(command - self._speed, -a * period, a * period)
        self._angle += self._speed * period + change * (period - 0.5 * abs(change) / a)
        self._speed += change
        return np.asarray(command)
