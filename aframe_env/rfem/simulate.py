"""Stand-alone runs of the full model: frame, rope, load and drum on a moving deck, eqs. (23)–(30).

The frame steps exactly in its modes under forces that are interpolated over the step; load and drum step by Fox and
Goodwin's scheme. The rope's force at the step's end is found by iteration to convergence (no splitting): the frame
answers it at S through constant 3 × 3 matrices, so that an iteration costs no step of the frame. Modes of a period
below two steps are left out, but for their static shapes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from aframe_env.rfem.beam import Array
from aframe_env.rfem.deck import DeckStates, deck_coordinates, deck_states
from aframe_env.rfem.exact_step import exact_step
from aframe_env.rfem.history import FrameHistory
from aframe_env.rfem.model import FrameModel, frame_model
from aframe_env.rfem.reduction import ModalFrame, of_motion, resolved_form
from aframe_env.rfem.rope_law import RopeForce, rope_force
from aframe_env.rfem.servomotor_stroke import Stroke, strokes_at
from aframe_env.rfem.statics import LoadCase, solve, static
from aframe_env.rfem.structure import cross_matrix
from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue, require_number


@dataclass(frozen=True, kw_only=True)
class StillDrum:
    """The drum does not turn."""


@dataclass(frozen=True, kw_only=True)
class PrescribedDrum:
    """Kinematic drum: φ_H is a given function of time."""

    angle: Callable[[float], float]
    """φ_H(t), rad, 0 at t = 0; positive pays out."""
    rate: Callable[[float], float]
    """Derivative φ̇_H(t), rad/s."""


@dataclass(frozen=True, kw_only=True)
class DrivenDrum:
    """Drum with inertia under a driving torque: I_H φ̈_H = M + T d_H/2."""

    inertia: float
    """I_H, kg m²."""
    torque: Callable[[float, float, float], float]
    """M(t, φ_H, φ̇_H), N m, positive pays out."""

    def __post_init__(self) -> None:
        require_number("inertia", self.inertia, "kg m²", low=0.0, low_open=True)


FOX_GOODWIN: Final = 1.0 / 12.0
"""β of load and drum: x(h) = x + h ẋ + (1/2 - β) h² ẍ + β h² ẍ(h), fourth order in the phase."""

Drum = StillDrum | PrescribedDrum | DrivenDrum


@dataclass(frozen=True, kw_only=True)
class DynamicCase:
    """One dynamic run."""

    scenario: Scenario = field(default_factory=Scenario.paper)
    """Crane, ship motion, load and rope; the load starts from static equilibrium. The luffing angle stays as it is, but
    for the small rotations that ``strokes`` make."""
    drum: Drum = field(default_factory=StillDrum)
    """Motion of the drum."""
    strokes: tuple[Stroke, Stroke] | None = None
    """Prescribed change of the lengths of rigid servomotors S_R and S_L; None: none."""
    duration: float = 60.0
    """s."""
    second_order: bool = False
    """Whether the frame has the geometric stiffness (P–Δ) of its state at rest, see
    :mod:`aframe_env.rfem.second_order`; that of the rope is there in any case."""
    step: float = 2.5e-3
    """Of frame, load and drum, s; made a little smaller so that a whole number of them makes an output interval."""
    output_interval: float = 0.05
    """s."""

    def __post_init__(self) -> None:
        self.scenario.require_light("stand-alone runs of the full model")
        require_number("duration", self.duration, "s", low=0.0, low_open=True)
        require_number("step", self.step, "s", low=0.0, low_open=True)
        require_number("output_interval", self.output_interval, "s", low=0.0, low_open=True)
        if self.output_interval > self.duration:
            raise InvalidValue(f"output_interval = {self.output_interval} s: must be in (0, {self.duration:g}] s")
        if self.strokes is not None and self.scenario.crane.frame.structure.servomotor.stiffness is not None:
            raise InvalidValue("strokes: must be None with elastic servomotors, as only rigid ones have a given length")


@dataclass(frozen=True, kw_only=True)
class DynamicResult:
    """A run at k times. The load in the base frame, the frame's vectors along {D}."""

    case: DynamicCase
    frame: FrameHistory
    load: Array
    """x_L, (k, 3), m."""
    load_velocity: Array
    """(k, 3), m/s."""
    tension: Array
    """Rope tension, (k,), N."""
    elastic_tension: Array
    """Part c Δ of the tension, (k,), N."""
    stretch: Array
    """Δ, (k,), m."""
    drum_angle: Array
    """φ_H, (k,), rad."""
    drum_rate: Array
    """(k,), rad/s."""
    deck: DeckStates

    @property
    def time(self) -> Array:
        """(k,), s."""
        return self.frame.time


