"""Material and cross-sections of the frame's members.

Axes of a section: 1 runs along the member, 2 and 3 are the principal axes across it. On the frame axis 3 is
x of {F} (out of the frame's plane) and axis 2 lies in the frame's plane. ``second_moment_2`` is the second
moment of area *about* axis 2 (bending that displaces along 3); ``shear_factor_2`` goes with shear force
*along* axis 2 (paper's κ2 in c = G A / (κ2 Δ), eq. (3)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple, TypeAlias

from aframe_env.validation import InvalidValue, require_instance, require_number, require_vector, shown


class StressPoint(NamedTuple):
    """A point of a section where the stress is evaluated; by symmetry it stands for its mirror images too."""

    offset_2: float
    """Distance from axis 3 (coordinate along axis 2), m."""
    offset_3: float
    """Distance from axis 2 (coordinate along axis 3), m."""
    shear_2: float
    """Shear stress for a unit shear force V2, 1/m²."""
    shear_3: float
    """Shear stress for a unit shear force V3, 1/m²."""
    torsion: float
    """Shear stress for a unit torque, 1/m³."""


_RADIUS_SQUARED: Final = 1e-8, 1e4
"""Range of a moment over the area, m²: radii of gyration from 0.1 mm to 100 m."""


@dataclass(frozen=True, kw_only=True)
class Material:
    """Linear viscoelastic (Kelvin–Voigt) material; the defaults are steel without damping."""

    young_modulus: float = 2.1e11
    """E, Pa."""
    shear_modulus: float = 8.1e10
    """G, Pa."""
    density: float = 7850.0
    """ρ, kg/m³."""
    normal_damping: float = 0.0
    """η of normal strain, Pa s (paper's (2), (6), (7))."""
    tangential_damping: float = 0.0
    """η of shear strain, Pa s (paper's (3)–(5))."""
    yield_strength: float = 3.55e8
    """R_e, Pa, which the utilisation of a stress refers to; the default is that of S355."""

    def __post_init__(self) -> None:
        require_number("young_modulus", self.young_modulus, "Pa", low=1e6, high=1e16)
        require_number("shear_modulus", self.shear_modulus, "Pa", low=1e6, high=1e16)
        require_number("density", self.density, "kg/m³", low=1.0, high=1e6)
        require_number("normal_damping", self.normal_damping, "Pa s", low=0.0, high=1e12)
        require_number("tangential_damping", self.tangential_damping, "Pa s", low=0.0, high=1e12)
        require_number("yield_strength", self.yield_strength, "Pa", low=1e3, high=1e12)


@dataclass(frozen=True, kw_only=True)
class GivenSection:
    """A section given by its constants. The other sections compute theirs and turn into this one."""

    area: float
    """A, m²."""
    torsion_constant: float
    """J_0 of eq. (5), m⁴: the torsion constant, not the polar moment."""
    second_moment_2: float
    """J_2, about axis 2, m⁴."""
    second_moment_3: float
    """J_3, about axis 3, m⁴."""
    shear_factor_2: float
    """κ2, for shear along axis 2; 1 or more."""
    shear_factor_3: float
    """κ3, for shear along axis 3; 1 or more."""
    polar_moment: float | None = None
    """Polar moment for the rotary inertia about axis 1, m⁴; None for J_2 + J_3."""
    stress_points: tuple[StressPoint, ...] = ()
    """Points where stress is evaluated; empty: no stresses can be computed."""

    def __post_init__(self) -> None:
        require_number("area", self.area, "m²", low=1e-6, high=1e3)
        low, high = (self.area * ratio for ratio in _RADIUS_SQUARED)
        for name in ("torsion_constant", "second_moment_2", "second_moment_3", "polar_moment"):
            moment = getattr(self, name)
            if name != "polar_moment" or moment is not None:
                require_number(name, moment, f"m⁴ for area {self.area:g} m²", low=low, high=high)
        for name in ("shear_factor_2", "shear_factor_3"):
            require_number(name, getattr(self, name), "", low=1.0, high=1e3)
        require_instance("stress_points", self.stress_points, tuple)
        for index, point in enumerate(self.stress_points):
            require_vector(f"stress_points[{index}]", point, "m, m, 1/m², 1/m² and 1/m³", size=5, low=-1e12, high=1e12)

    @property
    def rotary_moment(self) -> float:
        """Polar second moment for the rotary inertia about axis 1, m⁴."""
        return self.second_moment_2 + self.second_moment_3 if self.polar_moment is None else self.polar_moment

    def given(self) -> GivenSection:
        """Return the section's constants: itself."""
        return self


def _positive(**lengths: float) -> None:
    for name, value in lengths.items():
        require_number(name, value, "m", low=1e-3, high=100.0)


def _flow_energy(constant: float, wall: float, length: float) -> float:
    """∫ q² ds / t over a wall of ``length`` with q = c + (t/2)(a² − y²), a = length/2."""
    a, k = 0.5 * length, 0.5 * wall
    return (2.0 * a * constant**2 + 8.0 / 3.0 * constant * k * a**3 + 16.0 / 15.0 * k**2 * a**5) / wall


@dataclass(frozen=True, kw_only=True)
class RectangularHollow:
    """Rectangular hollow box of uniform wall.

    Torsion constant after Bredt, shear factors from the energy of the thin-walled shear flow (all on the
    wall's middle line); areas and second moments exact.
    """

    side_2: float
    """Outer size along axis 2, m."""
    side_3: float
    """Outer size along axis 3, m."""
    wall: float
    """Wall thickness, m; less than half of the smaller side."""

    def __post_init__(self) -> None:
        _positive(side_2=self.side_2, side_3=self.side_3, wall=self.wall)
        if 2.0 * self.wall >= min(self.side_2, self.side_3):
            raise InvalidValue(f"wall = {self.wall} m: must be in (0, {0.5 * min(self.side_2, self.side_3):g}) m")

    def given(self) -> GivenSection:
        """Return the section's constants."""
        b, h, t = self.side_2, self.side_3, self.wall
        bi, hi, bm, hm = b - 2 * t, h - 2 * t, b - t, h - t
        area = b * h - bi * hi
        moment_2 = (b * h**3 - bi * hi**3) / 12.0
        moment_3 = (h * b**3 - hi * bi**3) / 12.0
        corner, enclosed = 0.25 * bm * hm, bm * hm
        twist = 1.0 / (2.0 * enclosed * t)
        points = (
            StressPoint(b / 2, h / 2, corner / moment_3, corner / moment_2, twist),
            StressPoint(b / 2, 0.0, 0.0, (corner + hm**2 / 8) / moment_2, twist),
            StressPoint(0.0, h / 2, (corner + bm**2 / 8) / moment_3, 0.0, twist),
        )
        return GivenSection(
            area=area,
            torsion_constant=2.0 * enclosed**2 * t / (bm + hm),
            second_moment_2=moment_2,
            second_moment_3=moment_3,
            shear_factor_2=self._shear_factor(bm, hm),
            shear_factor_3=self._shear_factor(hm, bm),
            stress_points=points,
        )

    def _shear_factor(self, along: float, across: float) -> float:
        t = self.wall
        area = 2.0 * t * (along + across)
        moment = t * along**3 / 6.0 + t * across * along**2 / 2.0
        webs = 2.0 * _flow_energy(0.25 * t * along * across, t, along)
        flanges = 4.0 * t * (0.5 * along) ** 2 * (0.5 * across) ** 3 / 3.0
        return area / moment**2 * (webs + flanges)


@dataclass(frozen=True, kw_only=True)
class SolidRectangle:
    """Solid rectangle: κ = 1.2, Saint-Venant's series for torsion."""

    side_2: float
    """Size along axis 2, m."""
    side_3: float
    """Size along axis 3, m."""

    def __post_init__(self) -> None:
        _positive(side_2=self.side_2, side_3=self.side_3)

    def given(self) -> GivenSection:
        """Return the section's constants."""
        b, h = self.side_2, self.side_3
        area, moment_2, moment_3 = b * h, b * h**3 / 12.0, h * b**3 / 12.0
        short, long = min(b, h), max(b, h)
        odd = range(1, 40, 2)
        tanh_sum = sum(math.tanh(0.5 * n * math.pi * long / short) / n**5 for n in odd)
        torsion = long * short**3 / 3.0 * (1.0 - 192.0 / math.pi**5 * short / long * tanh_sum)
        cosh_sum = sum(1.0 / (n**2 * math.cosh(min(0.5 * n * math.pi * long / short, 700.0))) for n in odd)
        twist = short / torsion * (1.0 - 8.0 / math.pi**2 * cosh_sum)
        middle = 1.5 / area
        points = (
            StressPoint(b / 2, h / 2, 0.0, 0.0, 0.0),
            StressPoint(b / 2, 0.0, 0.0, middle, twist),
            StressPoint(0.0, h / 2, middle, 0.0, twist),
            StressPoint(0.0, 0.0, middle, middle, 0.0),
        )
        return GivenSection(
            area=area,
            torsion_constant=torsion,
            second_moment_2=moment_2,
            second_moment_3=moment_3,
            shear_factor_2=1.2,
            shear_factor_3=1.2,
            stress_points=points,
        )


@dataclass(frozen=True, kw_only=True)
class Tube:
    """Circular tube; shear factor after Cowper (1966) with ν = 0.3."""

    diameter: float
    """Outer diameter, m."""
    wall: float
    """Wall thickness, m; at most half of the diameter (then the bar is solid)."""

    def __post_init__(self) -> None:
        _positive(diameter=self.diameter)
        require_number("wall", self.wall, "m", low=0.0, high=0.5 * self.diameter, low_open=True)

    def given(self) -> GivenSection:
        """Return the section's constants."""
        r, ri, nu = 0.5 * self.diameter, 0.5 * self.diameter - self.wall, 0.3
        area = math.pi * (r**2 - ri**2)
        moment = math.pi * (r**4 - ri**4) / 4.0
        m2 = (ri / r) ** 2
        cowper = 6 * (1 + nu) * (1 + m2) ** 2 / ((7 + 6 * nu) * (1 + m2) ** 2 + (20 + 12 * nu) * m2)
        # Jourawski at the neutral axis: V Q / (I b), Q of half the ring, b = both walls.
        shear = (2.0 / 3.0) * (r**3 - ri**3) / (moment * 2.0 * (r - ri))
        twist = r / (2.0 * moment)
        # Every 11.25°: bending about both axes at once peaks on the resultant's radius (error 0.5 % at most).
        turns = [(math.cos(k * math.pi / 16), math.sin(k * math.pi / 16)) for k in range(9)]
        points = tuple(StressPoint(r * c, r * s, shear * s, shear * c, twist) for c, s in turns)
        return GivenSection(
            area=area,
            torsion_constant=2.0 * moment,
            second_moment_2=moment,
            second_moment_3=moment,
            shear_factor_2=1.0 / cowper,
            shear_factor_3=1.0 / cowper,
            stress_points=points,
        )


@dataclass(frozen=True, kw_only=True)
class ISection:
    """Doubly symmetric I; web along axis 3, flanges along axis 2 (open: no warping stiffness)."""

    height: float
    """Overall size along axis 3, m."""
    flange_width: float
    """Size along axis 2, m."""
    web: float
    """Web thickness, m; less than the flange width."""
    flange: float
    """Flange thickness, m; less than half of the height."""

    def __post_init__(self) -> None:
        _positive(height=self.height, flange_width=self.flange_width)
        require_number("web", self.web, "m", low=0.0, high=self.flange_width, low_open=True)
        require_number("flange", self.flange, "m", low=0.0, high=0.499 * self.height, low_open=True)

    def given(self) -> GivenSection:
        """Return the section's constants."""
        h, b, tw, tf = self.height, self.flange_width, self.web, self.flange
        clear, hm = h - 2 * tf, h - tf
        area = 2 * b * tf + clear * tw
        moment_2 = (b * h**3 - (b - tw) * clear**3) / 12.0
        moment_3 = (2 * tf * b**3 + clear * tw**3) / 12.0
        torsion = (2 * b * tf**3 + clear * tw**3) / 3.0
        thin_area, thin_moment = 2 * b * tf + hm * tw, tw * hm**3 / 12.0 + b * tf * hm**2 / 2.0
        energy = _flow_energy(0.5 * tf * b * hm, tw, hm) + 4.0 * tf * (0.5 * hm) ** 2 * (0.5 * b) ** 3 / 3.0
        tip = b / 2
        flange_shear = 1.5 / (2 * b * tf)
        points = (
            StressPoint(tip, h / 2, 0.0, 0.0, tf / torsion),
            StressPoint(0.0, h / 2, flange_shear, 0.25 * b * hm / moment_2, tf / torsion),
            StressPoint(tw / 2, clear / 2, 0.0, b * tf * hm / 2 / (moment_2 * tw), max(tf, tw) / torsion),
            StressPoint(tw / 2, 0.0, 0.0, (b * tf * hm / 2 + tw * clear**2 / 8) / (moment_2 * tw), tw / torsion),
        )
        return GivenSection(
            area=area,
            torsion_constant=torsion,
            second_moment_2=moment_2,
            second_moment_3=moment_3,
            shear_factor_2=1.2 * area / (2 * b * tf),
            shear_factor_3=thin_area / thin_moment**2 * energy,
            stress_points=points,
        )


Section: TypeAlias = RectangularHollow | SolidRectangle | Tube | ISection | GivenSection
"""The closed set of sections."""

MemberSection: TypeAlias = Section | tuple[Section, ...]
"""One section for a whole member, or several for as many equally long pieces of it, from its start to its
end."""


def _reference(side_2: float, side_3: float) -> GivenSection:
    """Box 1.0 m × 0.6 m, wall 25 mm, with the constants of the reference crane (rounded as published
    there)."""
    strong_along_3 = side_3 > side_2
    moments, factors = (0.0107036, 0.0048286), (3.77, 1.76)
    if not strong_along_3:
        moments, factors = moments[::-1], factors[::-1]
    return GivenSection(
        area=0.0775,
        torsion_constant=0.0101387,
        second_moment_2=moments[0],
        second_moment_3=moments[1],
        shear_factor_2=factors[0],
        shear_factor_3=factors[1],
        polar_moment=0.0155322,
        stress_points=RectangularHollow(side_2=side_2, side_3=side_3, wall=0.025).given().stress_points,
    )


def reference_leg_section() -> GivenSection:
    """Section of the reference crane's legs: the 1.0 m side along axis 3, x of {F}."""
    return _reference(0.6, 1.0)


def reference_beam_section() -> GivenSection:
    """Section of the reference crane's top beam: the 1.0 m side along axis 2, in the frame's plane."""
    return _reference(1.0, 0.6)


@dataclass(frozen=True, kw_only=True)
class Servomotor:
    """One of the two luffing cylinders: a rigid link, or a spring-damper (the oil)."""

    stiffness: float | None = None
    """Axial stiffness, N/m; None for a rigid link of prescribed length (the paper's constraint)."""
    damping: float = 0.0
    """Axial damping, N s/m; only with a stiffness."""

    def __post_init__(self) -> None:
        require_number("damping", self.damping, "N s/m", low=0.0, high=1e12)
        if self.stiffness is not None:
            require_number("stiffness", self.stiffness, "N/m", low=1.0, high=1e14)
        elif self.damping:
            raise InvalidValue(f"damping = {self.damping} N s/m: a rigid servomotor (stiffness None) has none")


@dataclass(frozen=True, kw_only=True)
class FrameStructure:
    """Material, sections and servomotors of the frame; the defaults are the reference crane's."""

    material: Material = field(default_factory=Material)
    leg_section: MemberSection = field(default_factory=reference_leg_section)
    """Section of either leg, from foot to corner."""
    beam_section: MemberSection = field(default_factory=reference_beam_section)
    """Section of the top beam, from B_R to B_L."""
    servomotor: Servomotor = field(default_factory=Servomotor)
    """Each of the two luffing cylinders."""

    def __post_init__(self) -> None:
        require_instance("material", self.material, Material)
        require_instance("servomotor", self.servomotor, Servomotor)
        for name in ("leg_section", "beam_section"):
            value = getattr(self, name)
            pieces = value if isinstance(value, tuple) else (value,)
            if not pieces or not all(isinstance(piece, Section) for piece in pieces):
                raise InvalidValue(f"{name} = {shown(value)}: must be a section, or a tuple of one or more sections")
