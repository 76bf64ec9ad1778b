"""The sea surface about the ship."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from aframe_env.scenario.sea import SeaMotion

FloatArray = npt.NDArray[np.float64]

_FREEBOARD: Final = 5.0
"""Height of the deck above the water where the ship motion does not say, m."""


@dataclass(frozen=True)
class Water:
    """Regular waves in the axes of the base frame: elevation Σ a cos(ω t + ε - k_x x - k_y y) above ``level``."""

    level: float
    """Height of the still water, m."""
    frequency: FloatArray
    """(K,) rad/s."""
    wave_number: FloatArray
    """(K, 2) along x and y, rad/m."""
    amplitude: FloatArray
    """(K,) m."""
    phase: FloatArray
    """(K,) rad."""
    ramp: float
    """Time over which the waves, as the ship's motion, build up, s."""

    def heights(self, x: npt.ArrayLike, y: float, time: float) -> FloatArray:
        """Heights of the surface above the base frame's origin at places x (N,), y [m], m."""
        place = np.asarray(x, dtype=np.float64)[:, None]
        phase = self.frequency * time + self.phase - self.wave_number[:, 0] * place - self.wave_number[:, 1] * y
        share = min(time / self.ramp, 1.0) if self.ramp else 1.0
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        return np.asarray(self.level + smooth * (np.cos(phase) @ self.amplitude))


def water_of(scenario: Scenario) -> Water:
    """Return the waves that move the scenario's ship; flat water where the ship motion has no waves."""
    motion, water = scenario.motion, scenario.water
    if not isinstance(motion, SeaMotion):
        nothing, level = np.zeros(0), -_FREEBOARD if water is None else water.surface_level
        return Water(level, nothing, np.zeros((0, 2)), nothing, nothing, 0.0)
    waves, vessel = motion.sea.waves(), motion.vessel
    # Ship axes (x forward, y to port, travelling towards `direction`) to the deck's (x aft, y to starboard);
    # phases refer to the vessel's reference point.
    deep = waves.frequency**2 / scenario.gravity
    wave_number = -deep[:, None] * np.stack([np.cos(waves.direction), np.sin(waves.direction)], axis=1)
    deck, reference = np.array(vessel.deck_position), np.array(vessel.reference_point)
    at_deck = waves.phase + wave_number @ (deck - reference)[:2]
    level = -float(deck[2]) if water is None else water.surface_level
    return Water(level, waves.frequency, wave_number, waves.amplitude, at_deck, scenario.ramp)
