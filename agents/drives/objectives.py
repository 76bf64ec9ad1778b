"""Objectives (31) and (32) of a prescribed drum angle, evaluated by the package's own integrator.

Ω1 = ∫ (x_L3 - h)² dt [m² s], Ω2 = max |x_L3 - h| [m] over [0, t_k] on the simplified model, with heavy ropes and water
too; the rope does not part.
As in the paper, the drum follows the drive exactly; or, where a control period is given, as the winch can from rest,
within its limits of speed and acceleration, which is what ``DrivePolicy`` makes of the drive in the environment.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three, three
from aframe_env.dynamics.compiling import kernel, scalar
from aframe_env.dynamics.heavy_rope import lift_step
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.lift import COST, END_TARGET, put_end
from aframe_env.dynamics.load import Load, RopeEnd, load_constants, rk4_step
from aframe_env.dynamics.start import hang_rope, inner_steps
from aframe_env.dynamics.target import target_at
from aframe_env.dynamics.vector import Vector
from aframe_env.dynamics.water import begin_water
from aframe_env.engine import Engine
from aframe_env.scenario import Scenario
from aframe_env.scenario.motion import require_coverage
from aframe_env.validation import InvalidValue, require_number, shown
from agents.drives.following import played
from agents.drives.functions import Drive

FloatArray = npt.NDArray[np.float64]

FINE_STEP: Final = 0.01
"""Longest inner step of the figures that are reported, s."""
COARSE_STEP: Final = 0.05
"""Longest inner step while searching, s."""
COARSE_PHASE: Final = 0.2
"""Greatest phase of the load's bobbing on the rope in an inner step while searching, rad."""


@dataclass(frozen=True)
class Outcome:
    """Result of a drive for the load."""

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
    """Inner step [s] at which Ω1 is right to 1e-4: RK4 turns the load's bobbing by at most COARSE_PHASE.

    A rope with mass may ask for a shorter one.
    """
    return min(COARSE_STEP, COARSE_PHASE / scenario.rope_frequency, scenario.chain_step, scenario.attached_step)


class _Drum(NamedTuple):
    """Constants that turn a drum angle into a length of rope."""

    radius: float
    """m."""
    free_length: float
    """l_0, m."""
    axial_stiffness: float
    """E_R F_R, N."""


@scalar
def _drum(row):  # type: ignore[no-untyped-def]
    """Drum of an engine's row."""
    return _Drum(row[at.DRUM_RADIUS], row[at.FREE_LENGTH], row[at.AXIAL_STIFFNESS])


@scalar
def _rope_end(point, angle, speed, drum):  # type: ignore[no-untyped-def]
    """Upper end of the rope: pulley ``point`` (6,), and the drum's angle and speed."""
    length = drum.free_length + drum.radius * angle
    return RopeEnd(
        Vector(point[0], point[1], point[2]),
        Vector(point[3], point[4], point[5]),
        length,
        drum.radius * speed,
        drum.axial_stiffness / length,
    )