class _Carriage:
    """The deck at every step, in the shape that the frame's axes {F} want."""

    def __init__(self, scenario: Scenario, model: FrameModel, step: float, count: int) -> None:
        self.states = deck_states(deck_coordinates(scenario, step, count))
        states, crane, to_deck = self.states, scenario.crane, model.to_deck
        self.pulley_place, self.pulley_speed = _carried_point(states, np.array(crane.pulley_position))
        self.drum_place, self.drum_speed = _carried_point(states, np.array(crane.drum_position))
        self.rotation = states.rotation @ to_deck
        """{F} → base frame, (k, 3, 3)."""
        gravity = np.array([0.0, 0.0, -scenario.gravity])
        self.field = np.einsum("kij,ki->kj", self.rotation, gravity - states.acceleration)
        self.spin = states.angular_velocity @ to_deck
        spin_up = states.angular_acceleration @ to_deck
        self.turns = bool(np.any(self.spin) or np.any(spin_up))
        skew = np.array([cross_matrix(vector) for vector in self.spin])
        self.turning = np.array([cross_matrix(vector) for vector in spin_up]) + skew @ skew
        self.coriolis = 2.0 * skew


def _carried_point(states: DeckStates, place: Array) -> tuple[Array, Array]:
    """Place and velocity in the base frame, (k, 3) each, of a point fixed at ``place`` in {D}."""
    position = states.position + states.rotation @ place
    turning = np.cross(states.angular_velocity, place)
    return position, states.velocity + np.einsum("kij,kj->ki", states.rotation, turning)


