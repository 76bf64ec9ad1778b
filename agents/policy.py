"""Interface of every policy: drum speed commands for a batch of episodes, and a statement of its knowledge."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Protocol

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario

FloatArray = npt.NDArray[np.float64]


class Knowledge(Enum):
    """Knowledge that a policy is allowed. A privileged one is never put beside another without saying so."""

    NOTHING = "nothing"
    CLOCK = "clock"
    """The time since the start, and the drum's own encoder."""
    SENSORS = "sensors"
    STATE = "full state"
    FUTURE = "whole future (privileged)"


class Policy(Protocol):
    """A policy over a batch of N episodes that run in step."""

    name: str
    knows: Knowledge

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes. Only a policy that knows the future may look at more than the crane."""
        ...

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, K) at ``time`` s since the start."""
        ...


class DrumStill:
    """Leave the drum alone: the yardstick for heave reduction."""

    name = "drum still"
    knows = Knowledge.NOTHING

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes."""

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Zero for every row."""
        return np.zeros(len(observation))
