"""Successive slots of one lane, read and written."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.vector import Vector

Array = npt.NDArray[np.float64]


@scalar
def three(block: Array, slot: int, lanes: int, j: int) -> Vector:
    """Three successive slots of lane j."""
    return Vector(block[slot * lanes + j], block[(slot + 1) * lanes + j], block[(slot + 2) * lanes + j])


@scalar
def put_three(block: Array, slot: int, lanes: int, j: int, vector: Vector) -> None:
    """Write three successive slots of lane j."""
    block[slot * lanes + j] = vector.x
    block[(slot + 1) * lanes + j] = vector.y
    block[(slot + 2) * lanes + j] = vector.z


@scalar
def nine(
    block: Array, slot: int, lanes: int, j: int
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Nine successive slots of lane j."""
    a, b, c = three(block, slot, lanes, j)
    d, e, f = three(block, slot + 3, lanes, j)
    g, h, i = three(block, slot + 6, lanes, j)
    return a, b, c, d, e, f, g, h, i
