"""Static load cases: reactions, servomotor tensions, deflections, section forces, stress."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from aframe_env.rfem.banded import BandedCholesky
from aframe_env.rfem.beam import Array
from aframe_env.rfem.model import DOWN, FrameModel, frame_model
from aframe_env.rfem.second_order import Geometry, stiffened
from aframe_env.rfem.section_forces import Cut, PointForce, SectionForces, von_mises
from aframe_env.rfem.structure import members_of
from aframe_env.scenario.crane import GRAVITY, Vector
from aframe_env.validation import InvalidValue, require_choice, require_number, require_vector

if TYPE_CHECKING:
    from aframe_env.scenario import Scenario
    from aframe_env.scenario.crane import Crane

LOADED_POINTS = ("S", "N_R", "N_L", "B_R", "B_L")
"""Points that a load case may load and whose deflection comes out."""

SECOND_ORDER_ITERATIONS = 50
"""Most iterations to an equilibrium of second order; each gains two digits or so."""

ADJOINING = 0.1
"""Length over which :meth:`StaticResult.reference_case` averages N, V and T beside a point, m: one element
of the reference program, whose section forces are constant in an element."""


@dataclass(frozen=True, kw_only=True)
class LoadCase:
    """Loads on the frame at rest."""

    own_weight: bool = True
    """Own weight of legs and beam."""
    forces: Mapping[str, Vector] = field(default_factory=dict)
    """Point (one of S, N_R, N_L, B_R, B_L) → force in {D}, N."""
    rope_tension: float = 0.0
    """Tension at S along both rope legs, N, 0 or more: down to the load and towards the drum."""
    second_order: bool = False
    """Whether the frame gives way by what is of second order in its displacements too (P–Δ)."""
    rope_follows: bool = False
    """Whether the rope between S and the drum turns as S moves; with ``second_order`` only."""

    def __post_init__(self) -> None:
        require_number("rope_tension", self.rope_tension, "N", low=0.0)
        if self.rope_follows and not self.second_order:
            raise InvalidValue("rope_follows = True: only with second_order = True")
        for name, force in self.forces.items():
            require_choice("forces", name, LOADED_POINTS)
            require_vector(f"forces.{name}", force, "N")


@dataclass(frozen=True, kw_only=True)
class Station:
    """Section forces and stress at one place of the frame."""

    member: str
    """right leg, top beam or left leg."""
    position: float
    """Distance from the member's first end along the chain A_R → B_R → B_L → A_L, m."""
    along: float
    """Distance from A_R along the chain, m."""
    place: Array
    """Undeformed place in {D}, (3,), m."""
    forces: Array
    """N, V2, V3 (N), T, M2, M3 (N m); (6,)."""
    von_mises: float
    """Largest von Mises stress of the section, Pa."""


@dataclass(frozen=True, kw_only=True)
class StaticResult:
    """The frame under a static load case. Vectors are along {D}."""

    model: FrameModel
    """With the geometric stiffness of the state where that is of second order."""
    case: LoadCase
    position: Array
    """q, (n,)."""
    reactions: dict[str, Array]
    """A_R, A_L: force on the frame by the deck, (3,), N."""
    servomotor_tension: dict[str, float]
    """R, L: N, tension positive."""
    displacement: dict[str, Array]
    """Point → displacement, (3,), m."""
    rotation: dict[str, Array]
    """Point → small rotation, (3,), rad."""
    section_forces: SectionForces

    def along(self, per_member: int = 49) -> list[Station]:
        """Section forces at ``per_member`` equally spaced places of each member and either side of N and
        S."""
        model = self.model
        members = members_of(model.frame)
        stations, offset = [], 0.0
        for index, member in enumerate(members):
            cuts = [
                # At A_L before its reaction, as at A_R behind it.
                Cut(member=index, position=float(x), behind_point=bool(x < member.length))
                for x in np.linspace(0.0, member.length, per_member)
            ]
            special = {"top beam": ["S"], "right leg": ["N_R"], "left leg": ["N_L"]}[member.name]
            for name in special:
                where = _position(model, name)[1]
                cuts += [Cut(member=index, position=where, behind_point=side) for side in (False, True)]
            for cut in sorted(cuts, key=lambda item: (item.position, item.behind_point)):
                forces = self.section_forces.at(cut)
                stations.append(
                    Station(
                        member=member.name,
                        position=cut.position,
                        along=offset + cut.position,
                        place=model.to_deck @ (member.start + cut.position * member.axes[:, 0]),
                        forces=forces,
                        von_mises=float(von_mises(member.section_at(cut.position), forces)),
                    )
                )
            offset += member.length
        return stations

    def reference_case(self) -> dict[str, object]:
        """The result with the keys and conventions of the reference data's ``static.json``.

        Moments My = M2 and Mz = M3 are those at the point; N, Vy = V2, Vz = V3 and T are means over the
        adjoining 0.1 m, as in the reference program.
        """
        result: dict[str, object] = {}
        for side in ("R", "L"):
            result[f"R_A{side}_D"] = _listed(self.reactions[f"A_{side}"])
            result[f"Rmom_A{side}_D"] = [0.0, 0.0, 0.0]
        for side in ("R", "L"):
            result[f"S_{side}_tension"] = self.servomotor_tension[side]
        result["u_S_D"] = _listed(self.displacement["S"])
        result["rot_S_D"] = _listed(self.rotation["S"])
        for side in ("R", "L"):
            result[f"u_N{side}_D"] = _listed(self.displacement[f"N_{side}"])
        for side in ("R", "L"):
            result[f"u_B{side}_D"] = _listed(self.displacement[f"B_{side}"])
            result[f"rot_B{side}_D"] = _listed(self.rotation[f"B_{side}"])
        for name in ("N_R", "N_L", "B_R", "B_L", "S"):
            for side in ("before", "after"):
                result[f"sec_{side}_{name.replace('_', '')}"] = self._beside(name, side == "after")
        return result

    def _beside(self, name: str, after: bool) -> dict[str, float]:
        member, position = _position(self.model, name, after=after)
        point = self.section_forces.at(Cut(member=member, position=position, behind_point=after))
        # Between the point and 0.1 m from it the forces are linear (uniform weight), so the middle is the
        # mean.
        middle = position + (0.5 if after else -0.5) * ADJOINING
        mean = self.section_forces.at(Cut(member=member, position=middle))
        return {
            "N": float(mean[0]),
            "Vy": float(mean[1]),
            "Vz": float(mean[2]),
            "T": float(mean[3]),
            "My": float(point[4]),
            "Mz": float(point[5]),
        }


