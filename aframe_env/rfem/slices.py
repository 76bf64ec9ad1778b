"""The frame's mass in slices: where they are, and how the coordinates q move them.

Everything inertial comes from here: the mass matrix, weight, the inertial terms of a deck that turns, and energy. A
slice has a mass and the second moments of its mass about its centre; to first order in q its points move by u + θ× y, y
from its centre.

With the paper's elements a slice is a rigid finite element, eq. (14), and the mass matrix is diagonal. With the
corrected ones the slices are sections of the beam between two rfes, which move as a Timoshenko beam at rest between
those two does; the mass matrix is the one that is consistent with the stiffness (Przemieniecki, Theory of Matrix
Structural Analysis, section 11.2; with shear: Friedman and Kosmatka, 1993), and natural frequencies are some ten times
nearer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from aframe_env.rfem.beam import Array, Spring
from aframe_env.rfem.structure import Body, Structure

GAUSS_POINTS = 4
"""In each part of an element: the mass matrix, of sixth degree in the place, is then exact."""

SKEW = np.zeros((3, 3, 3))
"""ε: (a× b)_i = ε_ijk a_j b_k."""
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    SKEW[_i, _j, _k], SKEW[_i, _k, _j] = 1.0, -1.0


@dataclass(frozen=True, kw_only=True)
class Slices:
    """s slices of mass, along {F}."""

    mass: Array
    """(s,), kg."""
    place: Array
    """Centres, undeformed, (s, 3), m."""
    second: Array
    """D = ∫ y yᵀ dm, (s, 3, 3), kg m²."""
    displacement: sp.csr_array
    """u by q, (3 s, n)."""
    rotation: sp.csr_array
    """θ by q, (3 s, n)."""

    @cached_property
    def inertia(self) -> Array:
        """∫ (y·y − y yᵀ) dm, (s, 3, 3), kg m²."""
        trace = np.trace(self.second, axis1=1, axis2=2)
        return np.asarray(trace[:, None, None] * np.eye(3) - self.second)

    def mass_matrix(self) -> sp.csr_array:
        """M_F, (n, n), kg and kg m²."""
        lumps = sp.diags_array(np.repeat(self.mass, 3))
        turns = sp.block_diag(list(self.inertia), format="csr")
        total = self.displacement.T @ lumps @ self.displacement + self.rotation.T @ turns @ self.rotation
        return sp.csr_array(total)

    def uniform(self) -> Array:
        """Generalised forces per unit of a uniform acceleration along each axis of {F}, (n, 3), kg and kg m."""
        field = (self.mass[:, None, None] * np.eye(3)).reshape(-1, 3)
        return np.asarray(self.displacement.T @ field)

    def of_field(self, turning: Array) -> Array:
        """Generalised forces of the field W ρ, undeformed, W = ``turning`` (3, 3), 1/s²: (n,), N and N m."""
        forces = self.mass[:, None] * (self.place @ turning.T)
        moments = np.einsum("iab,sac,bc->si", SKEW, self.second, turning)
        return np.asarray(self.displacement.T @ forces.ravel() + self.rotation.T @ moments.ravel())

    def of_motion(self, turning: Array, position: Array) -> Array:
        """E(W) q: generalised forces of the field W (u + θ× y) of the slices displaced by q, (n,) or (n, k)."""
        moved = self.moved(position)
        forces = np.einsum("s,ab,sbk->sak", self.mass, turning, moved[0])
        gradient = np.einsum("ab,bcd,sck->sadk", turning, SKEW, moved[1])
        moments = np.einsum("iab,sac,sbck->sik", SKEW, self.second, gradient)
        size = 3 * self.mass.size
        total = self.displacement.T @ forces.reshape(size, -1) + self.rotation.T @ moments.reshape(size, -1)
        return np.asarray(total).reshape(position.shape)

    def moved(self, position: Array) -> tuple[Array, Array]:
        """u and θ by q, (n,) or (n, k): (s, 3, k) each."""
        shape = (self.mass.size, 3, -1)
        return (self.displacement @ position).reshape(shape), (self.rotation @ position).reshape(shape)


def slices_of(structure: Structure) -> Slices:
    """Slices of a frame: of the elements between its rfes where their shear is corrected, else the rfes."""
    if structure.corrected:
        found = [item for spring, pair in structure.elements for item in _of_element(structure, spring, pair)]
    else:
        found = [_of_body(structure, index) for index in range(len(structure.bodies))]
    masses, places, seconds, displacements, rotations = zip(*found, strict=True)
    return Slices(
        mass=np.array(masses),
        place=np.array(places),
        second=np.array(seconds),
        displacement=_stacked(displacements, structure.size),
        rotation=_stacked(rotations, structure.size),
    )


_Rows = tuple[tuple[int, Array], ...]
"""First column and (3, 6) of each of the bodies that move a slice."""
_Slice = tuple[float, Array, Array, _Rows, _Rows]


def _stacked(rows: tuple[_Rows, ...], size: int) -> sp.csr_array:
    blocks = [(3 * index, first, block) for index, parts in enumerate(rows) for first, block in parts]
    starts, columns = np.array([[row, column] for row, column, _ in blocks]).T
    values = np.array([block for *_, block in blocks])
    i = starts[:, None, None] + np.arange(3)[:, None]
    j = columns[:, None, None] + np.arange(6)
    places = (np.broadcast_to(i, values.shape).ravel(), np.broadcast_to(j, values.shape).ravel())
    matrix = sp.csr_array((values.ravel(), places), shape=(3 * len(rows), size))
    matrix.eliminate_zeros()
    return matrix


def _of_body(structure: Structure, index: int) -> _Slice:
    body = structure.bodies[index]
    second = body.axes @ np.diag(0.5 * np.sum(body.inertia) - body.inertia) @ body.axes.T
    displacement, rotation = ((6 * index, body.displacement(body.centre)),), ((6 * index, body.rotation()),)
    return body.mass, body.centre, second, displacement, rotation


def _of_element(structure: Structure, spring: Spring, pair: tuple[int, int]) -> Iterator[_Slice]:
    member, low = spring.member, spring.position - 0.5 * spring.size
    axes, start = member.axes, member.start + low * member.axes[:, 0]
    ends = [
        _end(structure.bodies[body], start + along * axes[:, 0], axes)
        for along, body in zip((0.0, spring.size), pair, strict=True)
    ]
    points, weights = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    for left, right, section in member.pieces(low, low + spring.size):
        for point, weight in zip(points, weights, strict=True):
            place = 0.5 * (left + right) + 0.5 * (right - left) * float(point)
            length = 0.5 * weight * (right - left) * member.material.density
            moments = length * np.array([section.rotary_moment, section.second_moment_2, section.second_moment_3])
            second = axes @ np.diag(0.5 * np.sum(moments) - moments) @ axes.T
            shapes = shape_functions(spring, (place - low) / spring.size)
            rows = [
                axes @ shapes[:, 6 * number : 6 * number + 6].reshape(2, 3, 6) @ end for number, end in enumerate(ends)
            ]
            displacement, rotation = (
                tuple((6 * body, row[kind]) for body, row in zip(pair, rows, strict=True)) for kind in (0, 1)
            )
            yield length * section.area, member.start + place * axes[:, 0], second, displacement, rotation


def _end(body: Body, place: Array, axes: Array) -> Array:
    """(6, 6): displacement and rotation along the member's axes of a body's point, by its coordinates."""
    return np.vstack([axes.T @ body.displacement(place), axes.T @ body.rotation()])


def shape_functions(spring: Spring, share: float) -> Array:
    """Displacement and rotation at ``share`` of an element by those of its ends, at rest and unloaded: (6, 12).

    All along the member's axes. The parts of bending and shear in the element's compliance are its sde's.
    """
    x, size = share, spring.size
    result = np.zeros((6, 12))
    result[[0, 3], [0, 3]], result[[0, 3], [6, 9]] = 1.0 - x, x
    for across, about, sign in ((1, 5, 1.0), (2, 4, -1.0)):
        # Shear's compliance over bending's, both of the transverse displacement.
        shear = max(12.0 * spring.stiffness[about] / (spring.stiffness[across] * size**2) - 1.0, 0.0)
        place = np.array(
            [
                1.0 - 3.0 * x**2 + 2.0 * x**3 + shear * (1.0 - x),
                size * (x - 2.0 * x**2 + x**3 + 0.5 * shear * (x - x**2)),
                3.0 * x**2 - 2.0 * x**3 + shear * x,
                size * (x**3 - x**2 - 0.5 * shear * (x - x**2)),
            ]
        )
        turn = np.array(
            [
                6.0 * (x**2 - x) / size,
                1.0 - 4.0 * x + 3.0 * x**2 + shear * (1.0 - x),
                6.0 * (x - x**2) / size,
                3.0 * x**2 - 2.0 * x + shear * x,
            ]
        )
        signs, columns = np.array([1.0, sign, 1.0, sign]), [across, about, across + 6, about + 6]
        result[across, columns] = signs * place / (1.0 + shear)
        result[about, columns] = sign * signs * turn / (1.0 + shear)
    return result
