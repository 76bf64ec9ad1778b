"""The task as a learner meets it: the agents' features, their action, the training's reward, and where it is cut.

The features and the action are those of every learned agent (see ``agents.learned.features``); the reward is the depth
error's root mean square over the step in place of its square, so that its gradient does not vanish near zero and a
small sea weighs as much as a large one; an episode is cut, with the value of its last state, where the load has
drifted far off. None of this is in the environment, and evaluation has none of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.validation import require_choice, require_known, require_number
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.lowering import moves
from agents.control.regulator import Observation
from agents.learned.feature_sets import features_for
from agents.learned.features import STATE_FEATURES, Action, FeatureConfig, require_action
from agents.learned.following import FollowingFeatures
from agents.learned.recurrent_features import RecurrentFeatures

Float32Array = npt.NDArray[np.float32]

REWARDS: Final = ("training", "task")


@dataclass(frozen=True, kw_only=True)
class InterfaceConfig:
    """What a learner's rows have on top of the environment; the defaults are those of the shipped agents' training."""

    action: Action = "residual"
    """As in ``FeatureConfig``."""
    reward: Literal["training", "task"] = "training"
    """"training": minus the root mean square of the depth error over the step, see ``shaped``; "task": the
    environment's own, minus the integral of its square, m² s."""
    reward_scale: float = 1.0
    """Training reward for a metre of root mean square depth error over a step, 1/m."""
    reward_knee: float = 0.05
    """Depth error beyond which the training reward falls with its logarithm only, m; infinite for none. What is learned
    would otherwise be spent on the few loads that drift far off, not on the last centimetres of all others."""
    drift_limit: float = 10.0
    """Depth error at which an episode is truncated, m; infinite for none."""
    horizon: float = 30.0
    """An episode is truncated after this time, s, or with the environment's own, if that is shorter; infinite for
    none."""
    winch: bool = False
    """As in ``FeatureConfig``."""
    adapts: bool = False
    """As in ``FeatureConfig``."""
    privileged: bool = False
    """Append, where sensors are observed, the features of the full state, for critics alone."""

    def __post_init__(self) -> None:
        require_action(self.action, self.winch, self.adapts)
        require_choice("reward", self.reward, REWARDS)
        require_number("reward_scale", self.reward_scale, "1/m", low=0.0, high=1e6, low_open=True)
        if self.reward_knee != math.inf:
            require_number("reward_knee", self.reward_knee, "m", low=0.0, high=1e3, low_open=True)
        if self.drift_limit != math.inf:
            require_number("drift_limit", self.drift_limit, "m", low=0.0, high=1e3, low_open=True)
        if self.horizon != math.inf:
            require_number("horizon", self.horizon, "s", low=0.0, high=1e6, low_open=True)

    def rewards(self, cost: FloatArray, control_period: float) -> FloatArray:
        """Rewards (N,) for the integrals of the squared depth error over a control step, ``cost`` (N,) m² s."""
        if self.reward == "task":
            return -cost
        return np.asarray(shaped(np, cost / control_period, self.reward_scale, self.reward_knee))


def interface_config(config: InterfaceConfig | None, arguments: Mapping[str, Any]) -> InterfaceConfig:
    """Return the ``config``, or the default one, but for these fields."""
    require_known(arguments, InterfaceConfig.__dataclass_fields__)
    return replace(config or InterfaceConfig(), **arguments)


def shaped(xp: Any, mean_square: Any, scale: float, knee: float) -> Any:
    """Rewards (N,) for mean squares of the depth error (N,) m², arrays of ``xp`` = numpy or torch.

    ``scale``: of a metre of root mean square; ``knee`` [m]: beyond it the reward falls with the logarithm only.
    """
    rms = xp.sqrt(xp.clip(mean_square, None, 1e4))
    return -scale * (knee * xp.log1p(rms / knee) if math.isfinite(knee) else rms)


class LearnerFeatures:
    """Features of N rows as a learner observes them: the agent's, then those that are for critics alone."""

    def __init__(
        self,
        rows: int,
        config: FeatureConfig,
        *,
        privileged: bool,
        follow: bool = False,
        agents: RecurrentFeatures | None = None,
    ) -> None:
        """``privileged``: as in ``InterfaceConfig``; ``follow``: targets and frames that move.

        ``agents``: the agent's features, in the place of the config's.
        """
        make = FollowingFeatures if follow else features_for
        self._features = agents or make(rows, config)
        self._privileged = (
            make(rows, replace(config, sensors=None, action="residual", winch=False, adapts=False))
            if privileged and config.sensors
            else None
        )
        self.actor_inputs = len(self._features.names)
        """Number of features that are the agent's, the first ones."""
        self.names: tuple[str, ...] = self._features.names
        """Names of all features; those for critics begin with "true_"."""
        if self._privileged:
            self.names += tuple(f"true_{name}" for name in STATE_FEATURES)
        self.values = np.zeros((rows, len(self.names)), dtype=np.float32)
        """The present features (N, F), in place."""

    @classmethod
    def of(cls, task: TaskConfig, rows: int, config: InterfaceConfig) -> LearnerFeatures:
        """For so many rows of a task; where its target or frame moves they are followed, as by an agent's policy."""
        made_for = FeatureConfig.of(task, config.action, winch=config.winch, adapts=config.adapts)
        return cls(rows, made_for, privileged=config.privileged, follow=moves(task.nominal))

    def start(
        self, observation: Observation, state: FloatArray, scenarios: Sequence[Scenario], rows: Rows = ALL
    ) -> None:
        """Begin episodes in these ``rows`` of n, from observations (n, K) and full states (n, 14).

        The agent's features are for the scenarios as told, those for critics for the true ones.
        """
        told = [scenario.as_told for scenario in scenarios]
        self.values[rows, : self.actor_inputs] = self._features.start(observation, told, rows)
        if self._privileged:
            seen = state.astype(np.float32)
            self.values[rows, self.actor_inputs :] = self._privileged.start(seen, scenarios, rows)

    def advance(self, observation: Observation, state: FloatArray) -> None:
        """Take the observations (N, K) and full states (N, 14) of all rows, one control step later."""
        self.values[:, : self.actor_inputs] = self._features.advance(observation)
        if self._privileged:
            self.values[:, self.actor_inputs :] = self._privileged.advance(state.astype(np.float32))

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), in [-1, 1]."""
        return self._features.command(output)


class Cuts:
    """Times at which episodes of N rows are truncated for the learner's sake alone."""

    def __init__(self, rows: int, control_period: float, duration: float, config: InterfaceConfig) -> None:
        """``duration`` of the environment's episodes, s."""
        self.horizon = max(1, round(min(config.horizon, duration) / control_period))
        """Control steps of an episode, at most."""
        self.left = np.full(rows, self.horizon, dtype=np.int64)
        """Control steps that each row has left, (N,)."""
        self._drift_limit = config.drift_limit

    def start(self, rows: Rows) -> None:
        """Begin episodes in these rows."""
        self.left[rows] = self.horizon

    def advance(self, depth_error: FloatArray) -> npt.NDArray[np.bool_]:
        """Rows (N,) bool to truncate now that another control step has led to these depth errors (N,) m."""
        self.left -= 1
        return np.asarray((np.abs(depth_error) > self._drift_limit) | (self.left <= 0))
