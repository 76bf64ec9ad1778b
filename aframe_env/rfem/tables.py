"""Constants of a frame in the form that the kernels read: for one length of the inner step, and for the readout."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from aframe_env.dynamics.flexible import layout as at
from aframe_env.dynamics.flexible.readout import SWING
from aframe_env.rfem.beam import Array
from aframe_env.rfem.exact_step import ExactStep, exact_step
from aframe_env.rfem.luffed import model_at
from aframe_env.rfem.model import FrameModel, frame_model
from aframe_env.rfem.reduction import (
    CARRIED_MODES,
    STATIC_SHAPES,
    SWING_SHAPES,
    ModalFrame,
    modal_form,
    modal_frame,
    natural_modes,
)
from aframe_env.rfem.structure import Division
from aframe_env.scenario.crane import Frame


@lru_cache(maxsize=64)
def step_table(frame: Frame, division: Division, modes: int | None, step: float, luffs: bool = False) -> Array:
    """Constants of a frame's step of length ``step`` [s], (size,); see ``layout``."""
    modal = luffed_modes(frame, division, modes) if luffs else modal_frame(frame, division, modes)
    count, carried = modal.count, modal.carried_count
    exact, pulley = exact_step(modal, step), modal.pulley @ modal.shape
    # Place and rate of the modes by the rope's force at S at the end: elastic part, its rate, the rest.
    response = np.array(
        [
            [
                exact.times(factor, pulley.T)
                for factor in (exact.cubic[row, 2], exact.cubic[row, 3], exact.linear[row, 1])
            ]
            for row in range(2)
        ]
    )
    give = pulley @ response

    head = np.zeros(at.HEAD)
    head[at.COUNT], head[at.CARRIED_COUNT], head[at.COUPLED], head[at.STEP] = count, carried, modal.couples, step
    head[at.GIVE : at.GIVE + 27], head[at.GIVE_RATE : at.GIVE_RATE + 27] = give.reshape(2, 27)
    head[at.REST : at.REST + 9] = ((pulley / modal.square) @ pulley.T).ravel()

    of_modes = np.zeros((count, at.MODE_SIZE))
    of_modes[:, at.SQUARE] = modal.square
    of_modes[:, at.DAMPING] = np.diag(modal.damping)
    of_modes[:, at.SHAPE : at.SHAPE + 3] = pulley.T
    of_modes[:, at.RESPONSE : at.RESPONSE + 18] = response.transpose(2, 0, 1, 3).reshape(count, 18)
    of_modes[:, at.FIELD : at.FIELD + 3] = modal.project(modal.uniform)
    of_modes[:, at.FIELD + 3 : at.FIELD + 12] = -modal.project(modal.turning).reshape(count, 9)
    matrix = -modal.project(modal.carried)[:carried]
    parts = [head, of_modes.ravel(), matrix.ravel()]
    factors = np.concatenate([exact.free, exact.linear, exact.cubic[:, :2]], axis=1)
    if modal.couples:
        parts.append(factors.ravel())
    else:
        for slot, kinds in ((at.FREE, slice(0, 2)), (at.LINEAR, slice(2, 4)), (at.CUBIC, slice(4, 6))):
            of_modes[:, slot : slot + 4] = factors[:, kinds].reshape(4, count).T
        parts[1] = of_modes.ravel()
    if luffs:
        head[at.SWING] = sum(part.size for part in parts)
        parts.append(_swing(modal, exact, response[0, 2], int(head[at.SWING])))
    return np.concatenate(parts)


def _forces(model: FrameModel, residual: Array, position: Array, velocity: Array) -> Array:
    """Feet and servomotors, (k, 8), of K q + L q̇ - f, q and q̇, each (k, n)."""
    reactions = model.reactions(residual)
    feet = model.foot_reactions(reactions).reshape(-1, 6)
    return np.hstack([feet, model.servomotor_tensions(position, velocity, reactions)])


