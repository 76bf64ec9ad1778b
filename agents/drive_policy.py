"""An open-loop drive as a policy: the drum speed that keeps the drum's own angle on φ_H(t)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from aframe_env.task import SENSED, STATE
from aframe_env.validation import InvalidValue
from agents.optimisation import OptimisedDrive
from agents.policy import FloatArray, Knowledge


@dataclass
class DrivePolicy:
    """Follow a drive in every row, by the clock and the drum's encoder alone."""

    name: str
    drives: Sequence[OptimisedDrive]
    """One for each row."""
    knows: Knowledge = Knowledge.CLOCK
    """FUTURE where the drives were optimised for the very scenarios that they run in."""
    _period: float = field(init=False, default=0.1)
    _acceleration: FloatArray = field(init=False, default_factory=lambda: np.zeros(0))

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the winch's acceleration limit is looked at."""
        if len(scenarios) != len(self.drives):
            raise InvalidValue(f"drives: {len(self.drives)} drives for {len(scenarios)} scenarios")
        self._period = control_period
        self._acceleration = np.array([s.crane.winch.max_acceleration for s in scenarios])

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s that reach φ_H(t + T) at the end of the control step T.

        A command differing by δ from the speed ramps at the winch's acceleration a, and turns the drum by
        δ T - sign(δ) δ²/(2 a) more than the speed alone: solved for δ.
        """
        names = [q.name for q in (STATE if observation.shape[1] == len(STATE) else SENSED)]
        angle = observation[:, names.index("drum_angle")].astype(np.float64)
        speed = observation[:, names.index("drum_speed")].astype(np.float64)
        end = time + self._period
        wanted = np.array([float(d.drive.angle(min(end, d.drive.duration))) for d in self.drives])
        period, a = self._period, self._acceleration
        extra = wanted - angle - speed * period
        root = np.sqrt(np.maximum(0.0, period**2 - 2.0 * np.abs(extra) / a))
        return speed + np.sign(extra) * a * (period - root)
