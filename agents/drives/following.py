"""How a winch follows a drive: open-loop tracking, by the clock and the winch's limits alone.

The law is written once, as a scalar function: ``Follower`` plays drives in the environment with it, and the objective
under the winch's limits plays them with it while they are optimised.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import kernel, scalar
from aframe_env.dynamics.winch import drum_state, plan
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Winch
from aframe_env.validation import InvalidValue
from agents.drives.functions import Drive

FloatArray = npt.NDArray[np.float64]


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
        self._drums = np.zeros((2, len(scenarios)))

    def command(self, time: float) -> FloatArray:
        """Drum speeds (N,) rad/s that bring the drums to φ_H(t + T) at the end of the control step T."""
        step, last = round(time / self._period), self._drives.shape[2] - 1
        now, later = self._drives[:, :, min(step, last)], self._drives[:, :, min(step + 1, last)]
        command = np.empty(len(self._drums[0]))
        _kernels().follow(now[0], *later, *self._drums, *self._limits, self._period, command)
        return command


def played(
    angle: FloatArray, speed: FloatArray, winch: Winch, angles: tuple[float, float], period: float, parts: int
) -> tuple[FloatArray, FloatArray]:
    """Angle [rad] and speed [rad/s] of a drum that follows a drive within the winch's limits, from rest.

    The drive is given at the ends of the K control steps of ``period`` s, (K + 1,) rad and rad/s, and stands still
    after them. The drum's motion is that at each of ``parts`` equal parts of a control step, (parts K + 1,);
    ``angles`` are the least and the greatest, rad, where the limit switches stop it.
    """
    turned = np.zeros((2, parts * (len(angle) - 1) + 1))
    limits = winch.max_speed, winch.max_acceleration, winch.lag, *angles
    _kernels().play(angle, speed, *limits, period, parts, *turned)
    return turned[0], turned[1]


@scalar
def _follow(
    now: float, later: float, later_speed: float, angle: float, speed: float, most: float, a: float, period: float
) -> tuple[float, float, float]:
    """Command [rad/s] of a control step, and the angle and speed that it is reckoned to bring the drum to.

    ``now``, ``later``: the drive's angle at both ends of the step, ``later_speed`` its speed at the end.
    """
    # A command that differs by δ from the speed ramps at a: it turns the drum by δ T - sign(δ) δ²/(2 a) more.
    extra = later - angle - speed * period
    if abs(extra) < 0.375 * a * period**2:
        command = speed + math.copysign(a * (period - math.sqrt(period**2 - 2.0 * abs(extra) / a)), extra)
    else:  # farther away: approach as fast as leaves room to brake at a quarter of the limit
        behind = now - angle
        command = later_speed + math.copysign(min(abs(behind) / period, math.sqrt(0.5 * a * abs(behind))), behind)
    command = min(max(command, -most), most)
    change = min(max(command - speed, -a * period), a * period)
    return command, angle + speed * period + change * (period - 0.5 * abs(change) / a), speed + change


class _Kernels(NamedTuple):
    follow: Callable[..., None]
    play: Callable[..., None]


@cache
def _kernels() -> _Kernels:
    @kernel
    def follow(now, later, later_speed, angle, speed, most, a, period, command):  # type: ignore[no-untyped-def]
        for i in range(command.shape[0]):
            command[i], angle[i], speed[i] = _follow(
                now[i], later[i], later_speed[i], angle[i], speed[i], most[i], a[i], period
            )

    @kernel
    def play(drive, drive_speed, most, a, lag, least, greatest, period, parts, angle, speed):  # type: ignore[no-untyped-def]
        steps = drive.shape[0] - 1
        reckoned = reckoned_speed = 0.0
        for k in range(steps):
            later_speed = drive_speed[k + 1] if k + 1 < steps else 0.0
            command, reckoned, reckoned_speed = _follow(
                drive[k], drive[k + 1], later_speed, reckoned, reckoned_speed, most, a, period
            )
            start = parts * k
            way, ramp, error, _, _ = plan(command, speed[start], a, lag, period)
            for part in range(1, parts + 1):
                elapsed = period * part / parts
                decayed = error * math.exp(-(elapsed - ramp) / lag) if lag > 0.0 and elapsed > ramp else error
                angle[start + part], speed[start + part] = drum_state(
                    elapsed, angle[start], speed[start], command, a, lag, way, ramp, error, decayed, least, greatest
                )

    return _Kernels(follow, play)
