"""DeepRope: kilometres of heavy rope, on which the load resonates with the sea, and a winch that is weak for it."""

from __future__ import annotations

from typing import Final

from aframe_env.scenario import Crane, LoadShape, Rope, ScenarioDistribution, Sensors, Water, Winch
from aframe_env.suite.definition import Seeds, Task

STEEL: Final = 7850.0
"""Density of the loads, kg/m³."""
MANIFOLD: Final = 100e3
"""Mass of the load that the shapes are taken from, kg."""
DEEP_CRANE: Final = Crane(rope=Rope.six_strand(), winch=Winch(max_rope_length=3200.0))
"""The reference crane with 70 mm of six-strand rope, and 3,200 m of it: the reference winch has 3,000 m."""


def steel_load(mass: float) -> LoadShape:
    """Shape of a steel load of ``mass`` kg, 0.8 of it added up and down, C_d A = 60 m² at 100 t."""
    area = 60.0 * (mass / MANIFOLD) ** (2.0 / 3.0)
    return LoadShape(
        volume=mass / STEEL,
        added_mass_vertical=0.8 * mass,
        added_mass_horizontal=0.4 * mass,
        drag_area_vertical=area,
        drag_area_horizontal=0.5 * area,
    )


TASK: Final = Task(
    name="DeepRope",
    version=0,
    isolates="resonance: 1 to 3 km of heavy rope, a weak winch",
    distribution=ScenarioDistribution(
        hs=(1.5, 4.0),
        tp=(7.0, 12.0),
        load_mass=(30e3, 100e3),
        rope_length=(1000.0, 3000.0),
        # The rope's own damping is its material's.
        rope_damping_ratio=0.0,
        crane=DEEP_CRANE,
        water=Water(),
        load=steel_load(65e3),
        max_rope_speed=(1.2, 2.0),
        max_rope_acceleration=(0.6, 1.2),
        sensors=Sensors.transponder(2000.0),
    ),
    seeds=Seeds(train=224_000_001, validation=224_000_002, test=224_000_003),
    digests={
        "train": "0986a27dfcefe71ba4da985bd162bf530d790b7dfe1a3ec11f215b287d111cca",
        "validation": "026ed11f507db57f04cdae695ce7c2de66f081115f55d9759600676d552e18c7",
        "test": "e0973f177cf8a86c220be46c217eb0bdc825f94bf832b0e353bbce1d781f700a",
    },
)
