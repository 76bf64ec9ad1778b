"""Solid shapes of the picture: drawn, not computed with. Lengths in m."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import numpy.typing as npt
from trimesh import Trimesh
from trimesh.creation import box as centred_box
from trimesh.creation import cylinder, torus
from trimesh.util import concatenate

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


def box(low: npt.ArrayLike, high: npt.ArrayLike) -> Trimesh:
    """Box between two opposite corners (3,)."""
    return cast(Trimesh, centred_box(bounds=np.array([low, high])))


def tube(start: npt.ArrayLike, end: npt.ArrayLike, radius: float, sections: int = 12) -> Trimesh:
    """Round bar between two points (3,)."""
    return cast(Trimesh, cylinder(radius=radius, segment=np.array([start, end]), sections=sections))


def ring(radius: float, thickness: float) -> Trimesh:
    """Flat-lying ring about the origin; ``thickness`` is its bar's radius."""
    return cast(Trimesh, torus(major_radius=radius, minor_radius=thickness, major_sections=48, minor_sections=8))


def wheel(radius: float, width: float, spokes: int = 6) -> Trimesh:
    """Flange with spokes about the origin, its axle along y."""
    rim = torus(major_radius=radius, minor_radius=0.12 * radius, major_sections=32, minor_sections=8)
    rim.vertices = rim.vertices[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    angles = np.linspace(0.0, 2.0 * np.pi, spokes, endpoint=False)
    tips = radius * np.stack([np.cos(angles), np.zeros(spokes), np.sin(angles)], axis=1)
    bars = [tube((0.0, 0.0, 0.0), tip, 0.07 * radius, 6) for tip in tips]
    hub = tube((0.0, -0.5 * width, 0.0), (0.0, 0.5 * width, 0.0), 0.22 * radius)
    return together([rim, hub, *bars])


def together(meshes: Sequence[Trimesh]) -> Trimesh:
    """Several meshes as one."""
    return cast(Trimesh, concatenate(list(meshes)))


def grid_faces(rows: int, columns: int) -> IntArray:
    """Triangles (2 (rows - 1) (columns - 1), 3) over vertices that lie row by row."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    first = np.stack([corner, corner + 1, corner + columns + 1], axis=1)
    second = np.stack([corner, corner + columns + 1, corner + columns], axis=1)
    return np.concatenate([first, second])


def sheet(points: FloatArray) -> Trimesh:
    """Surface over a grid of points (rows, columns, 3)."""
    rows, columns, _ = points.shape
    return Trimesh(points.reshape(-1, 3), grid_faces(rows, columns), process=False)
