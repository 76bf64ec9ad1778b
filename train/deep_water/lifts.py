"""Crane, loads and sensors of the study."""

from __future__ import annotations

from aframe_env.scenario import ScenarioDistribution, Sensors, Water
from aframe_env.suite.deep_rope import DEEP_CRANE, steel_load


def lifts(depth: float, sensors: Sensors | None = None) -> ScenarioDistribution:
    """Lifts of 30 to 100 t, ``depth`` m below the pulley, in seas of 1 to 4 m."""
    return ScenarioDistribution(
        hs=(1.0, 4.0),
        load_mass=(30e3, 100e3),
        rope_length=depth,
        # The rope's own damping is its material's.
        rope_damping_ratio=0.0,
        crane=DEEP_CRANE,
        water=Water(),
        load=steel_load(65e3),
        sensors=sensors or Sensors(),
    )
