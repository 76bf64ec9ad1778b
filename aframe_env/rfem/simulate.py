"""Stand-alone runs of the full model: frame, rope, load and drum on a moving deck, eqs. (23)–(30).

The frame's coordinates are those left by the constraints; frame, load and drum all step with average
acceleration. In a step the rope's force at its end is found by iteration to convergence (no splitting): the
frame answers a force at S through a constant 3 × 3 matrix, so that an iteration costs no solution of the
frame.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from aframe_env.rfem.beam import Array
from aframe_env.rfem.deck import DeckStates, deck_coordinates, deck_states
from aframe_env.rfem.history import FrameHistory
from aframe_env.rfem.integrator import AverageAcceleration
from aframe_env.rfem.model import CarriedInertia, FrameModel, apply_blocks, frame_model
from aframe_env.rfem.rope_law import RopeForce, rope_force
from aframe_env.rfem.servomotor_stroke import Stroke, strokes_at
from aframe_env.rfem.statics import solve
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
    step: float = 2.5e-3
    """s; made a little smaller so that a whole number of them makes an output interval."""
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
        self.scheme = AverageAcceleration(model, case.output_interval / inner)
        self.times: Array = self.scheme.step * np.arange(self.outputs * inner + 1, dtype=np.float64)
        self.carriage = _Carriage(self.scenario, model, self.scheme.step, self.times.size)
        self.inertia = CarriedInertia(model)
        self.turned = (-1, np.zeros(0), np.zeros(0), np.zeros(0))
        self.uniform = model.uniform_field()
        self.stroke = strokes_at(case.strokes, self.times)
        given = model.lengthening
        driving = np.hstack([self.uniform, -model.stiffness @ given, -model.damping @ given])
        self.driving = np.ascontiguousarray(model.constraints.basis.T @ driving)
        self.driven_by = np.hstack([self.carriage.field, self.stroke[0], self.stroke[1]])
        self.coupling = self.scheme.pulley @ self.scheme.response
        self.radius, self.unstretched = self.crane.winch.drum_radius, self.scenario.free_length
        self.load, self.load_velocity, self.load_acceleration = (np.zeros(3) for _ in range(3))
        self.angle, self.rate, self.angular_acceleration = 0.0, 0.0, 0.0
        self.force = np.zeros(3)
        self.last_force, self.last_acceleration = np.zeros(3), np.zeros(3)
        self.rope = RopeForce(0.0, 0.0, 0.0)

    def start(self) -> None:
        """Start in static equilibrium with the deck level, carried to the deck's place at t = 0."""
        model, scheme, carriage = self.model, self.scheme, self.carriage
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
        at_rest = (position * model.mass) @ model.constraints.basis
        self._evaluate(0, scheme.pulley @ at_rest, np.zeros(3))
        self.last_force, self.last_acceleration = self.force, self.load_acceleration
        loads = self._carried(0, at_rest, np.zeros_like(at_rest)) + self.force @ scheme.pulley
        scheme.start(at_rest, np.zeros_like(at_rest), loads)

    def _carried(self, index: int, position: Array, velocity: Array) -> Array:
        """Generalised forces on the free coordinates, (n_z,): weight, inertial terms of the deck's motion, servomotors.

        The servomotors' are −K P b − L P ḃ; P is M-orthogonal to Z, so that b̈ drops out.
        """
        force = self.driving @ self.driven_by[index]
        if not self.carriage.turns:
            return np.asarray(force)
        basis, given = self.model.constraints.basis, self.model.lengthening
        place = basis @ position + given @ self.stroke[0, index]
        rate = basis @ velocity + given @ self.stroke[1, index]
        return np.asarray(force - self.inertial(index, place, rate) @ basis)

    def inertial(self, index: int, position: Array, velocity: Array) -> Array:
        """e_F of a turning deck beyond the uniform field, (n,)."""
        if index != self.turned[0]:
            carriage, inertia = self.carriage, self.inertia
            turning = carriage.turning[index]
            self.turned = (
                index,
                inertia.constant(np.zeros(3), turning),
                inertia.blocks(turning),
                inertia.blocks(carriage.coriolis[index]),
            )
        _, constant, centrifugal, coriolis = self.turned
        return constant + apply_blocks(centrifugal, position) + apply_blocks(coriolis, velocity)

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
        self.rope = rope_force(
            geometric=hanging + inboard,
            geometric_rate=hanging_rate + inboard_rate,
            unstretched=length,
            unstretched_rate=self.radius * self.rate,
            stiffness=self.crane.rope.axial_stiffness / length,
            damping=scenario.rope_damping,
        )
        tension = self.rope.tension
        self.force = tension * np.array([lx + hx, ly + hy, lz + hz]) @ turn
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
        scheme, h = self.scheme, self.scheme.step
        half, quarter = 0.5 * h, 0.25 * h**2
        load = self.load + h * self.load_velocity + quarter * self.load_acceleration
        load_rate = self.load_velocity + half * self.load_acceleration
        angle = self.angle + h * self.rate + quarter * self.angular_acceleration
        rate = self.rate + half * self.angular_acceleration
        drum = self.case.drum
        if isinstance(drum, PrescribedDrum):
            time = float(self.times[index])
            self.angle, self.rate = drum.angle(time), drum.rate(time)
        place, speed = scheme.predict()
        acceleration = scheme.acceleration
        # c times the rounding of a length is some 1e-16 E_R F_R: ask for no more than that allows.
        tolerance = 1e-11 * self.scenario.weight + 1e-14 * self.crane.rope.axial_stiffness
        # Begin the iteration where force and load go on as they did in the last step.
        force, pulled = self.force, self.load_acceleration
        self.force = 2.0 * force - self.last_force
        self.load_acceleration = 2.0 * pulled - self.last_acceleration
        self.last_force, self.last_acceleration = force, pulled
        for _ in range(30 if self.carriage.turns else 1):
            free = scheme.solve(self._carried(index, *scheme.ends(acceleration)))
            own = scheme.pulley @ free
            base = scheme.pulley @ place + quarter * own
            base_rate = scheme.pulley @ speed + half * own
            for _ in range(60):
                answer = self.coupling @ self.force
                before = self.force
                self.load = load + quarter * self.load_acceleration
                self.load_velocity = load_rate + half * self.load_acceleration
                if isinstance(drum, DrivenDrum):
                    self.angle = angle + quarter * self.angular_acceleration
                    self.rate = rate + half * self.angular_acceleration
                self._evaluate(index, base + quarter * answer, base_rate + half * answer)
                if float(abs(self.force - before).max()) <= tolerance:
                    break
            else:
                raise InvalidValue(
                    f"step = {self.case.step} s: must be smaller, as the rope's force did not converge at "
                    f"t = {self.times[index]:.4f} s"
                )
            latest = free + scheme.response @ self.force
            change = np.max(np.abs(latest - acceleration))
            acceleration = latest
            if not self.carriage.turns or change <= 1e-9 * max(1.0, float(np.max(np.abs(latest)))):
                break
        scheme.finish(acceleration)


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
    run = _Run(what, frame)
    run.start()
    count, size = run.outputs + 1, run.scheme.position.size
    states = np.zeros((count, 2, size))
    body = np.zeros((count, 11))
    forces = np.zeros((count, 3))

    def store(output: int) -> None:
        states[output] = run.scheme.position, run.scheme.velocity
        body[output] = [*run.load, *run.load_velocity, *run.rope, run.angle, run.rate]
        forces[output] = run.force

    store(0)
    for output in range(1, count):
        for index in range((output - 1) * run.inner + 1, output * run.inner + 1):
            run.advance(index)
        store(output)

    kept = slice(0, None, run.inner)
    full = states @ frame.constraints.basis.T
    stroke = run.stroke[:, kept]
    full += (stroke[:2] @ frame.lengthening.T).transpose(1, 0, 2)
    force = run.carriage.field[kept] @ run.uniform.T + forces @ frame.pulley
    if run.carriage.turns:
        for output in range(count):
            force[output] -= run.inertial(output * run.inner, *full[output])
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
