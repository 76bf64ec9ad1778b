"""A single straight member in bending: the rfe and sde division by itself, for checks against closed
forms."""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np
import scipy

from aframe_env.rfem.beam import Array, Member, divide
from aframe_env.rfem.constraints import local_basis
from aframe_env.rfem.slices import slices_of
from aframe_env.rfem.structure import Structure, body_of
from aframe_env.validation import require_choice

End: TypeAlias = Literal["pinned", "clamped", "free"]


def bending_frequencies(member: Member, elements: int, ends: tuple[End, End], *, corrected_shear: bool = True) -> Array:
    """Natural frequencies of bending along the section's axis 3, lowest first, Hz.

    Args:
        member: The member.
        elements: Number n of primary elements.
        ends: Supports of its first and last end; a beam held too little has frequencies near 0.
        corrected_shear: See :func:`aframe_env.rfem.beam.divide`.
    """
    segments, springs = divide(member, elements, corrected_shear=corrected_shear)
    bodies = tuple(body_of((segment,)) for segment in segments)
    structure = Structure(
        bodies=bodies,
        springs=tuple(springs),
        spring_bodies=tuple((index, index + 1) for index in range(len(springs))),
        joints=(),
        corrected=corrected_shear,
        points={"first": (0, member.start), "last": (len(bodies) - 1, member.end)},
    )
    deformation = structure.deformation().toarray()
    stiffness = deformation.T @ (structure.stiffness()[:, None] * deformation)
    # In the plane of axes 1 and 3: displacement along 3, rotation about 2.
    plane = np.sort(np.concatenate([np.arange(2, structure.size, 6), np.arange(4, structure.size, 6)]))
    rows = [np.zeros((0, structure.size))]
    for name, end in zip(("first", "last"), ends, strict=True):
        require_choice("ends", end, ("pinned", "clamped", "free"))
        if end != "free":
            rows.append((member.axes.T @ structure.translation(name))[2:])
        if end == "clamped":
            rows.append((member.axes.T @ structure.rotation(name))[1:2])
    held = np.vstack(rows)[:, plane]
    mass = slices_of(structure).mass_matrix().toarray()[np.ix_(plane, plane)]
    basis = local_basis(held, np.diag(mass), coordinates=2)
    reduced = (basis.T @ matrix @ basis for matrix in (stiffness[np.ix_(plane, plane)], mass))
    squares = scipy.linalg.eigh(*reduced, eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi)
