"""Recent history of the rows, for the strip chart."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env import task
from aframe_env.simulation import Simulation

FloatArray = npt.NDArray[np.float64]

SPAN: Final = 60.0
"""Length of the history, s."""


class History:
    """Time [s], depth error of the load [m] and heave of the pulley [m] of every row, one line a control step."""

    def __init__(self, control_period: float) -> None:
        self._lines: deque[FloatArray] = deque(maxlen=math.ceil(SPAN / control_period) + 1)

    def record(self, simulation: Simulation) -> None:
        """Append the present."""
        state = simulation.state
        self._lines.append(
            np.stack(
                [simulation.results[:, task.TIME], state[:, task.DEPTH_ERROR], state[:, task.PULLEY_HEAVE]], axis=1
            )
        )

    def of(self, row: int) -> FloatArray:
        """Lines (n, 3) of a row's present episode, the oldest first."""
        lines = np.array([line[row] for line in self._lines]).reshape(-1, 3)
        # Where time did not advance, another episode began.
        breaks = np.flatnonzero(np.diff(lines[:, 0]) <= 0.0)
        return lines[breaks[-1] + 1 :] if len(breaks) else lines