def _acting(model: FrameModel, forces: Array) -> Array:
    """Columns of readout.FORCES for generalised forces (n, k) on the frame, (k, readout.FORCES)."""
    none = np.zeros(forces.T.shape)
    return np.hstack([np.zeros((forces.shape[1], 3)), _forces(model, -forces.T, none, none)])


def _points(modal: ModalFrame) -> Array:
    """Share of the yield strength by unit N, M2, M3 (normal) and V2, V3, T (shear), (n_sde, points, 6)."""
    springs = modal.model.structure.springs
    sections = [spring.member.section_at(spring.position) for spring in springs]
    result = np.zeros((len(springs), max(len(section.stress_points) for section in sections) or 1, 6))
    for index, (spring, section) in enumerate(zip(springs, sections, strict=True)):
        if not section.stress_points:
            result[index] = np.nan
        for number, point in enumerate(section.stress_points):
            result[index, number] = (
                1.0 / section.area,
                point.offset_3 / section.second_moment_2,
                point.offset_2 / section.second_moment_3,
                point.shear_2,
                point.shear_3,
                point.torsion,
            )
        result[index] /= spring.member.material.yield_strength
    return result


@lru_cache(maxsize=64)
def readout_table(frame: Frame, division: Division, modes: int | None, swing_step: float | None = None) -> Array:
    """Line of the readout's table for a frame, (size,); ``swing_step``: inner step of one that luffs, s."""
    luffs = swing_step is not None
    modal = luffed_modes(frame, division, modes) if luffs else modal_frame(frame, division, modes)
    model, shape = modal.model, modal.shape
    none = np.zeros(shape.T.shape)
    size = shape.shape[0]
    by_position = np.hstack([(modal.pulley @ shape).T, _forces(model, shape.T @ model.stiffness, shape.T, none)])
    by_rate = np.hstack([np.zeros((modal.count, 3)), _forces(model, shape.T @ model.damping, none, shape.T)])
    strain = (model.deformation @ shape).T
    points = _points(modal)
    damping = model.structure.damping()
    turned = shape.T.reshape(modal.count, -1, 6)[:, :, 3:]
    reach = np.linalg.norm(turned, axis=2).max(axis=1)
    head = [modal.count, modal.carried_count, *points.shape[:2], bool(damping.any()), turned.shape[1], 0]
    parts = [
        by_position,
        by_rate,
        _acting(model, np.hstack([modal.uniform, -modal.turning.reshape(size, 9)])),
        _acting(model, -modal.carried.reshape(size, -1)),
        _acting(model, modal.pulley.T),
        strain * model.structure.stiffness(),
        strain * damping,
        points,
        (model.fixed_end_forces @ model.to_deck.T).transpose(2, 0, 1),
        reach,
        turned,
    ]
    if swing_step is not None:
        head[SWING] = len(head) + sum(part.size for part in parts)
        servomotors = _Servomotors.of(modal, swing_step)
        moved = np.hstack([servomotors.by_force, servomotors.by_stroke])
        by_turned = np.hstack(
            [(modal.pulley @ moved).T, _forces(model, moved.T @ model.stiffness, moved.T, 0.0 * moved.T)]
        )
        by_turned[:2] += _acting(model, model.across_servomotors.T)
        parts += [by_turned, (model.deformation @ moved).T * model.structure.stiffness()]
    return np.concatenate([np.array(head, dtype=np.float64), *(part.ravel() for part in parts)])


# Of a frame that luffs.

TURNED_PHASE = 2.5
"""Most that a mode may turn in a step for the servomotors' turning to reach it, rad: a force that follows its place
along straight lines would drive one that turns by π."""


@lru_cache(maxsize=1)
def _upright(frame: Frame, division: Division) -> FrameModel:
    """Model of a frame whose luffing angle is nought."""
    return frame_model(frame, division)


@lru_cache(maxsize=8)
def luffed_modes(frame: Frame, division: Division, modes: int | None) -> ModalFrame:
    """Modal form of a frame that luffs, at its luffing angle; arguments as for ``modal_frame``."""
    model = model_at(_upright(replace(frame, luffing_angle=0.0), division), frame.luffing_angle)
    return modal_form(model, natural_modes(model, modes), CARRIED_MODES, luffs=True)


