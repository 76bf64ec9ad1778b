"""An open-loop drive as a policy: the drum speeds that bring the drum onto φ_H(t) and keep it there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from agents.drives.following import Follower
from agents.drives.optimisation import OptimisedDrive
from agents.policy import FloatArray, Knowledge


@dataclass
class DrivePolicy:
    """Follow a drive in every row, by the clock and the winch's limits alone."""

    name: str
    drives: Sequence[OptimisedDrive]
    """Drives, one for each row."""
    knows: Knowledge = Knowledge.CLOCK
    """FUTURE where the drives were optimised for the very scenarios that they run in."""
    _follower: Follower = field(init=False)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the winch's limits are looked at."""
        self._follower = Follower([found.drive for found in self.drives], scenarios, control_period)

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s."""
        return self._follower.command(time)
