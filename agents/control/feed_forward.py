"""Partial feed-forward: the drum takes up a share of the pulley's velocity as it is read, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aframe_env.scenario import Scenario
from aframe_env.task import SENSED, STATE
from agents.control.regulator import Observation
from agents.policy import FloatArray, Knowledge


@dataclass
class PartialFeedForward:
    """Heave compensation as it is first put into service: a gain below one, no filter, no forecast, no feedback."""

    sensors: bool = True
    """Act on the sensors' readings; False: on the full state."""
    gain: float = 0.75
    """Share of the pulley's velocity that the drum takes up."""
    name: str = field(init=False, default="partial feed-forward")
    knows: Knowledge = field(init=False)
    _column: int = field(init=False, repr=False)
    _radius: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.knows = Knowledge.SENSORS if self.sensors else Knowledge.STATE
        names = [quantity.name for quantity in (SENSED if self.sensors else STATE)]
        self._column = names.index("pulley_velocity_z")

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the crane is looked at."""
        self._radius = np.array([each.crane.drum_radius(each.free_length) for each in scenarios])

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, K)."""
        return np.asarray(self.gain * observation[:, self._column].astype(np.float64) / self._radius)
