"""Energy of the flexible frame of an engine's one row."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.flexible_engine import FlexibleEngine


def frame_energy(engine: FlexibleEngine, gravity: float) -> tuple[float, npt.NDArray[np.float64]]:
    """Energy of the frame above a still deck, J, kinetic and potential by their definitions; and its pulley's place."""
    frame, row, table = engine.frames[0], engine.blocks[0], engine._tables[0]
    count = int(table[flex.COUNT])
    place, rate = frame[flex.MODES :].reshape(-1, flex.MODE_SLOTS)[:count, :2].T
    modes = table[flex.HEAD :][: count * flex.MODE_SIZE].reshape(count, -1)
    found = 0.5 * (rate**2 + modes[:, flex.SQUARE] * place**2) + gravity * modes[:, flex.FIELD + 2] * place
    pulley = row[at.PULLEY_ON_DECK :][:3] + place @ modes[:, flex.SHAPE : flex.SHAPE + 3]
    return float(found.sum()), pulley
