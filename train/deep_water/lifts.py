"""Crane, loads and sensors of the study."""

from __future__ import annotations

from typing import Final

from aframe_env.scenario import Crane, LoadShape, Rope, ScenarioDistribution, Sensors, Water, Winch

STEEL: Final = 7850.0
"""Density of the loads, kg/m³."""
MANIFOLD: Final = 100e3
"""Mass of the load that the shapes are taken from, kg."""
DEEP_CRANE: Final = Crane(rope=Rope.six_strand(), winch=Winch(max_rope_length=3200.0))
"""The reference crane with 70 mm of six-strand rope, and 3,200 m of it: the reference winch has 3,000 m."""


def shape(mass: float) -> LoadShape:
    """Shape of a steel load of ``mass`` kg, 0.8 of it added up and down, C_d A = 60 m² at 100 t."""
    area = 60.0 * (mass / MANIFOLD) ** (2.0 / 3.0)
    return LoadShape(
        volume=mass / STEEL,
        added_mass_vertical=0.8 * mass,
        added_mass_horizontal=0.4 * mass,
        drag_area_vertical=area,
        drag_area_horizontal=0.5 * area,
    )


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
        load=shape(65e3),
        sensors=sensors or Sensors(),
    )
