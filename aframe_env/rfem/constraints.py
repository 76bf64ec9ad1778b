"""Feet, servomotors and joints: constraints C q = b, their reactions, and the coordinates that are left,
eqs. (23)–(30).

Constraints are eliminated, not integrated: q = Z z + P b with C Z = 0 and C P = 1, so that the feet and the
lengths of rigid servomotors cannot drift, whatever the integrator and the duration. Z is local (one small
block for each group of rfes that constraints touch); P = M⁻¹Cᵀ(CM⁻¹Cᵀ)⁻¹ is M-orthogonal to Z, so that the
reactions follow from positions and velocities alone: R = Pᵀ(K q + L q̇ − f) + (CM⁻¹Cᵀ)⁻¹ b̈.

The length of a servomotor is the one of the linear frame, |NC| + e·u_N with the unit vector e of C–N undeformed: like
K_F and the rotations of (10) it leaves out what is of second order in the displacements. The displaced points are some
|u_N|²/(2 |NC|) further apart, a sideways displacement above all. To hold that distance instead would not make the frame
more exact: the legs' chords A–N lengthen in the same way, and forces keep their undeformed directions. What that comes
to, all of it together, is in :mod:`aframe_env.rfem.second_order`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from aframe_env.rfem.beam import Array
from aframe_env.rfem.structure import Structure
from aframe_env.scenario.crane import Frame


@dataclass(frozen=True, kw_only=True)
class Constraints:
    """Constraints C q = b, and the matrices that eliminate them."""

    names: tuple[str, ...]
    """Names of the reactions, in the order of C's rows: S_R, S_L (tension, N; rigid servomotors only), the feet's
    R_AR and R_AL (force on the frame along {F}, N), joints' forces and moments."""
    matrix: Array
    """C, (r, n)."""
    basis: Array
    """Z, (n, n − r)."""
    particular: Array
    """P, (n, r)."""
    weight: Array
    """(C M⁻¹ Cᵀ)⁻¹, (r, r), kg."""


def luffing_rotation(angle: float) -> Array:
    """{F} → {D}: rotation about y by the luffing angle, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def servomotor_direction(frame: Frame, side: str, angle: float | None = None) -> Array:
    """Unit vector in {F} from C on the deck to N on the leg of ``side`` "R" or "L", frame undeformed;
    (3,)."""
    luffing = frame.luffing_angle if angle is None else angle
    y = -frame.half_width if side == "R" else frame.half_width
    on_deck = luffing_rotation(luffing).T @ np.array([frame.servomotor_deck_x, y, 0.0])
    link = np.array([0.0, y, frame.servomotor_height]) - on_deck
    return np.asarray(link / np.linalg.norm(link))


def servomotor_length(frame: Frame) -> float:
    """|CN|, frame undeformed, m."""
    along = frame.servomotor_height * np.sin(frame.luffing_angle) - frame.servomotor_deck_x
    return float(np.hypot(along, frame.servomotor_height * np.cos(frame.luffing_angle)))


def servomotor_rows(frame: Frame, structure: Structure) -> Array:
    """(2, n): shortening of S_R and S_L by q; the transpose times a tension is the force on the frame."""
    return np.vstack([-servomotor_direction(frame, side) @ structure.translation(f"N_{side}") for side in ("R", "L")])


def servomotor_across(frame: Frame, structure: Structure) -> Array:
    """(2, n): displacement of N_R and N_L across the servomotors, in the plane of leg and servomotor, up the leg."""
    x, _, z = servomotor_direction(frame, "R")
    return np.vstack([np.array([-z, 0.0, x]) @ structure.translation(f"N_{side}") for side in ("R", "L")])


def _joint_rows(structure: Structure) -> list[Array]:
    rows = []
    for before, behind, place in structure.joints:
        block = np.zeros((6, structure.size))
        for index, sign in ((before, 1.0), (behind, -1.0)):
            body = structure.bodies[index]
            block[:, 6 * index : 6 * index + 6] = sign * np.vstack([body.displacement(place), body.rotation()])
        rows.append(block)
    return rows


def constrain(frame: Frame, structure: Structure, mass: scipy.sparse.csr_array) -> Constraints:
    """Constraints of feet (3 each), joints (6 each) and, where they are rigid, servomotors (1 each).

    ``mass``: M_F, (n, n).
    """
    rows, names = [], []
    if frame.structure.servomotor.stiffness is None:
        rows.append(servomotor_rows(frame, structure))
        names += ["S_R", "S_L"]
    for side in ("R", "L"):
        rows.append(structure.translation(f"A_{side}"))
        names += [f"R_A{side}{axis}" for axis in (1, 2, 3)]
    for number, block in enumerate(_joint_rows(structure)):
        rows.append(block)
        names += [f"J_B{'RL'[number]}{axis}" for axis in range(1, 7)]
    matrix = np.vstack(rows)
    freed = scipy.sparse.linalg.splu(mass.tocsc()).solve(np.ascontiguousarray(matrix.T))
    weight = np.linalg.inv(matrix @ freed)
    return Constraints(
        names=tuple(names),
        matrix=matrix,
        basis=local_basis(matrix, mass.diagonal()),
        particular=freed @ weight,
        weight=np.asarray(weight, dtype=np.float64),
    )


def local_basis(matrix: Array, mass: Array, coordinates: int = 6) -> Array:
    """Local null-space basis: bodies that share a constraint form a group, solved by itself.

    Args:
        matrix: C, (r, n).
        mass: Diagonal of M, (n,).
        coordinates: Of each body; n is a multiple of it.

    Returns:
        Z, (n, n − r), with C Z = 0, orthonormal as to that diagonal.
    """
    root = np.sqrt(mass)
    bodies = mass.size // coordinates
    touches = np.abs(matrix).reshape(matrix.shape[0], bodies, coordinates).sum(axis=2) > 0.0
    group = list(range(bodies))
    for row in touches:
        members = np.flatnonzero(row)
        merged = {group[index] for index in members}
        group = [min(merged) if label in merged else label for label in group]
    columns = []
    for label in sorted(set(group)):
        inside = np.repeat(np.array(group) == label, coordinates)
        own = matrix[np.abs(matrix[:, inside]).sum(axis=1) > 0.0][:, inside]
        local = scipy.linalg.null_space(own / root[inside]) if own.size else np.eye(int(inside.sum()))
        block = np.zeros((mass.size, local.shape[1]))
        block[inside] = local / root[inside, None]
        columns.append(block)
    return np.hstack(columns)
