"""Policies that were told one scenario and meet another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from aframe_env.task import SENSED, STATE
from agents.policy import FloatArray, Knowledge, Policy, begin

OPEN_LOOP = (Knowledge.NOTHING, Knowledge.CLOCK, Knowledge.FUTURE)


class Misinformed:
    """A policy over N rows of which each was told one of K assumed scenarios.

    Before the lift it is told the assumed scenario, in the observation too (load mass and rope length); its
    measurements are true.
    """

    def __init__(self, policy: Policy, assumed: Sequence[Scenario], which: npt.NDArray[np.intp]) -> None:
        """``which`` (N,) says which of the ``assumed`` scenarios a row was told."""
        self.name, self.knows = policy.name, policy.knows
        self._policy, self._assumed, self._which = policy, assumed, which
        names = [q.name for q in (STATE if policy.knows is Knowledge.STATE else SENSED)]
        self._told_columns = [names.index("load_mass"), names.index("rope_length")]
        self._told = np.array([(s.load_mass, s.free_length) for s in assumed], dtype=np.float32)[which]

    @property
    def _open_loop(self) -> bool:
        """True if the policy uses no measurement: rows that were told the same do the same."""
        return self.knows in OPEN_LOOP

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; the true scenarios are not passed on."""
        told = self._assumed if self._open_loop else [self._assumed[i] for i in self._which.tolist()]
        begin(self._policy, told, control_period)

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s."""
        if self._open_loop:
            return self._policy.act(observation[: len(self._assumed)], time)[self._which]
        observation = observation.copy()
        observation[:, self._told_columns] = self._told
        return self._policy.act(observation, time)
