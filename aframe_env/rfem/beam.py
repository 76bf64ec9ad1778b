"""One straight member as rigid finite elements (rfe) and spring-damping elements (sde), eqs. (2)–(7).

Primary division: the member of length l is cut into n equal elements of length Δ = l/n, and the compliance
of each is gathered in one sde at its middle. Secondary division: what lies between two neighbouring sdes is
one rfe, so there are n + 1 rfes, and those at the ends are half as long.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from aframe_env.scenario.cross_sections import GivenSection, Material, MemberSection
from aframe_env.validation import require_integer

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Member:
    """A straight member in the frame axes {F}."""

    name: str
    start: Array
    """First end, (3,), m."""
    end: Array
    """Other end, (3,), m."""
    out_of_plane: Array
    """Unit vector of the section's axis 3, (3,), at right angles to the member."""
    section: MemberSection
    material: Material

    @property
    def length(self) -> float:
        """Distance from start to end, m."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def axes(self) -> Array:
        """Columns: the member's axes 1 (start to end), 2, 3 in {F}; (3, 3)."""
        first = (self.end - self.start) / self.length
        return np.column_stack([first, np.cross(self.out_of_plane, first), self.out_of_plane])

    def pieces(self, low: float, high: float) -> list[tuple[float, float, GivenSection]]:
        """Split [low, high] (m from the start) where the section changes: (low, high, section) of each
        part."""
        sections = self.section if isinstance(self.section, tuple) else (self.section,)
        bounds = np.linspace(0.0, self.length, len(sections) + 1)
        parts = []
        for section, left, right in zip(sections, bounds[:-1], bounds[1:], strict=True):
            a, b = max(low, float(left)), min(high, float(right))
            if b - a > 1e-12 * self.length:
                parts.append((a, b, section.given()))
        return parts

    def section_at(self, position: float) -> GivenSection:
        """Section at ``position`` m from the start (at a change of section: the one before it)."""
        tiny = 1e-9 * self.length
        low = min(max(position - tiny, 0.0), self.length - tiny)
        return self.pieces(low, low + tiny)[0][2]


@dataclass(frozen=True, kw_only=True)
class Segment:
    """The part of a member that is rigidly one with an rfe."""

    member: Member
    low: float
    """Beginning, m from the member's start."""
    high: float
    """End, m from the member's start."""

    def point(self, position: float) -> Array:
        """Undeformed place in {F} of ``position`` m from the member's start, (3,)."""
        place: Array = self.member.start + position * self.member.axes[:, 0]
        return place

    def mass_properties(self) -> tuple[float, Array, Array]:
        """Mass (kg), centre of mass in {F} (3,) m, inertia about {F}'s origin along {F}'s axes (3, 3) kg
        m²."""
        mass, first, inertia = 0.0, np.zeros(3), np.zeros((3, 3))
        axes, density = self.member.axes, self.member.material.density
        for low, high, section in self.member.pieces(self.low, self.high):
            part = density * section.area * (high - low)
            centre = self.point(0.5 * (low + high))
            slice_inertia = density * (high - low) * np.array(
                [section.rotary_moment, section.second_moment_2, section.second_moment_3]
            ) + part * (high - low) ** 2 / 12.0 * np.array([0.0, 1.0, 1.0])
            mass += part
            first += part * centre
            inertia += axes @ np.diag(slice_inertia) @ axes.T + part * _steiner(centre)
        return mass, first / mass, inertia


