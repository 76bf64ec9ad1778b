"""Exact frequencies of a uniform Timoshenko beam, from its transfer matrix."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from aframe_env.rfem.beam import Array, Member
from aframe_env.rfem.straight_beam import End

_HELD = {"pinned": (0, 2), "clamped": (0, 1), "free": (2, 3)}
"""Indices of those of deflection, slope, moment, shear force that are zero at an end."""


def _determinant(member: Member, ends: tuple[End, End], omega: float, shear: bool) -> float:
    section, material = member.section_at(0.0), member.material
    length, young = member.length, material.young_modulus
    moment, line_mass = section.second_moment_2, material.density * section.area
    # Deflection, slope, moment, shear force, made dimensionless with the length and E J.
    share = section.shear_factor_3 * young * moment / (material.shear_modulus * section.area * length**2)
    rotary = material.density * moment * omega**2 * length**2 / (young * moment)
    inertia = line_mass * omega**2 * length**4 / (young * moment)
    system = np.array(
        [
            [0.0, 1.0, 0.0, share if shear else 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, -rotary if shear else 0.0, 0.0, -1.0],
            [-inertia, 0.0, 0.0, 0.0],
        ]
    )
    transfer = expm(system)
    zero, held = _HELD[ends[0]], _HELD[ends[1]]
    open_ends = [index for index in range(4) if index not in zero]
    return float(np.linalg.det(transfer[np.ix_(held, open_ends)]))


def exact_frequencies(member: Member, ends: tuple[End, End], count: int, *, shear: bool = True) -> Array:
    """The ``count`` lowest frequencies of bending along axis 3, Hz.

    Args:
        member: A member of one section.
        ends: Supports of its ends.
        count: Number of frequencies.
        shear: Timoshenko's beam (shear and rotary inertia); False: Euler–Bernoulli's.
    """
    section, material = member.section_at(0.0), member.material
    scale = math.sqrt(
        material.young_modulus * section.second_moment_2 / (material.density * section.area * member.length**4)
    )
    found: list[float] = []
    low, value = 0.05 * scale, _determinant(member, ends, 0.05 * scale, shear)
    while len(found) < count:
        high = low + 0.2 * scale
        next_value = _determinant(member, ends, high, shear)
        if value * next_value < 0.0:
            root = brentq(lambda omega: _determinant(member, ends, omega, shear), low, high, xtol=1e-12 * scale)
            found.append(float(root) / (2.0 * math.pi))
        low, value = high, next_value
    return np.array(found)
