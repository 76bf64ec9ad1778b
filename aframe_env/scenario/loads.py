"""Ready loads: a few of what goes down on such cranes, with what the water feels of them.

Sizes and masses are of the usual order, no maker's data. Coefficients by the simplified method of DNV-RP-N103 (the
former DNV-RP-H103, 2011): added mass of a structure with vertical sides from that of a plate of its outline, 4.6.3, of
a plate by table A-2, its perforation by 4.6.4; drag 2.5, 4.6.2; slamming 5.0, 4.3. For leaving the water it has no
figure, and ``exit_area`` stays 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from aframe_env.scenario.water import LoadShape
from aframe_env.validation import require_choice, require_number

WATER: Final = 1025.0
"""Density that added masses are reckoned with, kg/m³."""
STEEL: Final = 7850.0
"""kg/m³."""
DRAG: Final = 2.5
"""C_d of subsea structures in oscillating water, at the least."""
SLAMMING: Final = 5.0
"""C_s of anything but smooth cylinders, at the least."""

# Added mass of a plate of sides a < b moving across itself, over that of the water in π/4 a² b: table A-2.
_SIDES = (1.0, 1.25, 1.5, 1.59, 2.0, 2.5, 3.0, 3.17, 4.0, 5.0, 6.25, 8.0, 10.0)
_PLATE = (0.579, 0.642, 0.690, 0.704, 0.757, 0.801, 0.830, 0.840, 0.872, 0.897, 0.917, 0.934, 0.947)


@dataclass(frozen=True, kw_only=True)
class ReadyLoad:
    """A load with its mass and shape, as in ``Scenario(load_mass=ready.mass, load=ready.shape, ...)``."""

    about: str
    mass: float
    """In air, kg."""
    shape: LoadShape


def plate_added_mass(a: float, b: float) -> float:
    """Added mass [kg] of a rectangular plate of sides ``a`` and ``b`` m that moves across itself."""
    short, long = min(a, b), max(a, b)
    return WATER * 0.25 * math.pi * short**2 * long * float(np.interp(long / short, _SIDES, _PLATE))


def with_sides(plate: float, area: float, height: float) -> float:
    """Added mass [kg] of a body with vertical sides of ``height`` m under a ``plate`` [kg] of ``area`` m²."""
    slender = math.sqrt(area) / (height + math.sqrt(area))
    return plate * (1.0 + math.sqrt((1.0 - slender**2) / (2.0 * (1.0 + slender**2))))


def perforated(added_mass: float, perforation: float) -> float:
    """Added mass [kg] that is left with holes in a share ``perforation``, 0 to 1, of the outline."""
    p = 100.0 * perforation
    if p <= 5.0:
        return added_mass
    if p < 34.0:
        return added_mass * (0.7 + 0.3 * math.cos(math.pi * (p - 5.0) / 34.0))
    return added_mass * math.exp((10.0 - p) / 28.0)


def box(length: float, width: float, height: float, perforation: float, volume: float) -> LoadShape:
    """Shape of a box-like structure of these sides [m] that displaces ``volume`` m³.

    ``perforation``: share of the outline's areas that is open, 0 to 0.9.
    """
    for name, value in (("length", length), ("width", width), ("height", height)):
        require_number(name, value, "m", low=0.1, high=100.0)
    require_number("perforation", perforation, "", low=0.0, high=0.9)
    top, side, solid = length * width, length * height, 1.0 - perforation
    return LoadShape(
        volume=volume,
        added_mass_vertical=perforated(with_sides(plate_added_mass(length, width), top, height), perforation),
        added_mass_horizontal=perforated(with_sides(plate_added_mass(length, height), side, width), perforation),
        drag_area_vertical=DRAG * solid * top,
        drag_area_horizontal=DRAG * solid * side,
        height=height,
        slam_area=SLAMMING * solid * top,
    )


def bucket(diameter: float, height: float, mass: float) -> LoadShape:
    """Shape of a suction anchor, a steel cylinder [m, kg] with a vented lid and open below, full of water when wet.

    The water within goes with it; what hits the surface first is the edge of its wall, a twentieth of its area.
    """
    for name, value in (("diameter", diameter), ("height", height)):
        require_number(name, value, "m", low=0.1, high=100.0)
    area = 0.25 * math.pi * diameter**2
    within = WATER * area * height
    disc = WATER * 8.0 / 3.0 * (0.5 * diameter) ** 3
    return LoadShape(
        volume=mass / STEEL,
        added_mass_vertical=within + with_sides(disc, area, height),
        added_mass_horizontal=within + WATER * area * height,
        drag_area_vertical=DRAG * area,
        drag_area_horizontal=1.2 * diameter * height,
        height=height,
        slam_area=SLAMMING * 0.05 * area,
    )


LOADS: Final[dict[str, ReadyLoad]] = {
    "manifold": ReadyLoad(
        about="production manifold, 9 m by 7 m and 4 m high, three tenths of its outline open",
        mass=100e3,
        shape=box(9.0, 7.0, 4.0, 0.3, 100e3 / STEEL),
    ),
    "suction-anchor": ReadyLoad(
        about="suction anchor of 5 m by 12 m, its hatches open", mass=70e3, shape=bucket(5.0, 12.0, 70e3)
    ),
    "rov-cage": ReadyLoad(
        about="cage with a remotely operated vehicle, 2.5 m by 2 m and 4 m high, half of it open",
        mass=7e3,
        shape=box(2.5, 2.0, 4.0, 0.5, 4.5),
    ),
    "template": ReadyLoad(
        about="template of tubes, 16 m by 14 m and 5 m high, four fifths of it open",
        mass=130e3,
        shape=box(16.0, 14.0, 5.0, 0.8, 130e3 / STEEL),
    ),
}
"""By name."""


def ready_load(name: str) -> ReadyLoad:
    """Return a ready load; raises ``InvalidValue`` with the names that there are."""
    require_choice("load", name, tuple(LOADS))
    return LOADS[name]
