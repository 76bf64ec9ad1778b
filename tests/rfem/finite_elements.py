"""The reference frame as Timoshenko beam elements with a consistent mass: a program that shares no element with ours.

Twelve coordinates an element (displacement and rotation of both ends along {F}), the shape functions those of a beam at
rest (Friedman and Kosmatka, 1993), feet on pins, servomotors rigid; undamped, in all its modes.
"""

import itertools

import numpy as np
from scipy.linalg import eigh, null_space

from aframe_env.rfem.structure import members_of


def bending(young, moment, flexibility, mass, rotary, length):
    """Stiffness and mass of one plane: displacement and slope of both ends, (4, 4) each."""
    shear = 12.0 * young * moment * flexibility / length**2
    a, b, c = 6.0 * length, (4.0 + shear) * length**2, (2.0 - shear) * length**2
    stiffness = np.array([[12.0, a, -12.0, a], [a, b, -a, c], [-12.0, -a, 12.0, -a], [a, c, -a, b]])
    total = np.zeros((4, 4))
    for point, weight in zip(*np.polynomial.legendre.leggauss(6), strict=True):
        x = 0.5 * (point + 1.0)
        place = [
            1 - 3 * x**2 + 2 * x**3 + shear * (1 - x),
            length * (x - 2 * x**2 + x**3 + 0.5 * shear * (x - x**2)),
            3 * x**2 - 2 * x**3 + shear * x,
            length * (x**3 - x**2 - 0.5 * shear * (x - x**2)),
        ]
        turn = [
            6 * (x**2 - x) / length,
            1 - 4 * x + 3 * x**2 + shear * (1 - x),
            6 * (x - x**2) / length,
            3 * x**2 - 2 * x + shear * x,
        ]
        total += 0.5 * weight * length * (mass * np.outer(place, place) + rotary * np.outer(turn, turn))
    return young * moment / (length**3 * (1.0 + shear)) * stiffness, total / (1.0 + shear) ** 2


def element(section, material, length):
    """Stiffness and mass along the member's axes, (12, 12) each."""
    stiffness, mass = np.zeros((2, 12, 12))
    young, shear, density = material.young_modulus, material.shear_modulus, material.density
    for slot, rigidity, inertia in (
        (0, young * section.area, density * section.area),
        (3, shear * section.torsion_constant, density * section.rotary_moment),
    ):
        both = np.ix_([slot, slot + 6], [slot, slot + 6])
        stiffness[both] = rigidity / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
        mass[both] = inertia * length / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    for across, about, moment, factor, sign in (
        (1, 5, section.second_moment_3, section.shear_factor_2, 1.0),
        (2, 4, section.second_moment_2, section.shear_factor_3, -1.0),
    ):
        flexibility = factor / (shear * section.area)
        own = bending(young, moment, flexibility, density * section.area, density * moment, length)
        signs = np.outer([1, sign, 1, sign], [1, sign, 1, sign])
        both = np.ix_(*[[across, about, across + 6, about + 6]] * 2)
        stiffness[both], mass[both] = own[0] * signs, own[1] * signs
    return stiffness, mass


class Frame:
    """Modes of the frame, and what a force at S that vanishes does to it."""

    def __init__(self, frame, towards, leg, beam):
        """``towards``: unit vectors in {F} from C to N of both sides."""
        members = members_of(frame)
        places, parts = [], []
        for member, count in zip(members, (leg, beam, leg), strict=True):
            ends = [member.start + (member.end - member.start) * k / count for k in range(count + 1)]
            parts += [(self._node(places, a), self._node(places, b), member) for a, b in itertools.pairwise(ends)]
        size = 6 * len(places)
        self.stiffness, self.mass = np.zeros((2, size, size))
        for first, last, member in parts:
            length = np.linalg.norm(places[last] - places[first])
            turn = np.kron(np.eye(4), member.axes.T)
            rows = np.r_[6 * first : 6 * first + 6, 6 * last : 6 * last + 6]
            own = element(member.section_at(0.5 * member.length), member.material, length)
            for total, matrix in zip((self.stiffness, self.mass), own, strict=True):
                total[np.ix_(rows, rows)] += turn.T @ matrix @ turn

        def rows_of(y, z):
            return np.eye(size)[6 * self._node(places, np.array([0.0, y, z])) :][:3]

        width, height = frame.half_width, frame.servomotor_height
        held = [rows_of(-width, 0.0), rows_of(width, 0.0)]
        held += [towards @ rows_of(side * width, height) for side in (-1.0, 1.0)]
        basis = null_space(np.vstack(held))
        self.square, vectors = eigh(basis.T @ self.stiffness @ basis, basis.T @ self.mass @ basis)
        self.shape = basis @ vectors
        self.pulley = rows_of(0.0, frame.height)

    @staticmethod
    def _node(places, place):
        for index, known in enumerate(places):
            if np.linalg.norm(known - place) < 1e-9:
                return index
        places.append(place)
        return len(places) - 1

    @property
    def frequency(self):
        """Hz."""
        return np.sqrt(self.square) / (2.0 * np.pi)

    def released(self, force, times):
        """Displacement of S along {F} at ``times`` once a force there, along {F}, is gone: (k, 3)."""
        by_mode = self.pulley @ self.shape
        swings = np.cos(np.outer(times, np.sqrt(self.square)))
        return (swings * (by_mode.T @ force / self.square)) @ by_mode.T
