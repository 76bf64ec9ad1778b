"""Objectives (31) and (32) of a prescribed drum angle, evaluated by the package's own integrator.

Ω1 = ∫ (x_L3 - h)² dt [m² s], Ω2 = max |x_L3 - h| [m] over [0, t_k] on the simplified model. As in the source,
the drum follows the drive exactly: the winch has no limits here, and the rope does not part.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel, scalar
from aframe_env.dynamics.integrator import rk4_step
from aframe_env.engine import Engine
from aframe_env.motion import require_coverage
from aframe_env.scenario import Scenario
from aframe_env.validation import require_number
from agents.drives import Drive

FloatArray = npt.NDArray[np.float64]

FINE_STEP: Final = 0.01
"""Longest inner step of the figures that are reported, s."""
COARSE_STEP: Final = 0.05
"""Longest inner step while searching, s."""
COARSE_PHASE: Final = 0.2
"""Most that the load's bobbing on the rope turns in an inner step while searching, rad."""


@dataclass(frozen=True)
class Outcome:
    """What a drive does to the load."""

    omega1: float
    """Ω1, m² s."""
    omega2: float
    """Ω2 = max |x_L3 - h|, m, at the inner steps."""
    lowest: float
    """Least x_L3 - h, m."""
    highest: float
    """Greatest x_L3 - h, m."""
    duration: float
    """t_k, s."""

    @property
    def rms(self) -> float:
        """Root mean square of x_L3 - h, m."""
        return math.sqrt(self.omega1 / self.duration)

    @property
    def amplitude(self) -> float:
        """Greatest distance of the load from its required level, m."""
        return self.omega2


def coarse_step(scenario: Scenario) -> float:
    """Inner step [s] at which Ω1 is right to 1e-4: RK4 turns the load's bobbing by at most COARSE_PHASE."""
    return min(COARSE_STEP, COARSE_PHASE / scenario.rope_frequency)


@scalar
def _advance(x1, x2, x3, v1, v2, v3, a, b, c, angles, speeds, p, h):  # type: ignore[no-untyped-def]
    """Inner step of length h: pulley a, b, c, drum angles and speeds at its start, middle and end."""
    target, to_pulley, stiffness, damping, inverse_mass, gravity, free_length, radius = p
    la, lb, lc = free_length + radius * angles[0], free_length + radius * angles[1], free_length + radius * angles[2]
    ra, rb, rc = radius * speeds[0], radius * speeds[1], radius * speeds[2]
    return rk4_step(
        x1,
        x2,
        x3,
        v1,
        v2,
        v3,
        (a[0], a[1], a[2], a[3], a[4], a[5], la, ra, stiffness / la),
        (b[0], b[1], b[2], b[3], b[4], b[5], lb, rb, stiffness / lb),
        (c[0], c[1], c[2], c[3], c[4], c[5], lc, rc, stiffness / lc),
        h,
        target,
        to_pulley,
        damping,
        inverse_mass,
        gravity,
    )


