"""Hull, deck, house, A-frame and winch of the picture, in the deck frame, m.

The crane's measures are the scenario's; the ship is a supply ship as one knows them, drawn and not computed with.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from trimesh import Trimesh

from aframe_env.rendering import palette
from aframe_env.rendering.palette import Colour
from aframe_env.scenario.crane import Crane
from train.demo.solids import FloatArray, box, sheet, together, tube, wheel

STERN: Final = 1.6
"""x of the ship's stern."""
BOW: Final = -83.5
"""x of the ship's bow, at the rail."""
HALF_BEAM: Final = 9.0
_WATERLINE: Final = -5.0
_RAIL, _FORECASTLE, _BREAK = 0.9, 5.0, -45.0
"""Heights of the rail aft and of the forecastle, and x at which the latter begins."""
_WOOD: Final[Colour] = (176, 142, 104)
_CONTAINERS: Final[tuple[Colour, ...]] = ((44, 130, 150), (206, 92, 58), (236, 196, 92), (232, 236, 238))


@dataclass(frozen=True)
class Part:
    """Solids of one colour."""

    name: str
    colour: Colour
    mesh: Trimesh


def ship_parts() -> Iterator[Part]:
    """Yield hull, deck, house and what stands on the deck."""
    x = np.unique(np.concatenate([np.linspace(STERN, BOW, 36), [_BREAK, _BREAK - 0.02]]))[::-1]
    along = (x - STERN) / (BOW - STERN)
    keel = np.interp(along, [0.0, 0.19, 0.93, 1.0], [-6.4, -11.0, -11.0, -10.0])
    lines = [
        _waterline(along, keel, -73.5, 0.55, 0.42, 1.6),
        _waterline(along, np.minimum(keel + 1.6, _WATERLINE - 0.4), -76.5, 0.94, 0.48, 1.8),
        _waterline(along, np.full_like(x, _WATERLINE), -80.0, 0.99, 0.58, 2.0),
        _waterline(along, np.full_like(x, _WATERLINE + 0.5), -80.3, 0.99, 0.59, 2.0),
        _waterline(along, _rail(x), BOW, 1.0, 0.68, 2.4),
    ]
    yield Part("bottom", palette.BOTTOM, _both_sides(lines[:3]))
    yield Part("stripe", palette.HOUSE, _both_sides(lines[2:4]))
    yield Part("hull", palette.HULL, _both_sides(lines[3:]))
    edge = lines[-1] - [0.0, 0.0, 0.85]
    edge[x > _BREAK, 2] = 0.0
    yield Part("deck", palette.DECK, sheet(np.stack([edge, edge * [1.0, -1.0, 1.0]])))
    yield Part(
        "planks", _WOOD, together([box((-43.0, y - 0.95, 0.0), (-6.8, y + 0.95, 0.12)) for y in np.arange(-6, 7, 2.0)])
    )
    yield Part("rails", palette.CHROME, together(list(_rails())))
    yield from _house()
    for k, colour in enumerate(_CONTAINERS):
        mine = [place for j, place in enumerate(_CARGO) if j % len(_CONTAINERS) == k]
        yield Part(
            f"containers-{k}", colour, together([box((u, v, w), (u + 6.0, v + 2.4, w + 2.5)) for u, v, w in mine])
        )


_CARGO: Final = (
    (-41.0, -6.4, 0.12),
    (-41.0, -3.6, 0.12),
    (-41.0, 3.9, 0.12),
    (-33.8, -6.4, 0.12),
    (-41.0, -6.4, 2.66),
    (-33.8, 3.9, 0.12),
    (-41.0, 3.9, 2.66),
)
"""Corners of the containers on the deck."""


def _waterline(
    along: FloatArray, z: FloatArray, bow: float, width: float, from_share: float, power: float
) -> FloatArray:
    """One side's line of the hull (n, 3): parallel up to a share of the length, then fining to the bow."""
    fine = np.clip((along - from_share) / (1.0 - from_share), 0.0, 1.0)
    return np.stack([STERN + along * (bow - STERN), HALF_BEAM * width * (1.0 - fine**power), z], axis=1)


