"""Natural frequencies and mode shapes of the undamped frame, no load on the rope."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aframe_env.rfem.beam import Array
from aframe_env.rfem.model import FrameModel, frame_model
from aframe_env.rfem.reduction import natural_modes
from aframe_env.validation import InvalidValue, require_integer

if TYPE_CHECKING:
    from aframe_env.scenario.crane import Crane


@dataclass(frozen=True, kw_only=True)
class Modes:
    """Natural modes, lowest first."""

    model: FrameModel
    frequency: Array
    """(k,), Hz."""
    shape: Array
    """q of each mode, (n, k), normalised to unit modal mass: ΦᵀMΦ = 1."""

    def displacement(self, name: str) -> Array:
        """(3, k): displacement in {D} of a named point in each mode, m for unit modal amplitude."""
        return np.asarray(self.model.to_deck @ self.model.structure.translation(name) @ self.shape)


def frame_modes(crane: Crane, count: int = 10, *, model: FrameModel | None = None) -> Modes:
    """The ``count`` lowest modes.

    Args:
        crane: The crane.
        count: Number of modes, at least 1 and at most the number of free coordinates.
        model: The frame's model, if it is not to be the default one (10 and 8 elements).
    """
    frame = model or frame_model(crane.frame)
    if frame.frame != crane.frame:
        raise InvalidValue("model: must have been made of the crane's own frame")
    require_integer("count", count, low=1, high=frame.unknowns["free coordinates"])
    squares, shape = natural_modes(frame, count)
    return Modes(
        model=frame,
        frequency=np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi),
        shape=shape,
    )
