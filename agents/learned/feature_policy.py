"""Policies that act on the agents' features, whatever turns these into an output."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane
from aframe_env.task import SENSED, STATE
from aframe_env.validation import InvalidValue, require_numbers
from agents.learned.feature_sets import features_for
from agents.learned.features import FeatureConfig, Features
from agents.learned.plan_features import PlanFeatures
from agents.policy import FloatArray, Knowledge

Float32Array = npt.NDArray[np.float32]


class OnFeatures(ABC):
    """A policy on the agents' features, with their memory of N episodes that run in step."""

    name: str
    knows: Knowledge

    def __init__(self, name: str, config: FeatureConfig) -> None:
        self.name = name
        self.knows = Knowledge.SENSORS if config.sensors else Knowledge.STATE
        self._config = config
        self._features: Features | PlanFeatures | None = None
        self._cranes: Sequence[Crane] = ()

    @abstractmethod
    def _output(self, inputs: Float32Array) -> FloatArray:
        """Outputs (N,), in [-1, 1], for features (N, F)."""

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios the policy looks at the crane alone."""
        trained = self._config.control_period
        if abs(control_period - trained) > 1e-9:
            raise InvalidValue(f"control_period = {control_period} s: the agent was trained for {trained} s")
        self._cranes = [scenario.crane for scenario in scenarios]
        self._features = None

    def act(self, observation: Float32Array, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s; the first call since the last reset begins the features' memory."""
        if self._features is None:
            self._features = features_for(len(observation), self._config)
            inputs = self._features.start(observation, self._cranes)
        else:
            inputs = self._features.advance(observation)
        return self._features.command(self._output(inputs))

    def predict(self, observation: Float32Array, *, first: bool = False, crane: Crane | None = None) -> Float32Array:
        """Action (1,) rad/s for one observation (K,) of the environment.

        ``first``: an episode's first one, with that ``crane`` (the reference crane by default).
        """
        if first or self._features is None:
            self._features, self._cranes = None, [crane or Crane()]
        quantities, name = (SENSED, "sensors") if self._config.sensors else (STATE, "state")
        if observation.shape != (len(quantities),):
            raise InvalidValue(
                f"observation of shape {observation.shape}: must be ({len(quantities)},), "
                f'the environment\'s observation="{name}"'
            )
        return self.act(observation[None], 0.0).astype(np.float32)


class FeaturePolicy(OnFeatures):
    """A function of the agents' features as a policy, as one that was trained behind ``AgentInterface`` is."""

    def __init__(
        self,
        function: Callable[[Float32Array], Any],
        config: FeatureConfig | None = None,
        *,
        name: str = "on features",
    ) -> None:
        """``function``: features (N, F) → outputs (N,) or (N, 1), clipped to [-1, 1].

        ``config``: what the features are made for; by default the full state of the default task.
        """
        super().__init__(name, config or FeatureConfig())
        self._function = function

    def _output(self, inputs: Float32Array) -> FloatArray:
        output = require_numbers("output", self._function(inputs), "one for each row of features")
        if output.shape == (len(inputs), 1):
            output = output[:, 0]
        if output.shape != (len(inputs),):
            raise InvalidValue(f"{self.name} gave shape {output.shape}: must be ({len(inputs)},), one output a row")
        if not np.isfinite(output).all():
            raise InvalidValue(f"{self.name} gave an output that is not finite: must be in [-1, 1]")
        return output