@dataclass(frozen=True, kw_only=True)
class Spring:
    """A spring-damping element between two rfes."""

    member: Member
    position: float
    """Place, m from the member's start."""
    size: float
    """Length Δ of its primary element, m."""
    stiffness: Array
    """c_x1, c_x2, c_x3 (N/m), c_φ1, c_φ2, c_φ3 (N m/rad); (6,)."""
    damping: Array
    """d_x1 … d_φ3, N s/m and N m s/rad; (6,)."""
    fixed_end_forces: Array
    """Section forces at the sde, in the middle of the primary element, under a unit uniform acceleration field
    (columns: along {F}) while the element's ends are held, (6, 3), kg and kg m: with them the frame's weight too
    deflects it exactly. Zero unless the shear is corrected."""

    @property
    def place(self) -> Array:
        """Undeformed place in {F}, (3,), m."""
        place: Array = self.member.start + self.position * self.member.axes[:, 0]
        return place


def _steiner(offset: Array) -> Array:
    return np.asarray(float(offset @ offset) * np.eye(3) - np.outer(offset, offset))


def divide(member: Member, elements: int, *, corrected_shear: bool = True) -> tuple[list[Segment], list[Spring]]:
    """Primary and secondary division of ``member``.

    Args:
        member: The member.
        elements: Number n of primary elements, in [1, 10000].
        corrected_shear: Add Δ³/(12 E J), the bending inside one primary element, to the transverse compliance
            κ Δ/(G A) of eqs. (3)–(4), and the bending by a uniform weight inside it. Static deflections of
            the elements' ends then are exact at any n. False: the paper's elements.

    Returns:
        n + 1 segments (one an rfe) and n sdes between them.
    """
    require_integer(f"elements of {member.name}", elements, low=1, high=10_000)
    size = member.length / elements
    middles = [(index + 0.5) * size for index in range(elements)]
    bounds = [0.0, *middles, member.length]
    segments = [Segment(member=member, low=low, high=high) for low, high in pairwise(bounds)]
    springs = [_spring(member, middle, size, corrected_shear) for middle in middles]
    return segments, springs


def _spring(member: Member, middle: float, size: float, corrected_shear: bool) -> Spring:
    """Make an element's sde, eqs. (2)–(7); where the section changes, the compliances of the parts add up."""
    material = member.material
    rigidity = np.zeros(6)
    bending = np.zeros(6)
    for low, high, section in member.pieces(middle - 0.5 * size, middle + 0.5 * size):
        part = high - low
        rigidity += part / np.array(
            [
                section.area,
                section.area / section.shear_factor_2,
                section.area / section.shear_factor_3,
                section.torsion_constant,
                section.second_moment_2,
                section.second_moment_3,
            ]
        )
        # ∫ x² dx about the element's middle; bending about axis 3 moves along axis 2, and the other way
        # round.
        swept = ((high - middle) ** 3 - (low - middle) ** 3) / 3.0
        bending[1] += swept / section.second_moment_3
        bending[2] += swept / section.second_moment_2
    young, shear = material.young_modulus, material.shear_modulus
    normal = np.array([True, False, False, False, True, True])
    modulus = np.where(normal, young, shear)
    viscosity = np.where(normal, material.normal_damping, material.tangential_damping)
    compliance = rigidity / modulus
    loss = rigidity * viscosity / modulus**2
    if corrected_shear:
        compliance = compliance + bending / young
        loss = loss + bending * material.normal_damping / young**2
    fixed_end_forces = np.zeros((6, 3))
    if corrected_shear:
        # The mean of M3 over an element is that at its middle + q2 Δ²/24 (M2: − q3 Δ²/24): dM3/dx = −V2,
        # dM2/dx = V3.
        half = 0.5 * size
        mass = sum(s.area * (high - low) for low, high, s in member.pieces(middle - half, middle + half))
        load = material.density * mass * size / 24.0 * member.axes
        fixed_end_forces[4], fixed_end_forces[5] = load[:, 2], -load[:, 1]
    stiffness = 1.0 / compliance
    # Two Kelvin–Voigt elements in a row, to first order in frequency: d = c² Σ d_k/c_k².
    return Spring(
        member=member,
        position=middle,
        size=size,
        stiffness=stiffness,
        damping=stiffness**2 * loss,
        fixed_end_forces=fixed_end_forces,
    )