def _listed(vector: Array) -> list[float]:
    return [float(value) for value in vector]


def _position(model: FrameModel, name: str, *, after: bool = True) -> tuple[int, float]:
    """Member and distance from its first end of a named point; a corner belongs to two members."""
    frame = model.frame
    height, servomotor = frame.height, frame.servomotor_height
    places = {
        "A_R": (0, 0.0),
        "N_R": (0, servomotor),
        "B_R": (1, 0.0) if after else (0, height),
        "S": (1, frame.half_width),
        "B_L": (2, 0.0) if after else (1, 2.0 * frame.half_width),
        "N_L": (2, height - servomotor),
        "A_L": (2, height),
    }
    return places[name]


def rope_directions(crane: Crane) -> tuple[Array, Array]:
    """Unit vectors in {D} from S towards the load (down) and towards the drum, frame undeformed."""
    towards = np.array(crane.drum_position) - np.array(crane.pulley_position)
    return DOWN, towards / np.linalg.norm(towards)


def point_forces(crane: Crane, case: LoadCase) -> dict[str, Array]:
    """Forces of ``case`` at the named points, rope included, along {D}, N."""
    forces = {name: np.array(force, dtype=np.float64) for name, force in case.forces.items()}
    if case.rope_tension:
        to_load, to_drum = rope_directions(crane)
        forces["S"] = forces.get("S", np.zeros(3)) + case.rope_tension * (to_load + to_drum)
    return forces


def generalised_forces(model: FrameModel, forces: Mapping[str, Array]) -> Array:
    """Q, (n,), of forces along {D} at named points."""
    total = np.zeros(model.structure.size)
    for name, force in forces.items():
        total += (model.to_deck.T @ force) @ model.structure.translation(name)
    return total


def at_rest(scenario: Scenario, model: FrameModel) -> FrameModel:
    """The model with the geometric stiffness of its state under its own weight and the load at rest."""
    case = LoadCase(rope_tension=scenario.weight, second_order=True)
    return static(replace(scenario.crane, frame=model.frame), case, model=model).model


def solve(model: FrameModel, right: Array, lengthening: Array | None = None) -> Array:
    """q, (n,), of the frame at rest under the generalised forces ``right``, (n,); ``lengthening`` is the change of
    the lengths of S_R and S_L, (2,), m, where they are rigid."""
    basis = model.constraints.basis
    given = 0.0 if lengthening is None else model.lengthening @ lengthening
    free = BandedCholesky(model.reduced_stiffness).solve(basis.T @ right)
    return np.asarray(basis @ free + given, dtype=np.float64)


