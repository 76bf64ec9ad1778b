"""Where the load shall be: a level that holds, or goes along straight lines in time with rounded corners."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import fma, larger, scalar, smaller
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.lift import END_TARGET

Array = npt.NDArray[np.float64]


@scalar
def turned(since: float, corner: float) -> tuple[float, float]:
    """Way and speed ``since`` s after the middle of a corner from rest to 1 m/s that takes ``corner`` s to go round."""
    rounding = smaller(larger(since + 0.5 * corner, 0.0), corner)
    return 0.5 * rounding * rounding / corner + larger(since - 0.5 * corner, 0.0), rounding / corner


@scalar
def target_at(row: Array, time: float, lanes: int, j: int) -> tuple[float, float]:
    """Level [m] and velocity [m/s] of lane j's target ``time`` s after the start."""
    level, rate = row[at.LEVEL * lanes + j], 0.0
    corner = row[at.CORNER_TIME * lanes + j]
    for k in range(int(row[at.CORNERS * lanes + j])):
        change = row[(at.PROFILE + at.PROFILE_MOST + k) * lanes + j]
        way, speed = turned(time - row[(at.PROFILE + k) * lanes + j], corner)
        level, rate = fma(change, way, level), fma(change, speed, rate)
    return level, rate


@scalar
def move_target(row: Array, span: Span) -> None:
    """Say where the target is at start, middle and end of the inner step, in lanes where it moves."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.CORNERS * lanes + j] > 0.0:
            begun = (row[at.STEP * lanes + j] - 1.0) * row[at.CONTROL_PERIOD * lanes + j]
            middle, half = begun + row[at.MOMENT * lanes + j], 0.5 * row[at.INNER_STEP * lanes + j]
            for k in range(3):
                level, rate = target_at(row, middle + (k - 1.0) * half, lanes, j)
                row[(at.ENDS + k * at.END_SIZE + END_TARGET) * lanes + j] = level
                row[at.TARGET_RATE * lanes + j] = rate
