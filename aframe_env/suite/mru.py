"""MRU: a motion reference unit as they are, so that what it tells is not what the pulley does."""

from __future__ import annotations

import math
from typing import Final

from aframe_env.scenario import MotionUnit, ScenarioDistribution, Sensors
from aframe_env.suite.definition import Seeds, Task

TASK: Final = Task(
    name="MRU",
    version=0,
    isolates="estimation: what the motion unit tells is not what the pulley does",
    distribution=ScenarioDistribution(
        ramp=0.0,
        sensor_delay=(0.1, 0.4),
        sensors=Sensors(
            delay=0.2,
            motion_unit=MotionUnit(
                heave_period=(18.0, 22.0),
                heave_damping=0.707,
                lever_arm_error=0.5,
                acceleration_drift=0.01,
                drift_time=60.0,
                angle_bias=math.radians(0.1),
                dropouts=2.0,
                dropout_time=2.0,
            ),
        ),
    ),
    seeds=Seeds(train=223_000_001, validation=223_000_002, test=223_000_004),
    digests={
        "train": "84b72cdf6dc3b07eb9054e4204b7aa8a88f4d2231fcd09821e742d2e835dabe7",
        "validation": "ed1bda9d29a82f47dc1f43f2cae5885946427ffbb9907e4c2c5cb7ace5f88c16",
        "test": "374c68b56ab0e68ff2c28a2793b8c1c49b07437bca036611721d745c59dd75cf",
    },
)
