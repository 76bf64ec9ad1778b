"""Splash: through the splash zone, where waves lift the load and let its rope go slack, and snap."""

from __future__ import annotations

from typing import Final

from aframe_env.scenario import Crane, LoadShape, Rope, ScenarioDistribution, TargetPath, Water
from aframe_env.suite.definition import Seeds, Task

COVER: Final = LoadShape(
    volume=8.3,
    added_mass_vertical=130e3,
    added_mass_horizontal=26e3,
    drag_area_vertical=120.0,
    drag_area_horizontal=36.0,
    height=3.0,
    slam_area=250.0,
    exit_area=100.0,
)
"""A protection cover of 65 t of steel, 5 m by 10 m, with openings in it.

By DNV-RP-N103: added mass of a plate of these sides, 153 t, less what the openings let through; C_s = 5, C_e = 2 and
C_d = 2.4 on 50 m².
"""

TASK: Final = Task(
    name="Splash",
    version=0,
    isolates="the splash zone: slam, drag and added mass on a plate, slack and snap",
    distribution=ScenarioDistribution(
        hs=(1.5, 3.5),
        tp=(6.0, 12.0),
        load_mass=(30e3, 100e3),
        # It does not part where the reference crane's would: what a snap pulls is a measure, not an end.
        crane=Crane(rope=Rope(breaking_load=1e7)),
        # In the air at first: its middle is 4 m above the water.
        rope_length=12.0,
        water=Water(),
        load=COVER,
        target_path=TargetPath.lowering(-20.0, 0.4, start=15.0),
    ),
    seeds=Seeds(train=226_000_001, validation=226_000_002, test=226_000_003),
    measures=("slack_per_hour", "peak_tension"),
    digests={
        "train": "8835326f18e0bb7c4cf3ee10ee2d8e81440af2408e5070143340b2da17a57a0b",
        "validation": "a187df40b20daeea7e1b2b1eb1f461439e2097b88dcd3b0d8ea8bb4e6bdfc72c",
        "test": "f97f9b30169a919d666e53487770d1a9b7a614f392fbf13e2de2d2629fe1e084",
    },
)
