"""Constants of a frame in the form that the kernels read: for one length of the inner step, and for the readout.

Newmark's scheme with γ = 1/2, and β for each mode by itself: with x = ωh up to EXACT_PHASE, β = 1/(4 sin²(x/2)) - 1/x²
gives the mode its own frequency exactly; above it β = 1/4, average acceleration, whatever the step. The load takes
β = 1/12 (Fox and Goodwin), fourth order in its phase. For constant β ≤ 1/4 + 1/x² on every coordinate the scheme
keeps a quadratic invariant of the coupled undamped system, positive while (ω_rope h)² is well below 6.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from aframe_env.dynamics.flexible import layout as at
from aframe_env.rfem.beam import Array
from aframe_env.rfem.model import FrameModel
from aframe_env.rfem.reduction import ModalFrame, modal_frame
from aframe_env.rfem.structure import Division
from aframe_env.scenario.crane import Frame

EXACT_PHASE = 1.0
"""Largest ωh for which a mode's frequency is made exact."""
DIAGONAL = 1e-9
"""Share of the damping's diagonal up to which what lies off it is rounding."""


def newmark_beta(square: Array, step: float) -> Array:
    """β of each mode, (m,), of ω² [1/s²] (m,) and h [s]."""
    phase = np.sqrt(np.maximum(square, 0.0)) * step
    x = np.clip(phase, 0.05, EXACT_PHASE)
    exact = 0.25 / np.sin(0.5 * x) ** 2 - 1.0 / x**2
    # Below 0.05 the difference of two large numbers: its series instead.
    exact = np.where(phase < 0.05, 1.0 / 12.0 + phase**2 / 240.0, exact)
    return np.where(phase <= EXACT_PHASE, exact, 0.25)


def couples(modal: ModalFrame) -> bool:
    """Return whether the damping couples the modes (normal and tangential not in the ratio of E to G)."""
    diagonal = np.diag(modal.damping)
    return bool(np.max(np.abs(modal.damping - np.diag(diagonal))) > DIAGONAL * np.max(diagonal, initial=1e-300))


@lru_cache(maxsize=16)
def step_table(frame: Frame, division: Division, modes: int | None, step: float) -> Array:
    """Constants of a frame's step of length ``step`` [s], (size,); see ``layout``."""
    modal = modal_frame(frame, division, modes)
    count, carried, coupled = modal.count, modal.carried_count, couples(modal)
    pulley = modal.pulley @ modal.shape
    beta = newmark_beta(modal.square, step)
    late = beta * step**2
    damping = modal.damping if coupled else np.diag(np.diag(modal.damping))
    inverse = np.linalg.inv(np.eye(count) + 0.5 * step * damping + np.diag(late * modal.square))
    response = inverse @ pulley.T

    head = np.zeros(at.HEAD)
    head[at.COUNT], head[at.CARRIED_COUNT], head[at.COUPLED], head[at.STEP] = count, carried, coupled, step
    head[at.COMPLIANCE : at.COMPLIANCE + 9] = ((pulley * late) @ response).ravel()
    head[at.COMPLIANCE_RATE : at.COMPLIANCE_RATE + 9] = (0.5 * step * pulley @ response).ravel()
    head[at.REST : at.REST + 9] = ((pulley / modal.square) @ pulley.T).ravel()

    of_modes = np.zeros((count, at.MODE_SIZE))
    of_modes[:, at.SQUARE] = modal.square
    of_modes[:, at.DAMPING] = np.diag(modal.damping)
    of_modes[:, at.LATE] = late
    of_modes[:, at.EARLY] = (0.5 - beta) * step**2
    of_modes[:, at.INVERSE] = np.diag(inverse)
    of_modes[:, at.SHAPE : at.SHAPE + 3] = pulley.T
    of_modes[:, at.RESPONSE : at.RESPONSE + 3] = response
    of_modes[:, at.FIELD : at.FIELD + 3] = modal.project(modal.uniform)
    of_modes[:, at.FIELD + 3 : at.FIELD + 12] = -modal.project(modal.turning).reshape(count, 9)
    matrix = -modal.project(modal.carried)[:carried]
    parts = [head, of_modes.ravel(), matrix.ravel()]
    if coupled:
        parts.append(np.asarray(inverse.ravel(), dtype=np.float64))
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
        reach,
        turned,
    ]
    return np.concatenate([np.array(head, dtype=np.float64), *(part.ravel() for part in parts)])
