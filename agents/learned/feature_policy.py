"""Policies that act on the agents' features, whatever turns these into an output."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.water import LoadShape, Water
from aframe_env.task import SENSED, STATE
from aframe_env.validation import InvalidValue, require_numbers
from agents.control.lift import Lift
from agents.control.regulator import readable
from agents.learned.feature_sets import features_for
from agents.learned.features import FeatureConfig, Features
from agents.learned.plan_features import PlanFeatures
from agents.policy import FloatArray, Knowledge

Float32Array = npt.NDArray[np.float32]


class OnFeatures(ABC):
    """A policy on the agents' features, with their memory of N episodes that run in step."""

    name: str
    knows: Knowledge
    crane: Crane
    """The crane whose winch and rope ``predict`` reckons with; the reference crane, unless you set another."""
    water: Water | None
    """The water that ``predict`` reckons with; none, unless you set one."""
    load: LoadShape
    """The load's shape in that water."""

    def __init__(self, name: str, config: FeatureConfig) -> None:
        self.name = name
        self.knows = Knowledge.SENSORS if config.sensors else Knowledge.STATE
        self.crane, self.water, self.load = Crane(), None, LoadShape()
        self._config = config
        self._features: Features | PlanFeatures | None = None
        self._lifts: Sequence[Lift] = ()

    @abstractmethod
    def _output(self, inputs: Float32Array) -> FloatArray:
        """Outputs (N,), in [-1, 1], for features (N, F)."""

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios the policy looks at what a ``Lift`` has alone."""
        trained = self._config.control_period
        if abs(control_period - trained) > 1e-9:
            raise InvalidValue(f"control_period = {control_period} s: the agent was trained for {trained} s")
        self._lifts, self._features = scenarios, None

    def act(self, observation: Float32Array, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s; the first call since the last reset begins the features' memory."""
        if self._features is None:
            self._features = features_for(len(observation), self._config)
            inputs = self._features.start(observation, self._lifts)
        else:
            inputs = self._features.advance(observation)
        return self._features.command(self._finite_output(inputs))

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        if self._features is not None:
            self._features.retune(rope_length, growth, wet)

    def overrule(self, command: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Look on while somebody else gives the commands (N,) rad/s in place of those of the last ``act``.

        Return the drums' speeds (N,) rad/s at the end of the control step under the policy's, and under these.
        """
        if not isinstance(self._features, Features):
            raise InvalidValue(f"{self.name}: has asked for no speed that could be overruled; call act() first")
        return self._features.overrule(command)

    def predict(
        self,
        observation: npt.NDArray[Any] | dict[str, npt.NDArray[Any]],
        state: Any = None,
        episode_start: npt.NDArray[Any] | bool | None = None,
        deterministic: bool = True,
    ) -> tuple[Float32Array, Any]:
        """Return actions, rad/s, and the memory for the next call, as models of Stable-Baselines3 do.

        ``observation``: of the environment, (K,) or (N, K); the actions are (1,) or (N, 1). ``state``: the memory that
        the last call returned, which stays as it is; None where all rows begin an episode. ``episode_start``: rows that
        begin one now, (N,) bool. ``deterministic`` has no effect: these policies have no spread.
        """
        checked = self._checked(observation)
        rows = np.atleast_2d(checked)
        count = len(rows)
        if state is None:
            memory = features_for(count, self._config)
            inputs = memory.start(rows, [self] * count)
        else:
            known = isinstance(state, Features | PlanFeatures)
            if not known or state.rows != count:
                what = f"a memory of {state.rows}" if known else repr(state)
                raise InvalidValue(
                    f"state = {what}: must be what the last predict() of {count} rows returned, or None at the start"
                )
            memory = deepcopy(state)
            inputs = memory.advance(rows)
            begun = np.flatnonzero(_starts(episode_start, count))
            if len(begun):
                inputs[begun] = memory.start(rows[begun], [self] * len(begun), begun)
        actions = memory.command(self._finite_output(inputs)).astype(np.float32)[:, None]
        return (actions[0] if checked.ndim == 1 else actions), memory

    def _finite_output(self, inputs: Float32Array) -> FloatArray:
        output = self._output(inputs)
        if not np.isfinite(output).all():
            raise InvalidValue(f"{self.name} gave an output that is not finite: must be in [-1, 1]")
        return output

    def _checked(self, observation: Any) -> Float32Array:
        """The observation, (K,) or (N, K). Raises InvalidValue where it is neither."""
        quantities, name = (SENSED, "sensors") if self._config.sensors else (STATE, "state")
        width = len(quantities)
        values = require_numbers("observation", observation, f"({width},) or (N, {width})")
        if values.ndim not in (1, 2) or not readable(values.shape[-1], width):
            raise InvalidValue(
                f"observation of shape {values.shape}: must be ({width},) or (N, {width}), "
                f'the environment\'s observation="{name}"'
            )
        return values.astype(np.float32)


def _starts(episode_start: Any, count: int) -> npt.NDArray[np.bool_]:
    """Rows (N,) that begin an episode."""
    starts = np.asarray(False if episode_start is None else episode_start, dtype=np.bool_)
    if starts.shape not in ((), (count,)):
        raise InvalidValue(f"episode_start of shape {starts.shape}: must be ({count},), one for each observation")
    return np.broadcast_to(starts, count)


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
        return output
