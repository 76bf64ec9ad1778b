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
        "train": "ada389d0ab6a5b75232eb9da63a7778e045c3d7cdeb651212686ff652d8117d4",
        "validation": "0f2f769f8bac6f61aee7e628a2cda6793432d98d4e4084e4d8af8f8b93a44c54",
        "test": "22a2dcf82844f9cc06869ee1b901a690a55b76954aba15e2e3d977f3c148f69e",
    },
)
