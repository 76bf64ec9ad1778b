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

    @property
    def privileged(self) -> bool:
        """Whether a policy that knows this is handed what is; any other is handed what the operator was told."""
        return self is Knowledge.FUTURE


class Policy(Protocol):
    """A policy over a batch of N episodes that run in step."""

    name: str
    knows: Knowledge

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes. Only a policy that knows the future may look at more than the crane.

        ``begin`` calls it, with the scenarios as the operator was told them, or the true ones for a privileged policy.
        """
        ...

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, K) at ``time`` s since the start."""
        ...


def begin(policy: Policy, scenarios: Sequence[Scenario], control_period: float) -> None:
    """Begin N episodes in these true ``scenarios``, of which the policy gets to see what it is allowed to know."""
    known = scenarios if policy.knows.privileged else [scenario.as_told for scenario in scenarios]
    policy.reset(known, control_period)


class DrumStill:
    """Leave the drum alone: the yardstick for heave reduction."""

    name = "drum still"
    knows = Knowledge.NOTHING

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes."""

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Zero for every row."""
        return np.zeros(len(observation))
