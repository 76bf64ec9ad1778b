"""Constants of a frame in the form that the kernels read: for one length of the inner step, and for the readout."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from aframe_env.dynamics.flexible import layout as at
from aframe_env.rfem.beam import Array
from aframe_env.rfem.exact_step import exact_step
from aframe_env.rfem.model import FrameModel
from aframe_env.rfem.reduction import ModalFrame, modal_frame
from aframe_env.rfem.structure import Division
from aframe_env.scenario.crane import Frame


@lru_cache(maxsize=16)
def step_table(frame: Frame, division: Division, modes: int | None, step: float) -> Array:
    """Constants of a frame's step of length ``step`` [s], (size,); see ``layout``."""
    modal = modal_frame(frame, division, modes)
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


@lru_cache(maxsize=8)
def readout_table(frame: Frame, division: Division, modes: int | None) -> Array:
    """Line of the readout's table for a frame, (size,)."""
    modal = modal_frame(frame, division, modes)
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
    head = [modal.count, modal.carried_count, *points.shape[:2], bool(damping.any()), turned.shape[1]]
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
    return np.concatenate([np.array(head, dtype=np.float64), *(part.ravel() for part in parts)])
