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
            delay=0.25,
            motion_unit=MotionUnit(
                heave_period=(16.0, 24.0),
                heave_damping=0.707,
                lever_arm_error=0.5,
                acceleration_drift=0.01,
                drift_time=60.0,
                angle_bias=math.radians(0.1),
                dropouts=2.0,
                dropout_time=1.0,
            ),
        ),
    ),
    seeds=Seeds(train=223_000_001, validation=223_000_002, test=223_000_003),
    digests={
        "train": "fb571f288c515732b9cb5caf22b3b3f6f033150ec36732654b4c8d4b8ddb1c03",
        "validation": "4fffe18b6a9dd97804d8445ba311d7cdc0ec7f68a763d81622945438841737c6",
        "test": "7793aff6d9ab2f538d5af0233ce9689d8fa2db1392b41c42eba382e2f66c3cbf",
    },
)