def _rail(x: FloatArray) -> FloatArray:
    sheer = np.clip((_BREAK - x) / (_BREAK - BOW), 0.0, 1.0) ** 2
    return np.where(x >= _BREAK, _RAIL, _FORECASTLE + 1.8 * sheer)


def _both_sides(lines: list[FloatArray]) -> Trimesh:
    """The hull between lines of one side, its mirror image, and the transom between them."""
    side = np.stack(lines)
    other = side * [1.0, -1.0, 1.0]
    return together([sheet(side), sheet(other), sheet(np.stack([side[:, 0], other[:, 0]]))])


def _rails() -> Iterator[Trimesh]:
    """Yield the crash rails along the working deck and the handrail on the forecastle."""
    for y in (-7.6, 7.6):
        yield box((-44.0, y - 0.15, 1.5), (-4.5, y + 0.15, 1.8))
        for x in np.arange(-43.0, -4.0, 3.9):
            yield box((x - 0.12, y - 0.12, 0.0), (x + 0.12, y + 0.12, 1.6))


def _house() -> Iterator[Part]:
    white = [
        box((-70.0, -7.4, 4.2), (-49.0, 7.4, 8.6)),
        box((-68.0, -6.6, 8.6), (-51.0, 6.6, 11.4)),
        box((-66.5, -8.2, 11.4), (-53.5, 8.2, 11.8)),
        box((-66.0, -7.2, 13.3), (-54.0, 7.2, 13.7)),
        box((-62.0, -0.4, 13.7), (-61.2, 0.4, 19.0)),
        tube((-61.6, -2.6, 16.6), (-61.6, 2.6, 16.6), 0.16),
    ]
    yield Part("house", palette.HOUSE, together(white))
    glass = [box((-65.6, -6.9, 11.8), (-54.4, 6.9, 13.3))]
    for y in (-1.0, 1.0):
        for x in np.arange(-68.0, -50.0, 2.6):
            glass.append(box((x, y * 7.42 - 0.05, 6.3), (x + 1.3, y * 7.42 + 0.05, 7.5)))
        for x in np.arange(-66.0, -52.0, 2.6):
            glass.append(box((x, y * 6.62 - 0.05, 9.3), (x + 1.3, y * 6.62 + 0.05, 10.5)))
    yield Part("windows", palette.WINDOW, together(glass))
    funnels = [box((-53.0, y - 1.1, 8.6), (-50.2, y + 1.1, 14.6)) for y in (-5.0, 5.0)]
    yield Part("funnels", palette.STEEL, together(funnels))
    caps = [box((-52.9, y - 1.0, 14.6), (-50.3, y + 1.0, 15.3)) for y in (-5.0, 5.0)]
    dome = [tube((-58.0, 4.2, 13.7), (-58.0, 4.2, 15.6), 0.95, 16)]
    yield Part("caps", palette.MACHINE, together([*caps, *dome]))