@dataclass(frozen=True)
class _Servomotors:
    """How servomotors that turn reach the modes, and what of them the modes do not tell; S_R and S_L in columns."""

    reactions: Array
    """Of them by the modes, and forces on the modes by strokes, b, (m, 2), N/m."""
    across: Array
    """Displacements across them by the modes, and forces on the modes by forces there, (m, 2)."""
    by_stroke: Array
    """q by a stroke of 1 m, less the modes, (n, 2)."""
    by_force: Array
    """q by a force of 1 N across them, less the modes, (n, 2)."""
    at_once: Array
    """Places of the modes by forces across and strokes, of those that such do not reach otherwise, (m, 4)."""
    feed: Array
    """Reactions and displacements across by such forces and strokes, the modes held, (4, 4)."""

    @classmethod
    def of(cls, modal: ModalFrame, step: float) -> _Servomotors:
        """Those of a frame with inner steps of ``step`` s."""
        reached = (np.sqrt(modal.square) * step < TURNED_PHASE) | (np.arange(modal.count) >= modal.natural)
        model, square = modal.model, modal.square[:, None]
        part = reached[:, None] * (modal.shape.T @ (model.mass @ model.lengthening))
        across = (model.across_servomotors @ modal.shape).T
        by_stroke = model.lengthening - modal.shape @ part
        other = ~reached[:, None]
        at_once = other * np.hstack([across / square, modal.shape.T @ (model.mass @ model.lengthening)])
        by_force = modal.shape @ at_once[:, :2]
        crossed = model.across_servomotors @ by_stroke
        feed = np.block([[crossed.T, -part.T @ (part * square)], [model.across_servomotors @ by_force, crossed]])
        return cls(part * square, reached[:, None] * across, by_stroke, by_force, at_once, feed)


def _swing(modal: ModalFrame, exact: ExactStep, by_pull: Array, first: int) -> Array:
    """Numbers of a frame that luffs, from ``first`` on in its line, its neighbours still unknown: see ``layout``.

    ``by_pull``: place of the modes by the rope's force at the step's end, (m, 3).
    """
    frame, angle, servomotors = modal.model.frame, modal.model.frame.luffing_angle, _Servomotors.of(modal, exact.step)
    pushed = np.hstack([servomotors.across, servomotors.reactions])
    place, rate = (exact.times(exact.linear[row, 1], pushed) for row in range(2))
    sensed = np.hstack([servomotors.reactions, servomotors.across])
    of_modes = np.hstack([sensed, place, rate, servomotors.at_once])
    fields = np.hstack([modal.uniform, -modal.turning.reshape(len(modal.shape), 9), modal.pulley.T])
    passages = first + at.SERVOMOTORS + of_modes.size
    room = (modal.count + 4) * (modal.natural + STATIC_SHAPES + SWING_SHAPES)
    parts = [
        # Without neighbours it is never half way to them.
        np.array([-1.0, -1.0, 2.0, 2.0, passages, passages + room]),
        frame.height * np.array([np.sin(angle), 0.0, np.cos(angle)]),
        np.hstack([servomotors.by_stroke, servomotors.by_force]).T @ fields,
        servomotors.feed,
        sensed.T @ by_pull,
        servomotors.feed + sensed.T @ place,
        of_modes,
        np.zeros(2 * room),
    ]
    return np.concatenate([part.ravel() for part in parts])


@lru_cache(maxsize=64)
def passage(frame: Frame, angle: float, division: Division, modes: int | None, step: float) -> Array:
    """What takes modal coordinates and TURNED of a frame to modal coordinates at another luffing ``angle``, rad.

    (m there, m here + 4).
    """
    here, there = (luffed_modes(each, division, modes) for each in (frame, replace(frame, luffing_angle=angle)))
    servomotors = _Servomotors.of(here, step)
    moved = np.hstack([here.shape, servomotors.by_force, servomotors.by_stroke])
    return np.asarray(there.shape.T @ (here.model.mass @ moved))