@cache
def _kernel() -> Callable[..., tuple[float, float, float]]:

    @kernel
    def evaluate(path, angle, speed, row, lowering, h, errors):  # type: ignore[no-untyped-def]
        target, constants, drum = row[at.TARGET], load_constants(row, 1.0, 1, 0), _drum(row)  # type: ignore[no-untyped-call]
        place = three(row, at.LOAD_POSITION, 1, 0)
        place = Vector(place.x, place.y, place.z - lowering * angle[0])
        load = Load(place, three(row, at.LOAD_VELOCITY, 1, 0))
        omega1 = 0.0
        lowest = highest = load.position.z - target
        errors[0] = load.position.z - target
        for i in range((path.shape[0] - 1) // 2):
            k = 2 * i
            start = _rope_end(path[k], angle[k], speed[k], drum)  # type: ignore[no-untyped-call]
            middle = _rope_end(path[k + 1], angle[k + 1], speed[k + 1], drum)  # type: ignore[no-untyped-call]
            end = _rope_end(path[k + 2], angle[k + 2], speed[k + 2], drum)  # type: ignore[no-untyped-call]
            load, cost, _ = rk4_step(load, start, middle, end, h, target, constants)
            omega1 += cost
            error = load.position.z - target
            errors[i + 1] = error
            lowest = min(lowest, error)
            highest = max(highest, error)
        return omega1, lowest, highest

    return evaluate


@cache
def _heavy_kernel() -> Callable[..., tuple[float, float, float]]:
    """As ``_kernel``, for a row that goes beyond the paper, and which hangs as it starts."""
    span = Span(1, 0, 1)

    @kernel
    def evaluate(path, angle, speed, row, h, errors):  # type: ignore[no-untyped-def]
        drum = _drum(row)  # type: ignore[no-untyped-call]
        springs = int(row[at.SPRINGS])
        row[at.STEP_LENGTH] = h
        interval = row[at.NODE_SEGMENTS] * row[at.CONTROL_PERIOD]
        omega1 = 0.0
        lowest = highest = errors[0] = row[at.LOAD_POSITION + 2] - row[at.LEVEL]
        for i in range((path.shape[0] - 1) // 2):
            for part in range(3):
                k = 2 * i + part
                point = path[k]
                end = _rope_end(point, angle[k], speed[k], drum)  # type: ignore[no-untyped-call]
                felt, reach = Vector(point[6], point[7], point[8]), (point[9], point[10])
                put_end(row, at.ENDS + part * at.END_SIZE, 1, 0, end, felt, reach)
                if part == 0:
                    put_three(row, at.PULLEY, 1, 0, end.position)
                    put_three(row, at.PULLEY + 3, 1, 0, end.velocity)
                level, _ = target_at(row, (i + 0.5 * part) * h, 1, 0)
                row[at.ENDS + part * at.END_SIZE + END_TARGET] = level
            # The row stays at the node of its start: the waves are taken from there.
            row[at.ELAPSED] = interval + i * h
            begin_water(row, span)
            row[at.MOMENT] = 0.5 * h
            lift_step(row, springs, False, span)
            omega1 += h * (1.0 / 6.0) * row[at.STAGE + COST]
            error = row[at.LOAD_POSITION + 2] - level
            errors[i + 1] = error
            lowest = min(lowest, error)
            highest = max(highest, error)
        return omega1, lowest, highest

    return evaluate


@cache
def _lanes_kernel() -> Callable[..., None]:

    @kernel
    def evaluate(path, angle, speed, more_angle, more_speed, row, lowering, h, errors):  # type: ignore[no-untyped-def]
        target, constants, drum = row[at.TARGET], load_constants(row, 1.0, 1, 0), _drum(row)  # type: ignore[no-untyped-call]
        lanes = more_angle.shape[1]
        place, velocity = three(row, at.LOAD_POSITION, 1, 0), three(row, at.LOAD_VELOCITY, 1, 0)
        # Arrays of their own, so that the compiler can tell them apart and vectorise the loop over lanes.
        x, y, z = np.full(lanes, place.x), np.full(lanes, place.y), np.full(lanes, place.z)
        u, v, w = np.full(lanes, velocity.x), np.full(lanes, velocity.y), np.full(lanes, velocity.z)
        for j in range(lanes):
            z[j] -= lowering * (angle[0] + more_angle[0, j])
            errors[0, j] = z[j] - target
        for i in range((path.shape[0] - 1) // 2):
            k = 2 * i
            a, b, c = path[k], path[k + 1], path[k + 2]
            angle_a, angle_b, angle_c = angle[k], angle[k + 1], angle[k + 2]
            speed_a, speed_b, speed_c = speed[k], speed[k + 1], speed[k + 2]
            for j in range(lanes):
                start = _rope_end(a, angle_a + more_angle[k, j], speed_a + more_speed[k, j], drum)  # type: ignore[no-untyped-call]
                middle = _rope_end(b, angle_b + more_angle[k + 1, j], speed_b + more_speed[k + 1, j], drum)  # type: ignore[no-untyped-call]
                end = _rope_end(c, angle_c + more_angle[k + 2, j], speed_c + more_speed[k + 2, j], drum)  # type: ignore[no-untyped-call]
                load = Load(Vector(x[j], y[j], z[j]), Vector(u[j], v[j], w[j]))
                load, _, _ = rk4_step(load, start, middle, end, h, target, constants)
                x[j], y[j], z[j] = load.position
                u[j], v[j], w[j] = load.velocity
                errors[i + 1, j] = load.position.z - target

    return evaluate


def _control_steps(duration: float, control_period: float) -> int:
    """Whole control steps in ``duration`` s."""
    require_number("control_period", control_period, "s", low=2e-3, high=2.0)
    steps = round(duration / control_period)
    if steps < 1 or abs(steps * control_period - duration) > 1e-9 * duration:
        raise InvalidValue(f"duration = {duration:g} s: must be whole control steps of {control_period:g} s")
    return steps


def _require_plain_drum(scenario: Scenario) -> None:
    """Raise where the drum does not simply go where a drive has it."""
    winch = scenario.crane.winch
    if winch.drive is not None:
        raise InvalidValue(
            f"drive = {shown(winch.drive)}: drives are optimised for a drum that turns as it is told: must be None"
        )
    for name, unit in (("max_power", "W"), ("max_torque", "N m"), ("drum_width", "m")):
        if getattr(winch, name):
            raise InvalidValue(
                f"{name} = {getattr(winch, name)!r} {unit}: drives are for a drum of one layer that turns as it is "
                f"told: must be 0 {unit}"
            )


class Objective:
    """A scenario laid out for fast evaluation: the pulley's path at every half inner step, computed once.

    With a ``control_period`` [s] the drum follows drives as the winch can, by the law of ``Follower``, from rest at 0;
    without, it follows them exactly. A drive that starts at φ_H(0) ≠ 0 has then paid out rope before the start: the
    load hangs at rest by so much lower, or higher.
    """

    def __init__(
        self, scenario: Scenario, duration: float, max_step: float = FINE_STEP, control_period: float | None = None
    ) -> None:
        """Lay out ``duration`` [s] in (0, 3600] of a scenario with inner steps of at most ``max_step`` s.

        With a control period, in [0.002, 2] s, the duration is whole control steps.
        """
        require_number("duration", duration, "s", low=0.0, high=3600.0, low_open=True)
        require_number("max_step", max_step, "s", low=2e-3, high=0.2)
        require_coverage(scenario.motion, "duration", duration)
        _require_plain_drum(scenario)
        max_step = min(max_step, scenario.chain_step, scenario.attached_step)
        self.scenario = scenario
        self.duration = float(duration)
        self.control_period = control_period
        controls = 1 if control_period is None else _control_steps(self.duration, control_period)
        self.steps = controls * inner_steps(self.duration / controls, max_step)
        self.step = self.duration / self.steps
        self._stride = 1 if control_period is None else 2 * self.steps // controls
        self.times = np.linspace(0.0, self.duration, 2 * self.steps + 1)
        """(2 steps + 1,) s, every half inner step."""
        self.samples = self.times[:: self._stride]
        """(S,) s, where drives are sampled: at ``times``, or at the ends of the control steps."""
        # The engine itself moves the deck; at the ends of its control steps the pulley's place is exact.
        engine = Engine(1, 0.5 * self.step, max_inner_step=0.2)
        engine.reset_row(0, scenario)
        row, still = engine.blocks[0], np.zeros(1)
        self.path = np.empty((len(self.times), 11))
        """(2 steps + 1, 11), at ``times``: the pulley's position, velocity and acceleration in the base frame, its
        distance from the drum and the rate of that."""
        self.path[0] = *row[at.PULLEY : at.PULLEY + 9], *row[at.REACH : at.REACH + 2]
        at_start = engine.copy_row(0)
        for i in range(1, len(self.times)):
            engine.step(still)
            self.path[i] = *row[at.PULLEY : at.PULLEY + 9], *row[at.REACH : at.REACH + 2]
        self._row = at_start
        """The engine's row of the scenario at the start, with what a step knows of load and rope."""
        for slot in (at.INVERSE_MASS, at.STIFFNESS):
            self._row[slot] = row[slot]
        crane = scenario.crane
        # A drum that starts at φ has paid out r φ of rope, which the load stretches, before the start.
        self._lowering = crane.winch.drum_radius * (1.0 + scenario.pulley_strain)
        self._errors = np.empty(self.steps + 1)

    def evaluate(self, angle: FloatArray, speed: FloatArray) -> Outcome:
        """Outcome of a drive's angle [rad] and speed [rad/s], given at ``samples``."""
        return self._evaluate(*self.drum(angle, speed))

    def _evaluate(self, angle: FloatArray, speed: FloatArray) -> Outcome:
        """Outcome of the drum's angle [rad] and speed [rad/s] at ``times``."""
        if self.scenario.is_light:
            arguments = self.path, angle, speed, self._row, self._lowering, self.step, self._errors
            omega1, lowest, highest = _kernel()(*arguments)
        else:
            row = self._hung(float(angle[0]))
            omega1, lowest, highest = _heavy_kernel()(self.path, angle, speed, row, self.step, self._errors)
        return Outcome(omega1, max(-lowest, highest), lowest, highest, self.duration)

    def _hung(self, angle: float) -> FloatArray:
        """Row of a rope with mass at the start, its drum at ``angle`` rad."""
        row = self._row.copy()
        row[at.FREE_LENGTH] += row[at.DRUM_RADIUS] * angle
        hang_rope(row, 1, 0, self.scenario.initial == "comoving")
        row[at.FREE_LENGTH] = self._row[at.FREE_LENGTH]
        row[at.LOAD_POSITION + 2] -= self._lowering * angle
        return row

    def drum(self, angle: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angle [rad] and speed [rad/s] of the drum at ``times``, under a drive's at ``samples``."""
        if self.control_period is None:
            return angle, speed
        reach = float(self._row[at.MIN_ANGLE]), float(self._row[at.MAX_ANGLE])
        return played(angle, speed, self.scenario.crane.winch, reach, self.control_period, self._stride)

    def errors(self, angle: FloatArray, speed: FloatArray) -> FloatArray:
        """x_L3 - h at the inner steps, (steps + 1,) m, under a drive's angle and speed at ``samples``."""
        self.evaluate(angle, speed)
        return self._errors.copy()

    def perturbed_errors(
        self, angle: FloatArray, speed: FloatArray, more_angle: FloatArray, more_speed: FloatArray
    ) -> FloatArray:
        """x_L3 - h (steps + 1, n) m under n perturbed drives: ``more_angle``, ``more_speed`` (S, n) are added.

        They run side by side, in the lanes of the processor's registers.
        """
        drum = self.drum(angle, speed)
        if self.control_period is not None:
            neighbours = [self.drum(angle + a, speed + s) for a, s in zip(more_angle.T, more_speed.T, strict=True)]
            moved = np.array(neighbours) - drum
            more_angle, more_speed = np.ascontiguousarray(moved.transpose(1, 2, 0))
        errors = np.empty((self.steps + 1, more_angle.shape[1]))
        if not self.scenario.is_light:
            for k, (more, faster) in enumerate(zip(more_angle.T, more_speed.T, strict=True)):
                self._evaluate(drum[0] + more, drum[1] + faster)
                errors[:, k] = self._errors
            return errors
        _lanes_kernel()(self.path, *drum, more_angle, more_speed, self._row, self._lowering, self.step, errors)
        return errors

    def drive(self, drive: Drive) -> Outcome:
        """Outcome of a drive."""
        return self.evaluate(drive.angle(self.samples), drive.speed(self.samples))

    def still(self) -> Outcome:
        """Outcome of leaving the drum alone."""
        nothing = np.zeros(len(self.samples))
        return self.evaluate(nothing, nothing)

    def trajectory(self, drive: Drive | None = None) -> tuple[FloatArray, FloatArray]:
        """Times (steps + 1,) s and x_L3 - h (steps + 1,) m under a drive, or with the drum still."""
        if drive is None:
            self.still()
        else:
            self.drive(drive)
        return self.times[::2].copy(), self._errors.copy()
