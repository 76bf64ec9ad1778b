"""The bridge from the native vector environment to Stable-Baselines3, with what training needs on top.

Actions are outputs of the agent's network and observations its inputs (see ``agents.learned.features``); the reward is
the depth error's root mean square over the step in place of its square, so that its gradient does not vanish near zero
and a small sea weighs as much as a large one; an episode is cut, with the value of its last state, where the load has
drifted far off.
None of this is in the environment, and evaluation has none of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.simulation import Simulation
from agents.learned.features import LIMIT, STATE_FEATURES, StateFeatures, features_for
from train.learn.options import LearningOptions

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]


def shaped(xp: Any, mean_square: Any, scale: float, knee: float) -> Any:
    """Rewards (N,) for mean squares of the depth error (N,) m², arrays of ``xp`` = numpy or torch.

    ``scale``: of a metre of root mean square; ``knee`` [m]: beyond it the reward falls with the logarithm only.
    """
    rms = xp.sqrt(xp.clip(mean_square, None, 1e4))
    return -scale * (knee * xp.log1p(rms / knee) if math.isfinite(knee) else rms)


def median_reduction(error_sum: FloatArray, still_sum: FloatArray) -> float:
    """Median over N rows of the heave reduction.

    Integrals (N,) m² s over the same time: of the squared depth error, and of the pulley's squared heave, which stands
    for what the load of a still drum would do.
    """
    moved = still_sum > 0.0
    left = np.sqrt(error_sum[moved] / still_sum[moved])
    return 1.0 - float(np.median(left)) if len(left) else 0.0


class TrainingVecEnv(VecEnv):
    """Rows of the task for a learner: SAME_STEP resets, infos only for the rows that finished."""

    def __init__(
        self,
        rows: int,
        config: TaskConfig,
        *,
        horizon: float,
        drift_limit: float,
        reward_scale: float,
        reward_knee: float = math.inf,
        seed: int,
    ) -> None:
        """``horizon`` [s]: rows start anew after that time; ``drift_limit`` [m]: and where the load is so far off.

        ``reward_knee`` [m]: beyond it the reward falls with the error's logarithm only.
        """
        self._simulation = Simulation(rows, config)
        control_period = self._simulation.control_period
        self._horizon = max(1, round(min(horizon, config.duration) / control_period))
        self._drift_limit = drift_limit
        self._reward_scale = reward_scale
        self._reward_knee = reward_knee
        self._rng = np.random.default_rng(seed)
        self._commands = np.zeros(rows)
        self._no_infos: list[dict[str, Any]] = [{} for _ in range(rows)]
        sensors = config.sensors
        self._features = features_for(rows, control_period, sensors)
        self.actor_inputs = len(self._features.names)
        """Number of features that are the agent's; the rest is for the critics."""
        self._privileged = StateFeatures(rows, control_period) if sensors else None
        inputs = self.actor_inputs + (len(STATE_FEATURES) if self._privileged else 0)
        self._observations = np.zeros((rows, inputs), dtype=np.float32)
        super().__init__(
            rows,
            spaces.Box(-LIMIT, LIMIT, (inputs,), np.float32),
            spaces.Box(-1.0, 1.0, (1,), np.float32),
        )
        self._left = np.zeros(rows, dtype=np.int64)
        self._return = np.zeros(rows)
        self._length = np.zeros(rows, dtype=np.int64)
        self._error_sum, self._still_sum = np.zeros((2, rows))

    @property
    def quantities(self) -> tuple[task.Quantity, ...]:
        """Quantities of the environment's observation."""
        return self._simulation.config.quantities

    def pop_reduction(self) -> float:
        """Median over the rows of the heave reduction since the last call, exploration included."""
        reduction = median_reduction(self._error_sum, self._still_sum)
        self._error_sum[:] = self._still_sum[:] = 0.0
        return reduction

    def reset(self) -> Float32Array:
        """Start all rows at random times of their horizon, so that they do not all end at once."""
        self._restart(np.arange(self.num_envs))
        self._left = self._rng.integers(1, self._horizon + 1, self.num_envs)
        return self._observations.copy()

    def step_async(self, actions: Float32Array) -> None:
        """Take the actions (rows, 1), outputs of the agent's network."""
        self._commands = self._features.command(actions[:, 0].astype(np.float64))

    def step_wait(self):  # type: ignore[no-untyped-def]
        """Advance, and restart the rows that finished."""
        simulation = self._simulation
        simulation.advance(self._commands)
        cost = simulation.results[:, task.COST]
        self._error_sum += cost
        self._still_sum += np.square(simulation.state[:, task.PULLEY_HEAVE]) * simulation.control_period
        rewards = shaped(np, cost / simulation.control_period, self._reward_scale, self._reward_knee)
        self._return += rewards
        self._length += 1
        self._left -= 1
        parted = simulation.results[:, task.PARTED] > 0.0
        drifted = np.abs(simulation.state[:, task.DEPTH_ERROR]) > self._drift_limit
        finished = parted | drifted | (self._left <= 0) | (simulation.steps >= simulation.episode_steps)
        self._look()
        infos = self._no_infos
        if finished.any():
            infos = list(infos)
            rows = np.flatnonzero(finished)
            for i in rows.tolist():
                infos[i] = {
                    "terminal_observation": self._observations[i].copy(),
                    "TimeLimit.truncated": not parted[i],
                    "episode": {"r": float(self._return[i]), "l": int(self._length[i]), "t": 0.0},
                }
            self._restart(rows)
        return self._observations.copy(), rewards.astype(np.float32), finished, infos

    def _restart(self, rows: npt.NDArray[np.int64]) -> None:
        drawn = [self._simulation.draw(self._rng) for _ in rows]
        cranes = [scenario.crane for scenario, _ in drawn]
        self._simulation.reset_rows(rows, drawn)
        self._left[rows] = self._horizon
        self._return[rows] = 0.0
        self._length[rows] = 0
        first = self._features.start(self._simulation.observe()[rows], cranes, rows)
        self._observations[rows, : self.actor_inputs] = first
        if self._privileged:
            state = self._simulation.state[rows].astype(np.float32)
            self._observations[rows, self.actor_inputs :] = self._privileged.start(state, cranes, rows)

    def _look(self) -> None:
        self._observations[:, : self.actor_inputs] = self._features.advance(self._simulation.observe())
        if self._privileged:
            state = self._simulation.state.astype(np.float32)
            self._observations[:, self.actor_inputs :] = self._privileged.advance(state)

    def close(self) -> None:
        """Nothing to close."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Attribute of the bridge, once for each row asked for."""
        return [getattr(self, attr_name, None) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Rows have no attributes of their own to set."""
        raise NotImplementedError("the rows of a native vector environment have no attributes of their own")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Rows have no methods of their own to call."""
        raise NotImplementedError("the rows of a native vector environment have no methods of their own")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Rows have no wrappers."""
        return [False for _ in self._get_indices(indices)]

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the draws of scenarios."""
        self._rng = np.random.default_rng(seed)
        return [seed] * self.num_envs


def make_rows(options: LearningOptions) -> TrainingVecEnv:
    """Rows of the environment for a learner."""
    torch.set_num_threads(options.threads)
    return TrainingVecEnv(
        options.n_envs,
        options.config,
        horizon=options.horizon,
        drift_limit=options.drift_limit,
        reward_scale=options.reward_scale,
        reward_knee=options.reward_knee,
        seed=options.seed,
    )
