"""Unknown: nobody knows exactly what hangs on the rope, how soft that is, and how late winch and sensors are."""

from __future__ import annotations

from typing import Final

from aframe_env.scenario import ScenarioDistribution, Sensors, Told
from aframe_env.suite.definition import Seeds, Task

TASK: Final = Task(
    name="Unknown",
    version=0,
    isolates="adaptation: mass, stiffness, delay and lag are not as told",
    distribution=ScenarioDistribution(
        axial_stiffness=(1.7e8, 2.3e8),
        lag=(0.0, 0.3),
        sensor_delay=(0.05, 0.4),
        # Everybody is told the middle of what may be, and the load's mass with an error of its own.
        told=Told(axial_stiffness=2.0e8, lag=0.15),
        sensors=Sensors(delay=0.2),
        told_mass_error=0.2,
    ),
    seeds=Seeds(train=222_000_001, validation=222_000_002, test=222_000_003),
    digests={
        "train": "4f93a661dc51d3c1ca960dc03959932c75283439f72f5520a27ad2da9e97e969",
        "validation": "243917b2feb172f248be89cf00dba3735aa9718da22a970c3fd2386e10c524a5",
        "test": "b7714b5e7cbd9f80f301831b5574d6870a70ce535d519eb100933ff6a1261692",
    },
)
