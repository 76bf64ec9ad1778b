"""The bridge from rows of tensors to rsl_rl, with what training needs on top, as in ``sb3_env``."""

from __future__ import annotations

from typing import Final

import torch
from tensordict import TensorDict

from aframe_env import task
from aframe_env.torch_env import GROUP, AFrameHeaveTorchEnv
from agents.learned.interface import shaped
from agents.learned.tensor_features import TensorFeatures
from train.learn.memory import Memory, into_object, of_object, of_tensors, to_tensors
from train.learn.sb3_env import median_reduction

_OWN: Final = ("_present", "_error_sum", "_still_sum")
"""Tensors of the bridge itself that change from step to step."""


class TrainingRows:
    """Rows of the task for rsl_rl's learners: what ``TrainingVecEnv`` is for those of Stable-Baselines3."""

    num_actions = 1

    def __init__(
        self,
        env: AFrameHeaveTorchEnv,
        features: TensorFeatures,
        *,
        drift_limit: float,
        reward_scale: float,
        reward_knee: float,
    ) -> None:
        """The rows begin at random times of their episode, so that they do not all end at once."""
        self._env, self._features = env, features
        self._drift_limit, self._reward_scale, self._reward_knee = drift_limit, reward_scale, reward_knee
        self.num_envs, self.device, self.cfg = env.num_envs, env.device, env.cfg
        self.max_episode_length = env.max_episode_length
        self.quantities: tuple[task.Quantity, ...] = task.STATE
        self._period = env.cfg.task.control_period
        self._error_sum, self._still_sum = torch.zeros((2, env.num_envs), dtype=torch.float64, device=self.device)
        self.reset()

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """(N,) control steps since each row's start."""
        return self._env.episode_length_buf

    @episode_length_buf.setter
    def episode_length_buf(self, steps: torch.Tensor) -> None:
        self._env.episode_length_buf = steps

    def reset(self) -> TensorDict:
        """Start all rows at random times of their episode."""
        observation = self._env.reset()[GROUP]
        self._present = self._features.look(observation, torch.ones_like(self.episode_length_buf, dtype=torch.bool))
        self.episode_length_buf = torch.randint_like(self.episode_length_buf, high=self.max_episode_length)
        return self.get_observations()

    def get_observations(self) -> TensorDict:
        """Return the present features, (N, F)."""
        return TensorDict({GROUP: self._present}, batch_size=[self.num_envs], device=self.device)

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, torch.Tensor]]:
        """Advance with a network's outputs ``actions`` (N, 1); a row whose load has drifted far off starts anew."""
        commands = self._features.command(actions)
        _, rewards, dones, extras = self._env.step(commands)
        final, cost = extras["final_obs"], -rewards.double()
        self._error_sum += cost
        self._still_sum += final[:, task.PULLEY_HEAVE].double().square() * self._period
        rewards = shaped(torch, cost / self._period, self._reward_scale, self._reward_knee).float()
        drifted = (final[:, task.DEPTH_ERROR].abs() > self._drift_limit) & ~dones
        begun = dones | drifted
        self._present = self._features.look(self._env.reset(drifted)[GROUP], begun)
        return self.get_observations(), rewards, begun, {"time_outs": extras["time_outs"] | drifted}

    def pop_reduction(self) -> float:
        """Median over the rows of the heave reduction since the last call, exploration included."""
        reduction = median_reduction(self._error_sum.cpu().numpy(), self._still_sum.cpu().numpy())
        self._error_sum.zero_()
        self._still_sum.zero_()
        return reduction

    def memory(self) -> Memory:
        """Everything that the rows' rest depends on."""
        memory = of_tensors({name: getattr(self, name) for name in _OWN})
        memory.put("env", of_tensors(self._env.get_state()))
        memory.put("features", of_object(self._features))
        return memory

    def recall(self, memory: Memory) -> None:
        """Put back what ``memory`` told of rows with the same options."""
        for name in _OWN:
            setattr(self, name, torch.from_numpy(memory.arrays[name].copy()).to(self.device))
        self._env.set_state(to_tensors(memory.under("env")))
        into_object(self._features, memory.under("features"))