def frame_parts(crane: Crane) -> Iterator[Part]:
    """Yield the portal with its servomotors, the drum's stand and the pulley's cheeks."""
    frame = crane.frame
    sine, cosine = math.sin(frame.luffing_angle), math.cos(frame.luffing_angle)

    def leg(y: float, height: float) -> tuple[float, float, float]:
        return height * sine, y, height * cosine

    width, top = frame.half_width, frame.height
    steel, cylinders, rods, joints = [], [], [], []
    for y in (-width, width):
        steel.append(tube(leg(y, 0.0), leg(y, top + 0.4), 0.52, 16))
        steel.append(tube(leg(0.45 * y, top), leg(y, 0.74 * top), 0.22))
        foot, end = np.array((frame.servomotor_deck_x, y, 0.0)), np.array(leg(y, frame.servomotor_height))
        middle = 0.42 * foot + 0.58 * end
        cylinders.append(tube(foot, middle, 0.34))
        rods.append(tube(middle, end, 0.18))
        joints += [box(np.subtract(p, 0.6), np.add(p, (0.6, 0.6, 0.5))) for p in (leg(y, 0.0), foot)]
    steel.append(tube(leg(-width, top), leg(width, top), 0.48, 16))
    x, y, z = crane.drum_position
    for side in (-1.55, 1.55):
        for reach in (-1.4, 1.4):
            cylinders.append(tube((x + reach, y + side, 0.0), (x, y + side, z), 0.16))
    cylinders.append(box((x - 1.0, y + 1.9, 0.0), (x + 0.9, y + 3.4, 1.9)))
    yield Part("portal", palette.STEEL, together(steel))
    yield Part("cylinders", palette.MACHINE, together(cylinders))
    yield Part("rods", palette.CHROME, together(rods))
    yield Part("joints", palette.STEEL_SHADE, together(joints))


def drum_parts(crane: Crane) -> Iterator[Part]:
    """Yield the drum about its axle, with one spoke marked."""
    radius = crane.winch.drum_radius
    flanges = [wheel(1.6 * radius, 0.4).apply_translation((0.0, y, 0.0)) for y in (-1.3, 1.3)]
    yield Part("flanges", palette.WARNING, together(flanges))
    yield Part("barrel", palette.CHROME, tube((0.0, -1.3, 0.0), (0.0, 1.3, 0.0), radius, 10))


def pulley_parts() -> Iterator[Part]:
    """Yield the pulley about its axle."""
    yield Part("sheave", palette.CHROME, wheel(PULLEY_RADIUS, 0.5))


PULLEY_RADIUS: Final = 0.8
"""Radius at which the pulley is drawn, m."""


def load_parts() -> Iterator[Part]:
    """Yield the load about its centre: a subsea template on its slings."""
    a, b, c = LOAD_SIZE
    yield Part("template", palette.STEEL, _edges(0.22))
    yield Part("body", palette.LOAD, box((-0.42 * a, -0.42 * b, -0.42 * c), (0.42 * a, 0.42 * b, 0.36 * c)))
    top = [tube((x * a, y * b, 0.36 * c), (x * a, y * b, 0.62 * c), 0.5, 10) for x in (-0.2, 0.2) for y in (-0.2, 0.2)]
    yield Part("wells", palette.MACHINE, together(top))
    hook = box((-0.3, -0.3, SLINGS - 0.3), (0.3, 0.3, SLINGS + 0.5))
    yield Part("slings", palette.ROPE_EDGE, together([_slings(0.07), hook]))


def load_outline() -> Trimesh:
    """Edges and slings of the load: the ghost of the load on a drum that stands still."""
    return together([_edges(0.1), _slings(0.05)])


def _corners() -> list[tuple[float, float]]:
    return [(u * LOAD_SIZE[0], v * LOAD_SIZE[1]) for u in (-0.5, 0.5) for v in (-0.5, 0.5)]


def _edges(radius: float) -> Trimesh:
    a, b, c = LOAD_SIZE
    bars = [tube((x, y, -0.5 * c), (x, y, 0.5 * c), radius, 8) for x, y in _corners()]
    for z in (-0.5 * c, 0.5 * c):
        bars += [tube((-0.5 * a, y, z), (0.5 * a, y, z), radius, 8) for y in (-0.5 * b, 0.5 * b)]
        bars += [tube((x, -0.5 * b, z), (x, 0.5 * b, z), radius, 8) for x in (-0.5 * a, 0.5 * a)]
    return together(bars)


def _slings(radius: float) -> Trimesh:
    top = (0.0, 0.0, SLINGS)
    return together([tube((x, y, 0.5 * LOAD_SIZE[2]), top, radius, 6) for x, y in _corners()])


LOAD_SIZE: Final = (6.0, 5.0, 3.0)
SLINGS: Final = 5.5
"""Height of the hook above the load's centre."""