class _Run:
    """State and constants of one run; :func:`simulate` drives it."""

    def __init__(self, case: DynamicCase, model: FrameModel) -> None:
        inner = max(1, math.ceil(case.output_interval / case.step - 1e-9))
        self.case, self.model, self.inner = case, model, inner
        self.scenario, self.crane = case.scenario, case.scenario.crane
        self.outputs = max(1, round(case.duration / case.output_interval))
        self.step = case.output_interval / inner
        self.times: Array = self.step * np.arange(self.outputs * inner + 1, dtype=np.float64)
        self.carriage = _Carriage(self.scenario, model, self.step, self.times.size)
        self.modal = resolved_form(model, self.step)
        self.exact = exact_step(self.modal, self.step)
        self.stroke = strokes_at(case.strokes, self.times)
        given, shape = model.lengthening, self.modal.shape
        driving = np.hstack([model.uniform_field(), -(model.damping @ given), -(model.mass @ given)])
        driven_by = np.hstack([self.carriage.field, self.stroke[1], self.stroke[2]])
        self.driven = driven_by @ (shape.T @ driving).T
        """Forces on the modes that do not depend on their state, (steps, m)."""
        self.carried = _Carried(self.carriage, self.modal, self.stroke)
        self.pulley = model.pulley @ shape
        self.given = model.pulley @ given
        cubic, linear = (
            np.array([[self.pulley @ self.exact.times(part, self.pulley.T) for part in row] for row in factors])
            for factors in (self.exact.cubic, self.exact.linear)
        )
        self.answer = np.stack([cubic[:, 2], cubic[:, 3], linear[:, 1]], axis=1)
        """Place and rate of S by the rope's elastic force, its rate, and its damping force at the end: (2, 3, 3, 3)."""
        self.radius, self.unstretched = self.crane.winch.drum_radius, self.scenario.free_length
        self.place, self.rates = np.zeros(self.modal.count), np.zeros(self.modal.count)
        self.load, self.load_velocity, self.load_acceleration = (np.zeros(3) for _ in range(3))
        self.angle, self.rate, self.angular_acceleration = 0.0, 0.0, 0.0
        self.force = np.zeros(9)
        """Rope's force at S along {F}: elastic part, its rate, damping part; 3 each."""
        self.last_force, self.last_acceleration = np.zeros(9), np.zeros(3)
        self.rope = RopeForce(0.0, 0.0, 0.0)

    def start(self) -> None:
        """Start in static equilibrium with the deck level, carried to the deck's place at t = 0."""
        model, carriage = self.model, self.carriage
        tension = self.scenario.weight
        level = model.to_deck
        undeformed = np.array(self.crane.pulley_position)
        drum = np.array(self.crane.drum_position)
        deflection = np.zeros(3)
        position = np.zeros(model.structure.size)
        for _ in range(50):
            to_drum = drum - undeformed - deflection
            force = tension * (to_drum / np.linalg.norm(to_drum) - np.array([0.0, 0.0, 1.0]))
            right = model.weight(self.scenario.gravity) + (level.T @ force) @ model.pulley
            position = solve(model, right, self.stroke[0, 0])
            before, deflection = deflection, level @ model.pulley @ position
            if np.max(np.abs(deflection - before)) < 1e-13:
                break
        stretched = self.unstretched * (1.0 + tension / self.crane.rope.axial_stiffness)
        hanging = stretched - float(np.linalg.norm(drum - undeformed - deflection))
        states = carriage.states
        place = states.position[0] + states.rotation[0] @ (undeformed + deflection)
        self.load = place - np.array([0.0, 0.0, hanging])
        if self.scenario.initial == "comoving":
            arm = np.cross(states.angular_velocity[0], undeformed + deflection)
            self.load_velocity = states.velocity[0] + states.rotation[0] @ arm
        if isinstance(self.case.drum, PrescribedDrum):
            self.angle, self.rate = self.case.drum.angle(0.0), self.case.drum.rate(0.0)
        self.place = self.modal.coordinates(position - model.lengthening @ self.stroke[0, 0])
        self._evaluate(0, self.pulley @ self.place + self.given @ self.stroke[0, 0], self.given @ self.stroke[1, 0])
        self.last_force, self.last_acceleration = self.force, self.load_acceleration

    def _evaluate(self, index: int, deflection: Array, deflection_rate: Array) -> None:
        """Find rope force at S (along {F}) and accelerations of load and drum at the present state of these two."""
        scenario, drum, carriage = self.scenario, self.case.drum, self.carriage
        turn = carriage.rotation[index]
        moving = deflection_rate
        if carriage.turns:
            moving = moving + np.cross(carriage.spin[index], deflection)
        sx, sy, sz = (carriage.pulley_place[index] + turn @ deflection).tolist()
        ux, uy, uz = (carriage.pulley_speed[index] + turn @ moving).tolist()
        # Plain numbers: this runs several times a step, and small arrays would cost more than the frame.
        lx, ly, lz = self.load.tolist()
        vx, vy, vz = self.load_velocity.tolist()
        hx, hy, hz = carriage.drum_place[index].tolist()
        wx, wy, wz = carriage.drum_speed[index].tolist()
        lx, ly, lz, hx, hy, hz = lx - sx, ly - sy, lz - sz, hx - sx, hy - sy, hz - sz
        hanging, inboard = math.sqrt(lx * lx + ly * ly + lz * lz), math.sqrt(hx * hx + hy * hy + hz * hz)
        lx, ly, lz = lx / hanging, ly / hanging, lz / hanging
        hx, hy, hz = hx / inboard, hy / inboard, hz / inboard
        length = self.unstretched + self.radius * self.angle
        hanging_rate = lx * (vx - ux) + ly * (vy - uy) + lz * (vz - uz)
        inboard_rate = hx * (wx - ux) + hy * (wy - uy) + hz * (wz - uz)
        geometric_rate, unstretched_rate = hanging_rate + inboard_rate, self.radius * self.rate
        stiffness = self.crane.rope.axial_stiffness / length
        self.rope = rope_force(
            geometric=hanging + inboard,
            geometric_rate=geometric_rate,
            unstretched=length,
            unstretched_rate=unstretched_rate,
            stiffness=stiffness,
            damping=scenario.rope_damping,
        )
        tension = self.rope.tension
        towards = np.array([lx + hx, ly + hy, lz + hz]) @ turn
        # How the directions turn is left out of the rate: between its ends the force is none the worse for it.
        elastic = self.rope.stretch * stiffness if tension else 0.0
        growth = (
            stiffness * (geometric_rate - unstretched_rate * (1.0 + self.rope.stretch / length)) if tension else 0.0
        )
        self.force = np.outer([elastic, growth, tension - elastic], towards).ravel()
        pull = tension / scenario.load_mass
        self.load_acceleration = np.array([-pull * lx, -pull * ly, -pull * lz - scenario.gravity])
        if isinstance(drum, DrivenDrum):
            torque = drum.torque(float(self.times[index]), self.angle, self.rate)
            self.angular_acceleration = (torque + self.pull(self.rope) * self.radius) / drum.inertia

    def pull(self, rope: RopeForce) -> float:
        """Force of the rope on the drum: rope that leaves it takes strain energy along, c = E_R F_R / l, eq. (25)."""
        return rope.tension + 0.5 * rope.elastic**2 / self.crane.rope.axial_stiffness

    def advance(self, index: int) -> None:
        """Step to time ``index``."""
        exact, h = self.exact, self.step
        half, early, late = 0.5 * h, (0.5 - FOX_GOODWIN) * h**2, FOX_GOODWIN * h**2
        load = self.load + h * self.load_velocity + early * self.load_acceleration
        load_rate = self.load_velocity + half * self.load_acceleration
        angle = self.angle + h * self.rate + early * self.angular_acceleration
        rate = self.rate + half * self.angular_acceleration
        drum = self.case.drum
        if isinstance(drum, PrescribedDrum):
            time = float(self.times[index])
            self.angle, self.rate = drum.angle(time), drum.rate(time)
        before = self.driven[index - 1] + self.carried.force(index - 1, self.place, self.rates)
        elastic, growth, damping = self.force.reshape(3, 3) @ self.pulley
        known = [
            exact.times(exact.free[row, 0], self.place)
            + exact.times(exact.free[row, 1], self.rates)
            + exact.times(exact.cubic[row, 0], elastic)
            + exact.times(exact.cubic[row, 1], growth)
            + exact.times(exact.linear[row, 0], before + damping)
            + exact.times(exact.linear[row, 1], self.driven[index])
            for row in range(2)
        ]
        given = self.given @ self.stroke[:2, index].T
        # c times the rounding of a length is some 1e-16 E_R F_R: ask for no more than that allows.
        tolerance = 1e-11 * self.scenario.weight + 1e-14 * self.crane.rope.axial_stiffness
        # Begin the iteration where force and load go on as they did in the last step.
        force, pulled = self.force, self.load_acceleration
        self.force = 2.0 * force - self.last_force
        self.load_acceleration = 2.0 * pulled - self.last_acceleration
        self.last_force, self.last_acceleration = force, pulled
        place, rates = known
        for _ in range(30 if self.carriage.turns else 1):
            carried = self.carried.force(index, place, rates)
            begun = [part + exact.times(exact.linear[row, 1], carried) for row, part in enumerate(known)]
            base = [self.pulley @ part + given[:, row] for row, part in enumerate(begun)]
            for _ in range(60):
                answer = np.einsum("rkab,kb->ra", self.answer, self.force.reshape(3, 3))
                felt = self.force
                self.load = load + late * self.load_acceleration
                self.load_velocity = load_rate + half * self.load_acceleration
                if isinstance(drum, DrivenDrum):
                    self.angle = angle + late * self.angular_acceleration
                    self.rate = rate + half * self.angular_acceleration
                self._evaluate(index, base[0] + answer[0], base[1] + answer[1])
                change = np.abs(self.force - felt)
                if float(max(change[:3].max(), change[6:].max())) <= tolerance:
                    break
            else:
                raise InvalidValue(
                    f"step = {self.case.step} s: must be smaller, as the rope's force did not converge at "
                    f"t = {self.times[index]:.4f} s"
                )
            elastic, growth, damping = self.force.reshape(3, 3) @ self.pulley
            ends = [
                part
                + exact.times(exact.cubic[row, 2], elastic)
                + exact.times(exact.cubic[row, 3], growth)
                + exact.times(exact.linear[row, 1], damping)
                for row, part in enumerate(begun)
            ]
            moved = max(float(np.max(np.abs(ends[0] - place))), h * float(np.max(np.abs(ends[1] - rates))))
            place, rates = ends
            if not self.carriage.turns or moved <= 1e-9 * max(1.0, float(np.max(np.abs(place)))):
                break
        self.place, self.rates = place, rates


