"""Landing: a load is set down on the seabed by a winch that is too weak for the sea, gently, and stays there."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from aframe_env.scenario import ScenarioDistribution, Seabed, Sensors, TargetPath, Water
from aframe_env.suite.deep_rope import DEEP_CRANE, steel_load
from aframe_env.suite.definition import Seeds, Task

ROPE: Final = 1000.0
"""From the pulley to the load at the start, m."""
WAY: Final = 6.0
"""From there to the ground, m."""
WATER: Final = Water()
GROUND: Final = Seabed(
    depth=WATER.surface_level - DEEP_CRANE.pulley_position[2] + ROPE + WAY, stiffness=1e7, damping=1e6
)
"""Ground that gives way by some centimetres, and from which a load does not bounce by itself."""

TASK: Final = Task(
    name="Landing",
    version=0,
    isolates="contact: a soft landing, and none that is lifted off again",
    distribution=ScenarioDistribution(
        hs=(1.5, 3.0),
        tp=(7.0, 12.0),
        load_mass=(30e3, 100e3),
        rope_length=ROPE,
        # The rope's own damping is its material's.
        rope_damping_ratio=0.0,
        crane=DEEP_CRANE,
        water=replace(WATER, seabed=GROUND),
        load=steel_load(65e3),
        max_rope_speed=(1.2, 2.0),
        max_rope_acceleration=(0.6, 1.2),
        sensors=Sensors.transponder(ROPE),
        # To where the load touches the ground.
        target_path=TargetPath.lowering(-WAY, 0.3, start=15.0),
    ),
    seeds=Seeds(train=227_000_001, validation=227_000_002, test=227_000_003),
    measures=("landing_speed", "lift_offs"),
    digests={
        "train": "0bba3fbdab27fc3bce9eeed132056415e7ca5fd2cd927b57dc52b3971e7acfcc",
        "validation": "e811325f1154aa35ebb37a18a1a3d29daa0a22bab9ad9a74c85f36eb044c40a4",
        "test": "e9e91fd8a775bba0f83404adbff208f322a4e76e89e2a9909456810c97d15ee2",
    },
)