@cache
def _kernel() -> Callable[..., tuple[float, float, float]]:

    @kernel
    def evaluate(
        path: FloatArray,
        angle: FloatArray,
        speed: FloatArray,
        start: tuple[float, ...],
        p: tuple[float, ...],
        h: float,
        errors: FloatArray,
    ) -> tuple[float, float, float]:
        target = p[0]
        x1, x2, x3, v1, v2, v3 = start
        omega1 = 0.0
        lowest = highest = x3 - target
        errors[0] = x3 - target
        for i in range((path.shape[0] - 1) // 2):
            k = 2 * i
            angles = (angle[k], angle[k + 1], angle[k + 2])
            speeds = (speed[k], speed[k + 1], speed[k + 2])
            x1, x2, x3, v1, v2, v3, cost, _ = _advance(  # type: ignore[no-untyped-call]
                x1, x2, x3, v1, v2, v3, path[k], path[k + 1], path[k + 2], angles, speeds, p, h
            )
            omega1 += cost
            error = x3 - target
            errors[i + 1] = error
            lowest = min(lowest, error)
            highest = max(highest, error)
        return omega1, lowest, highest

    return evaluate


@cache
def _lanes_kernel() -> Callable[..., None]:

    @kernel
    def evaluate(
        path: FloatArray,
        angle: FloatArray,
        speed: FloatArray,
        more_angle: FloatArray,
        more_speed: FloatArray,
        start: tuple[float, ...],
        p: tuple[float, ...],
        h: float,
        errors: FloatArray,
    ) -> None:
        target = p[0]
        lanes = more_angle.shape[1]
        x1, x2, x3 = np.full(lanes, start[0]), np.full(lanes, start[1]), np.full(lanes, start[2])
        v1, v2, v3 = np.full(lanes, start[3]), np.full(lanes, start[4]), np.full(lanes, start[5])
        errors[0] = start[2] - target
        for i in range((path.shape[0] - 1) // 2):
            k = 2 * i
            a, b, c = path[k], path[k + 1], path[k + 2]
            angle_a, angle_b, angle_c = angle[k], angle[k + 1], angle[k + 2]
            speed_a, speed_b, speed_c = speed[k], speed[k + 1], speed[k + 2]
            for j in range(lanes):
                angles = (angle_a + more_angle[k, j], angle_b + more_angle[k + 1, j], angle_c + more_angle[k + 2, j])
                speeds = (speed_a + more_speed[k, j], speed_b + more_speed[k + 1, j], speed_c + more_speed[k + 2, j])
                x1[j], x2[j], x3[j], v1[j], v2[j], v3[j], _, _ = _advance(  # type: ignore[no-untyped-call]
                    x1[j], x2[j], x3[j], v1[j], v2[j], v3[j], a, b, c, angles, speeds, p, h
                )
                errors[i + 1, j] = x3[j] - target

    return evaluate


class Objective:
    """A scenario laid out for fast evaluation: the pulley's path at every half inner step, computed once."""

    def __init__(self, scenario: Scenario, duration: float, max_step: float = FINE_STEP) -> None:
        """Lay out ``duration`` [s] in (0, 3600] of a scenario with inner steps of at most ``max_step`` s."""
        require_number("duration", duration, "s", low=0.0, high=3600.0, low_open=True)
        require_number("max_step", max_step, "s", low=2e-3, high=0.2)
        require_coverage(scenario.motion, "duration", duration)
        self.scenario = scenario
        self.duration = float(duration)
        self.steps = max(1, math.ceil(duration / max_step - 1e-9))
        self.step = self.duration / self.steps
        self.times = np.linspace(0.0, self.duration, 2 * self.steps + 1)
        """(2 steps + 1,) s, every half inner step: where drives are sampled."""
        # The engine itself moves the deck; at the ends of its control steps the pulley's place is exact.
        engine = Engine(1, 0.5 * self.step, max_inner_step=0.2)
        engine.reset_row(0, scenario)
        row, still = engine.blocks[0], np.zeros(1)
        self.path = np.empty((len(self.times), 6))
        """(2 steps + 1, 6): pulley's position and velocity at ``times``, base frame."""
        self.path[0] = row[at.PULLEY : at.PULLEY + 6]
        self._start = tuple(row[at.LOAD_POSITION : at.LOAD_POSITION + 6].tolist())
        for i in range(1, len(self.times)):
            engine.step(still)
            self.path[i] = row[at.PULLEY : at.PULLEY + 6]
        crane = scenario.crane
        self._parameters = (
            float(scenario.target_level),
            crane.drum_to_pulley,
            float(crane.rope.axial_stiffness),
            float(scenario.rope_damping),
            1.0 / float(scenario.load_mass),
            float(scenario.gravity),
            scenario.free_length,
            crane.winch.drum_radius,
        )
        self._errors = np.empty(self.steps + 1)

    def evaluate(self, angle: FloatArray, speed: FloatArray) -> Outcome:
        """Outcome of a drum angle [rad] and speed [rad/s] given at ``times``."""
        omega1, lowest, highest = _kernel()(
            self.path, angle, speed, self._start, self._parameters, self.step, self._errors
        )
        return Outcome(omega1, max(-lowest, highest), lowest, highest, self.duration)

    def errors(self, angle: FloatArray, speed: FloatArray) -> FloatArray:
        """x_L3 - h at the inner steps, (steps + 1,) m, under an angle and speed given at ``times``."""
        self.evaluate(angle, speed)
        return self._errors.copy()

    def errors_beside(
        self, angle: FloatArray, speed: FloatArray, more_angle: FloatArray, more_speed: FloatArray
    ) -> FloatArray:
        """x_L3 - h (steps + 1, n) m of n neighbours of a drive: ``more_angle``, ``more_speed`` (times, n) are added.

        The neighbours run side by side, in the lanes of the processor's registers.
        """
        errors = np.empty((self.steps + 1, more_angle.shape[1]))
        _lanes_kernel()(
            self.path, angle, speed, more_angle, more_speed, self._start, self._parameters, self.step, errors
        )
        return errors

    def drive(self, drive: Drive) -> Outcome:
        """Outcome of a drive."""
        return self.evaluate(drive.angle(self.times), drive.speed(self.times))

    def still(self) -> Outcome:
        """Outcome of leaving the drum alone."""
        return self.evaluate(np.zeros(len(self.times)), np.zeros(len(self.times)))

    def trajectory(self, drive: Drive | None = None) -> tuple[FloatArray, FloatArray]:
        """Times (steps + 1,) s and x_L3 - h (steps + 1,) m under a drive, or with the drum still."""
        if drive is None:
            self.still()
        else:
            self.drive(drive)
        return self.times[::2].copy(), self._errors.copy()