class _Carried:
    """Forces on the modes by the deck's turning, beyond the uniform field: less E_1 W + E(W) q + E(2 Ω×) q̇."""

    def __init__(self, carriage: _Carriage, modal: ModalFrame, stroke: Array) -> None:
        self._turns, self._none = carriage.turns, np.zeros(modal.count)
        if not carriage.turns:
            return
        # W and 2 Ω× along {D}, as the tables of the modal form have them.
        to_deck = modal.model.to_deck
        self._turning, self._coriolis = (
            (to_deck @ part @ to_deck.T).reshape(-1, 9) for part in (carriage.turning, carriage.coriolis)
        )
        self._own = np.ascontiguousarray(
            modal.project(modal.carried).reshape(modal.count, modal.count, 9).transpose(2, 0, 1)
        )
        given = modal.project(of_motion(modal.model, modal.model.lengthening)).reshape(modal.count, 2, 9)
        self._constant = self._turning @ modal.project(modal.turning).reshape(-1, 9).T
        self._constant += np.einsum("kw,mbw,kb->km", self._turning, given, stroke[0])
        self._constant += np.einsum("kw,mbw,kb->km", self._coriolis, given, stroke[1])

    def force(self, index: int, place: Array, rates: Array) -> Array:
        """At time ``index``, of η and η̇, (m,)."""
        if not self._turns:
            return self._none
        own = self._turning[index] @ (self._own @ place) + self._coriolis[index] @ (self._own @ rates)
        return np.asarray(-self._constant[index] - own)


