"""Stand-alone runs of the full model: frame, rope, load and drum on a moving deck, eqs. (23)–(30).

The frame steps exactly in its modes under forces that are interpolated over the step; load and drum step by Fox and
Goodwin's scheme. The rope's force at the step's end is found by iteration to convergence (no splitting): the frame
answers it at S through constant 3 × 3 matrices, so that an iteration costs no step of the frame. Modes of a period
below two steps are left out, but for their static shapes. Of a frame that luffs see :mod:`aframe_env.rfem.luffed`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from aframe_env.rfem.beam import Array
from aframe_env.rfem.carriage import Carriage
from aframe_env.rfem.deck import DeckStates
from aframe_env.rfem.history import FrameHistory
from aframe_env.rfem.luffed import angle_nodes, luffed_frame, model_at
from aframe_env.rfem.model import FrameModel, frame_model
from aframe_env.rfem.rope_law import RopeForce, rope_force
from aframe_env.rfem.servomotor_stroke import Stroke, strokes_at
from aframe_env.rfem.stage import Stage
from aframe_env.rfem.statics import at_rest, solve
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
    """Crane, ship motion, load and rope; the load starts from static equilibrium. Where it has no ``luffing`` the
    luffing angle stays as it is, but for the small rotations that ``strokes`` make."""
    drum: Drum = field(default_factory=StillDrum)
    """Motion of the drum."""
    strokes: tuple[Stroke, Stroke] | None = None
    """Prescribed change of the lengths of rigid servomotors S_R and S_L; None: none but what the luffing asks for."""
    duration: float = 60.0
    """s."""
    second_order: bool = False
    """Whether the frame has the geometric stiffness (P–Δ) of its state at rest, see
    :mod:`aframe_env.rfem.second_order`; where it luffs, at rest at each of the angles that have modes of their own.
    That of the rope is there in any case."""
    step: float = 2.5e-3
    """Of frame, load and drum, s; made a little smaller so that a whole number of them makes an output interval."""
    output_interval: float = 0.05
    """s."""

    def __post_init__(self) -> None:
        replace(self.scenario, luffing=None).require_light("stand-alone runs of the full model")
        require_number("duration", self.duration, "s", low=0.0, low_open=True)
        require_number("step", self.step, "s", low=0.0, low_open=True)
        require_number("output_interval", self.output_interval, "s", low=0.0, low_open=True)
        if self.output_interval > self.duration:
            raise InvalidValue(f"output_interval = {self.output_interval} s: must be in (0, {self.duration:g}] s")
        elastic = self.scenario.crane.frame.structure.servomotor.stiffness
        if self.strokes is not None and elastic is not None:
            raise InvalidValue("strokes: must be None with elastic servomotors, as only rigid ones have a given length")
        if self.scenario.luffing is not None:
            self.scenario.luffing.require_rigid_servomotors(self.scenario.crane.frame)
            if self.strokes is not None:
                raise InvalidValue("strokes: must be None with luffing, which has strokes of its own")


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


class _Run:
    """State and constants of one run; :func:`simulate` drives it."""

    def __init__(self, case: DynamicCase, model: FrameModel) -> None:
        inner = max(1, math.ceil(case.output_interval / case.step - 1e-9))
        self.case, self.model, self.inner = case, model, inner
        self.scenario, self.crane = case.scenario, case.scenario.crane
        self.outputs = max(1, round(case.duration / case.output_interval))
        self.step = case.output_interval / inner
        self.times: Array = self.step * np.arange(self.outputs * inner + 1, dtype=np.float64)
        luffing = self.scenario.luffing
        self.luffed = None if luffing is None else luffed_frame(model.frame, luffing, self.times)
        self.carriage = Carriage(self.scenario, model, self.luffed, self.step, self.times.size)
        self.nodes = np.array([model.frame.luffing_angle]) if luffing is None else angle_nodes(luffing)
        self.stages: dict[int, Stage] = {}
        self.stage = self._stage_at(0)
        self.stroke = strokes_at(case.strokes, self.times)
        """s, ṡ, s̈ at every step, (3, steps, 2); of a frame that luffs as the run finds them."""
        self.across = np.zeros(2)
        """Last forces of the servomotors on N_R and N_L across their line in the stage, N."""
        self.radius, self.unstretched = self.crane.winch.drum_radius, self.scenario.free_length
        self.place, self.rates = np.zeros(self.stage.count), np.zeros(self.stage.count)
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
        still = np.zeros_like(position)
        self.place, self.rates = self.stage.coordinates(position, still, self.stroke[:2, 0])
        self._beside(0, self.place, self.rates)
        self._evaluate(0, *self._pulley(0, (self.place, self.rates)))
        self._beside(0, self.place, self.rates)
        self.last_force, self.last_acceleration = self.force, self.load_acceleration

    def _stage_at(self, index: int) -> Stage:
        """Stage whose luffing angle is the nearest at time ``index``."""
        angle = self.model.frame.luffing_angle if self.luffed is None else self.luffed.swing.angle[index]
        node = int(np.argmin(np.abs(self.nodes - angle)))
        if node not in self.stages:
            model = self.model
            if self.luffed is not None:
                model = model_at(model, float(self.nodes[node]))
                model = at_rest(self.scenario, model) if self.case.second_order else model
            self.stages[node] = Stage(model, self.carriage, self.luffed, self.step)
        return self.stages[node]

    def state(self, index: int) -> tuple[Array, Array]:
        """q and q̇, (n,), at time ``index``, the present one."""
        stage, stroke = self.stage, self.stroke[:, index]
        return stage.shape @ self.place + stage.given @ stroke[0], stage.shape @ self.rates + stage.given @ stroke[1]

    def _pulley(self, index: int, modes: Sequence[Array]) -> list[Array]:
        """Displacement of S along {F} and its rate, (3,), by η and η̇."""
        stage = self.stage
        return [stage.pulley @ part + stage.pulley_given @ self.stroke[row, index] for row, part in enumerate(modes)]

    def _beside(self, index: int, place: Array, rates: Array) -> Array:
        """Forces on the modes beside the rope's, (m,); writes the stroke of a frame that luffs."""
        pull = self.force[:3] + self.force[6:]
        total, self.across = self.stage.forces(index, place, rates, self.stroke[:, index], pull)
        return total

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
        stage = self._stage_at(index)
        if stage is not self.stage:
            position, velocity = self.state(index - 1)
            self.stage = stage
            self.place, self.rates = stage.coordinates(position, velocity, self.stroke[:2, index - 1])
        exact, h = stage.exact, self.step
        half, early, late = 0.5 * h, (0.5 - FOX_GOODWIN) * h**2, FOX_GOODWIN * h**2
        load = self.load + h * self.load_velocity + early * self.load_acceleration
        load_rate = self.load_velocity + half * self.load_acceleration
        angle = self.angle + h * self.rate + early * self.angular_acceleration
        rate = self.rate + half * self.angular_acceleration
        drum = self.case.drum
        if isinstance(drum, PrescribedDrum):
            time = float(self.times[index])
            self.angle, self.rate = drum.angle(time), drum.rate(time)
        before = self._beside(index - 1, self.place, self.rates)
        elastic, growth, damping = self.force.reshape(3, 3) @ stage.pulley
        known = [
            exact.times(exact.free[row, 0], self.place)
            + exact.times(exact.free[row, 1], self.rates)
            + exact.times(exact.cubic[row, 0], elastic)
            + exact.times(exact.cubic[row, 1], growth)
            + exact.times(exact.linear[row, 0], before + damping)
            for row in range(2)
        ]
        # c times the rounding of a length is some 1e-16 E_R F_R: ask for no more than that allows.
        tolerance = 1e-11 * self.scenario.weight + 1e-14 * self.crane.rope.axial_stiffness
        # Begin the iteration where force and load go on as they did in the last step.
        force, pulled = self.force, self.load_acceleration
        self.force = 2.0 * force - self.last_force
        self.load_acceleration = 2.0 * pulled - self.last_acceleration
        self.last_force, self.last_acceleration = force, pulled
        place, rates = known
        for _ in range(30 if stage.depends else 1):
            aside = self._beside(index, place, rates)
            begun = [part + exact.times(exact.linear[row, 1], aside) for row, part in enumerate(known)]
            base = self._pulley(index, begun)
            for _ in range(60):
                answer = np.einsum("rkab,kb->ra", stage.answer, self.force.reshape(3, 3))
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
            elastic, growth, damping = self.force.reshape(3, 3) @ stage.pulley
            ends = [
                part
                + exact.times(exact.cubic[row, 2], elastic)
                + exact.times(exact.cubic[row, 3], growth)
                + exact.times(exact.linear[row, 1], damping)
                for row, part in enumerate(begun)
            ]
            moved = max(float(np.max(np.abs(ends[0] - place))), h * float(np.max(np.abs(ends[1] - rates))))
            place, rates = ends
            if not stage.depends or moved <= 1e-9 * max(1.0, float(np.max(np.abs(place)))):
                break
        self.place, self.rates = place, rates


