"""The drive map as a policy: drives put together from the map for the heave measured before the start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from agents.drives.following import Follower
from agents.drives.forecast import Measurement, known_harmonics
from agents.drives.map import DriveMap
from agents.policy import FloatArray, Knowledge


@dataclass
class DriveMapPolicy:
    """Follow the map's drive, by the clock alone once the episode has begun.

    At the start it is told the load's mass, the rope's length, how the ship's motion will ramp up, and a record of the
    crane tip's heave up to then, in the same sea. Without a ``measurement`` it is told every wave instead, with its
    phase: in a linear sea that is the whole future, and it shows what the map itself is worth.
    """

    drive_map: DriveMap
    measurement: Measurement | None = field(default_factory=Measurement)
    duration: float = 60.0
    """Duration of the drives, s; the drum stands still afterwards."""
    name: str = field(init=False)
    knows: Knowledge = field(init=False)
    measured: str = field(init=False)
    """Knowledge given at the start, in words."""
    _follower: Follower = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.measurement is None:
            self.name, self.knows = "drive map, every wave known", Knowledge.FUTURE
            self.measured = "load mass, rope length, every wave's amplitude, period and phase"
        else:
            self.name, self.knows = "drive map by the clock", Knowledge.CLOCK
            self.measured = (
                f"load mass, rope length, the crane tip's heave over the {self.measurement.record:g} s before the start"
            )

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes, each with a drive for the heave measured before its start."""
        drives = [
            self.drive_map.drive(
                scenario,
                known_harmonics(scenario) if self.measurement is None else self.measurement.forecast(scenario),
                self.duration,
            )
            for scenario in scenarios
        ]
        self._follower = Follower(drives, scenarios, control_period)

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s."""
        return self._follower.command(time)