def simulate(case: DynamicCase | None = None, *, model: FrameModel | None = None) -> DynamicResult:
    """Run the full model with rope, load and drum on a moving deck.

    Args:
        case: The run; default the paper's case with the drum still.
        model: The frame's model, if it is not to be the default one (10 and 8 elements).

    Warns:
        SmallRotationWarning: An rfe turns by more than 0.05 rad.

    Raises:
        InvalidValue: The step is too long for the rope, or a recorded motion too short for the run.
    """
    what = case or DynamicCase()
    frame = model or frame_model(what.scenario.crane.frame)
    if frame.frame != what.scenario.crane.frame:
        raise InvalidValue("model: must have been made of the frame of the scenario's crane")
    if what.second_order:
        hanging = LoadCase(rope_tension=what.scenario.weight, second_order=True)
        frame = static(what.scenario.crane, hanging, model=frame).model
    run = _Run(what, frame)
    run.start()
    count = run.outputs + 1
    states = np.zeros((count, 2, run.modal.count))
    body = np.zeros((count, 11))
    forces = np.zeros((count, 3))

    def store(output: int) -> None:
        states[output] = run.place, run.rates
        body[output] = [*run.load, *run.load_velocity, *run.rope, run.angle, run.rate]
        forces[output] = run.force[:3] + run.force[6:]

    store(0)
    for output in range(1, count):
        for index in range((output - 1) * run.inner + 1, output * run.inner + 1):
            run.advance(index)
        store(output)

    kept = slice(0, None, run.inner)
    full = states @ run.modal.shape.T
    stroke = run.stroke[:, kept]
    full += (stroke[:2] @ frame.lengthening.T).transpose(1, 0, 2)
    force = run.carriage.field[kept] @ frame.uniform_field().T + forces @ frame.pulley
    if run.carriage.turns:
        for output, (position, velocity) in enumerate(full):
            turning, coriolis = (part[output * run.inner] for part in (run.carriage.turning, run.carriage.coriolis))
            force[output] -= frame.slices.of_field(turning) + frame.slices.of_motion(turning, position)
            force[output] -= frame.slices.of_motion(coriolis, velocity)
    frame.warn_of_rotation(full[:, 0])
    return DynamicResult(
        case=what,
        frame=FrameHistory(
            model=frame,
            time=run.times[kept],
            position=full[:, 0],
            velocity=full[:, 1],
            force=force,
            field=run.carriage.field[kept],
            stroke=None if what.strokes is None else stroke,
        ),
        load=body[:, :3],
        load_velocity=body[:, 3:6],
        tension=body[:, 6],
        elastic_tension=body[:, 7],
        stretch=body[:, 8],
        drum_angle=body[:, 9],
        drum_rate=body[:, 10],
        deck=run.carriage.states.every(run.inner),
    )