def simulate(case: DynamicCase | None = None, *, model: FrameModel | None = None) -> DynamicResult:
    """Run the full model with rope, load and drum on a moving deck.

    Args:
        case: The run; default the paper's case with the drum still.
        model: The frame's model, if it is not to be the default one (10 and 8 elements); of a frame that luffs,
            at its first luffing angle.

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
        frame = at_rest(what.scenario, frame)
    run = _Run(what, frame)
    run.start()
    count = run.outputs + 1
    full = np.zeros((count, 2, frame.structure.size))
    body = np.zeros((count, 11))
    forces, across = np.zeros((count, 3)), np.zeros((count, 2))
    stages: list[Stage] = []

    def store(output: int) -> None:
        full[output] = run.state(output * run.inner)
        body[output] = [*run.load, *run.load_velocity, *run.rope, run.angle, run.rate]
        forces[output], across[output] = run.force[:3] + run.force[6:], run.across
        stages.append(run.stage)

    store(0)
    for output in range(1, count):
        for index in range((output - 1) * run.inner + 1, output * run.inner + 1):
            run.advance(index)
        store(output)

    kept = slice(0, None, run.inner)
    force = run.carriage.field[kept] @ frame.uniform_field().T + forces @ frame.pulley
    if run.carriage.turns:
        for output, (position, velocity) in enumerate(full):
            turning, coriolis = (part[output * run.inner] for part in (run.carriage.turning, run.carriage.coriolis))
            force[output] -= frame.slices.of_field(turning) + frame.slices.of_motion(turning, position)
            force[output] -= frame.slices.of_motion(coriolis, velocity)
    history = FrameHistory(
        model=frame,
        time=run.times[kept],
        position=full[:, 0],
        velocity=full[:, 1],
        force=force,
        field=run.carriage.field[kept],
        stroke=None if what.strokes is None else run.stroke[:, kept],
    )
    if run.luffed is not None:
        others = full[:, 1] @ frame.damping - force
        rows = zip(range(0, run.times.size, run.inner), full[:, 0], others, across, run.stroke[2, kept], strict=True)
        reactions = np.array([stage.reactions(*row) for stage, row in zip(stages, rows, strict=True)])
        history = replace(history, luffed=run.luffed.every(run.inner), held=reactions)
    frame.warn_of_rotation(full[:, 0])
    return DynamicResult(
        case=what,
        frame=history,
        load=body[:, :3],
        load_velocity=body[:, 3:6],
        tension=body[:, 6],
        elastic_tension=body[:, 7],
        stretch=body[:, 8],
        drum_angle=body[:, 9],
        drum_rate=body[:, 10],
        deck=run.carriage.states.every(run.inner),
    )
