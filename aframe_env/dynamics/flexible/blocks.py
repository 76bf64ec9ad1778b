"""Reading successive slots of one lane."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import scalar

Array = npt.NDArray[np.float64]


@scalar
def three(block: Array, slot: int, lanes: int, j: int) -> tuple[float, float, float]:
    """Three successive slots of lane j."""
    return block[slot * lanes + j], block[(slot + 1) * lanes + j], block[(slot + 2) * lanes + j]


@scalar
def nine(
    block: Array, slot: int, lanes: int, j: int
) -> tuple[float, float, float, float, float, float, float, float, float]:
    """Nine successive slots of lane j."""
    a, b, c = three(block, slot, lanes, j)
    d, e, f = three(block, slot + 3, lanes, j)
    g, h, i = three(block, slot + 6, lanes, j)
    return a, b, c, d, e, f, g, h, i