@dataclass(frozen=True)
class _State:
    """A frame at rest under generalised forces ``right``, those of second order included."""

    model: FrameModel
    position: Array
    right: Array
    lengthening: Array
    """Of S_R and S_L by what is of second order, (2,), m."""

    @property
    def tensions(self) -> Array:
        """Of S_R and S_L, (2,), N."""
        stiffness = self.model.frame.structure.servomotor.stiffness or 0.0
        linear = self.model.servomotor_tensions(self.position, np.zeros_like(self.position), self._reactions)
        return np.asarray(linear + stiffness * self.lengthening)

    @property
    def feet(self) -> Array:
        """Forces on the frame at A_R and A_L along {D}, (2, 3), N."""
        return self.model.foot_reactions(self._reactions)

    @property
    def _reactions(self) -> Array:
        return self.model.reactions(self.model.stiffness @ self.position - self.right)


def _to_second_order(state: _State, forces: Mapping[str, Array], rope: tuple[float, Array] | None) -> _State:
    """The state with what is of second order in its displacements.

    Args:
        state: The linear one.
        forces: Dead forces along {F} at named points, N.
        rope: Tension [N] and line from S to the drum along {F} [m] where the rope turns with S.
    """
    linear, right = state.model, state.right
    geometry, stiffness = Geometry(linear), linear.structure.stiffness()
    elastic = linear.frame.structure.servomotor.stiffness
    for _ in range(SECOND_ORDER_ITERATIONS):
        before = state.position
        bent = geometry.deformations(before)
        springs = linear.spring_forces(before) + bent * stiffness.reshape(-1, 6)
        feet = dict(zip(("A_R", "A_L"), state.feet @ linear.to_deck, strict=True))
        total = geometry.stiffness(springs, state.tensions, {**forces, **feet})
        if rope is not None:
            total = total + geometry.of_rope(*rope)
        model = stiffened(linear, total)
        longer = geometry.lengthening(before)
        loads = right - linear.deformation.T @ (stiffness * bent.ravel())
        try:
            if elastic is None:
                position = solve(model, loads, -longer)
            else:
                loads = loads + (elastic * longer) @ linear.servomotors
                position = solve(model, loads)
        except np.linalg.LinAlgError:
            raise InvalidValue("second_order: the frame buckles under these loads") from None
        state = _State(model, position, loads, longer)
        if np.max(np.abs(position - before)) < 1e-9 * np.max(np.abs(position)):
            return state
    raise InvalidValue(
        f"second_order: no equilibrium in {SECOND_ORDER_ITERATIONS} iterations: the frame buckles under these loads"
    )


def static(crane: Crane, case: LoadCase, *, model: FrameModel | None = None) -> StaticResult:
    """Solve a static load case, linear in the frame or to second order.

    Args:
        crane: The crane.
        case: Its loads.
        model: The frame's model, if it is not to be the default one (10 and 8 elements).

    Warns:
        SmallRotationWarning: An rfe turns by more than 0.05 rad.
    """
    frame = model or frame_model(crane.frame)
    if frame.frame != crane.frame:
        raise InvalidValue("model: must have been made of the crane's own frame")
    forces = point_forces(crane, case)
    field_strength = GRAVITY if case.own_weight else 0.0
    right = generalised_forces(frame, forces) + frame.weight(field_strength)
    state = _State(frame, solve(frame, right), right, np.zeros(2))
    if case.second_order:
        to_drum = np.array(crane.drum_position) - np.array(crane.pulley_position)
        rope = (case.rope_tension, frame.to_deck.T @ to_drum) if case.rope_follows else None
        state = _to_second_order(state, {name: frame.to_deck.T @ force for name, force in forces.items()}, rope)
    position, tensions, feet = state.position, state.tensions, state.feet
    frame.warn_of_rotation(position)
    structure, to_deck = frame.structure, frame.to_deck

    loads = dict(forces)
    for side, foot in zip(("R", "L"), feet, strict=True):
        loads[f"A_{side}"] = foot
    acting = [
        PointForce(member=at[0], position=at[1], force=to_deck.T @ force)
        for name, force in loads.items()
        for at in [_position(frame, name)]
    ]
    for row, side, tension in zip(frame.servomotors, ("R", "L"), tensions, strict=True):
        index, _ = structure.points[f"N_{side}"]
        body = structure.bodies[index]
        along = body.axes @ row[6 * index : 6 * index + 3]
        member, where = _position(frame, f"N_{side}")
        acting.append(PointForce(member=member, position=where, force=float(tension) * along))

    names = ("A_R", "A_L", *LOADED_POINTS)
    return StaticResult(
        model=state.model,
        case=case,
        position=position,
        reactions={"A_R": feet[0], "A_L": feet[1]},
        servomotor_tension={"R": float(tensions[0]), "L": float(tensions[1])},
        displacement={name: to_deck @ structure.translation(name) @ position for name in names},
        rotation={name: to_deck @ structure.rotation(name) @ position for name in names},
        section_forces=SectionForces(frame, position, acting, field_strength * (to_deck.T @ DOWN)),
    )
