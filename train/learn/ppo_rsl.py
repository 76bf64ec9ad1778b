"""PPO from rsl_rl on rows that live on the GPU, and what it learns from: ``python -m train.ppo --device cuda``.

Environment, features, rewards and learner stay on the device. ``python -m train.gpu_ppo --device cpu`` runs the same on
the processor, to be tried where there is no GPU.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import torch
from rsl_rl.algorithms import PPO
from rsl_rl.models import MLPModel
from rsl_rl.storage import RolloutStorage
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from tensordict import TensorDict
from torch import nn

from aframe_env.cuda.device import open_device
from aframe_env.scenario import ScenarioDistribution
from aframe_env.torch_env import GROUP, AFrameHeaveTorchEnv
from aframe_env.validation import InvalidValue, require_integer
from agents.learned.network import Actor
from agents.learned.tensor_features import TensorFeatures
from train.learn import ppo
from train.learn.actor_critic import ActorLatent, CriticLatent, actor_of
from train.learn.learner import Learner, LearnerSpec
from train.learn.memory import (
    Memory,
    into_optimizer,
    into_torch_generators,
    of_optimizer,
    of_tensors,
    of_torch_generators,
    to_tensors,
)
from train.learn.rsl_env import TrainingRows

_GROUPS: Final = {"actor": [GROUP], "critic": [GROUP]}


@dataclass(frozen=True, kw_only=True)
class Options(ppo.Options):
    """Options of the training."""

    device: Literal["cpu", "cuda"] = "cuda"
    """Device of environment and learner."""
    timesteps: int = 20_000_000
    """Control steps to learn from, over all rows."""
    n_envs: int = 4096
    """Rows of the environment."""
    n_steps: int = 16
    """Steps of each row between two updates."""
    batch_size: int = 16_384
    """Minibatch."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.observation != "state":
            raise InvalidValue(f"observation = {self.observation!r}: must be 'state' with rows on a GPU")
        if self.action == "predictive" or self.practice:
            raise InvalidValue(f"action = {self.action!r}, practice = {self.practice}: not with rows on a GPU")
        if self.start_from is not None:
            raise InvalidValue(f"start_from = {str(self.start_from)!r}: not with rows on a GPU")
        require_integer("batch_size", self.batch_size, low=2, high=self.n_steps * self.n_envs)


class TwoPathModel(MLPModel):  # type: ignore[misc]
    """rsl_rl's model with a latent of ours and a linear layer for its network."""

    def __init__(
        self,
        observations: TensorDict,
        kind: Literal["actor", "critic"],
        latent: nn.Module,
        head: nn.Linear,
        **rest: Any,
    ) -> None:
        super().__init__(observations, _GROUPS, kind, 1, hidden_dims=(1,), **rest)
        for layer in latent.modules():
            if isinstance(layer, nn.Linear):
                _initialise(layer, math.sqrt(2.0))
        _initialise(head, 0.01 if kind == "actor" else 1.0)
        self.mlp = nn.Sequential(latent, head)


def _initialise(layer: nn.Linear, gain: float) -> None:
    nn.init.orthogonal_(layer.weight, gain)
    nn.init.zeros_(layer.bias)


class RslPPO:
    """rsl_rl's PPO, driven as a learner of Stable-Baselines3 is."""

    def __init__(self, rows: TrainingRows, options: Options) -> None:
        self.num_timesteps = 0
        self.env, self._options = rows, options
        self._logger: Logger | None = None
        observations = rows.get_observations()
        inputs, hidden = observations[GROUP].shape[1], options.hidden
        self._latent, self._head = ActorLatent(inputs, hidden), nn.Linear(inputs + hidden, 1)
        distribution = {
            "class_name": "GaussianDistribution",
            "init_std": math.exp(options.log_std_init),
            "std_type": "log",
        }
        self._learner = PPO(
            TwoPathModel(observations, "actor", self._latent, self._head, distribution_cfg=distribution),
            TwoPathModel(observations, "critic", CriticLatent(inputs, hidden), nn.Linear(2 * inputs + hidden, 1)),
            RolloutStorage("rl", rows.num_envs, options.n_steps, observations, (1,), str(rows.device)),
            num_learning_epochs=options.n_epochs,
            num_mini_batches=max(1, options.n_steps * options.n_envs // options.batch_size),
            clip_param=options.clip_range,
            gamma=options.gamma,
            lam=options.gae_lambda,
            value_loss_coef=0.5,
            entropy_coef=0.0,
            learning_rate=options.learning_rate,
            max_grad_norm=0.5,
            use_clipped_value_loss=False,
            schedule="fixed",
            normalize_advantage_per_mini_batch=True,
            device=str(rows.device),
        )

    @property
    def logger(self) -> Logger:
        """Logger of the figures."""
        assert self._logger is not None
        return self._logger

    def set_logger(self, logger: Logger) -> None:
        """Say where figures go."""
        self._logger = logger

    def learn(self, total_timesteps: int, callback: BaseCallback | None = None) -> None:
        """Learn from so many control steps, over all rows."""
        begin = time.perf_counter()
        observations = self.env.get_observations()
        if callback:
            callback.init_callback(self)  # type: ignore[arg-type]
            callback.on_training_start({}, {})
        while self.num_timesteps < total_timesteps:
            self._set_rate(self._options.rate(1.0 - self.num_timesteps / total_timesteps))
            if callback:
                callback.on_rollout_start()
            with torch.inference_mode():
                for _ in range(self._options.n_steps):
                    observations, rewards, dones, extras = self.env.step(self._learner.act(observations))
                    self._learner.process_env_step(observations, rewards, dones, extras)
                    self.num_timesteps += self.env.num_envs
                    if callback and not callback.on_step():
                        return
                self._learner.compute_returns(observations)
            if callback:
                callback.on_rollout_end()
            losses = self.train()
            if self._logger:
                self._record(losses, time.perf_counter() - begin)
        if callback:
            callback.on_training_end()

    def train(self) -> Mapping[str, float]:
        """Update the networks from what was collected; return the losses."""
        losses: Mapping[str, float] = self._learner.update()
        return losses

    def to_actor(self) -> Actor:
        """Return the mean action as a plain network of its own, on the processor."""
        return actor_of(self._latent, self._head.state_dict(), squashed=False)

    def memory(self) -> Memory:
        """Everything that the rest of the learning depends on, between two rollouts."""
        learner, memory = self._learner, Memory(values={"num_timesteps": self.num_timesteps})
        memory.put("actor", of_tensors(learner.actor.state_dict()))
        memory.put("critic", of_tensors(learner.critic.state_dict()))
        memory.put("optimizer", of_optimizer(learner.optimizer))
        memory.put("generators", of_torch_generators(self.env.device))
        return memory

    def recall(self, memory: Memory) -> None:
        """Put back what ``memory`` told of a learner with the same options; its ``learn`` then goes on."""
        learner, self.num_timesteps = self._learner, memory.values["num_timesteps"]
        learner.actor.load_state_dict(to_tensors(memory.under("actor")))
        learner.critic.load_state_dict(to_tensors(memory.under("critic")))
        into_optimizer(learner.optimizer, memory.under("optimizer"))
        into_torch_generators(self.env.device, memory.under("generators"))

    def _set_rate(self, rate: float) -> None:
        self._learner.learning_rate = rate
        for group in self._learner.optimizer.param_groups:
            group["lr"] = rate

    def _record(self, losses: Mapping[str, float], seconds: float) -> None:
        for name, value in losses.items():
            self.logger.record(f"train/{name}", value)
        self.logger.record("train/learning_rate", self._learner.learning_rate)
        self.logger.record("time/seconds", seconds)
        self.logger.record("time/total_timesteps", self.num_timesteps)
        self.logger.dump(self.num_timesteps)


def build(options: Options) -> Learner:
    """The learner and its rows."""
    torch.manual_seed(options.seed)
    torch.set_num_threads(options.threads)
    config = options.config.replaced(episode_duration=options.horizon)
    env = AFrameHeaveTorchEnv(options.n_envs, config, device=options.device, seed=options.seed)
    rows = TrainingRows(
        env,
        TensorFeatures(
            env.num_envs, config.nominal.as_told.crane, options.features, env.device, cuda=options.device == "cuda"
        ),
        drift_limit=options.drift_limit,
        reward_scale=options.reward_scale,
        reward_knee=options.reward_knee,
    )
    model = RslPPO(rows, options)
    return Learner("PPO", model, rows, model.to_actor)


def check(options: Options) -> None:
    """Raise unless there is the device that is asked for, and the ropes are such as it takes."""
    options.config.nominal.require_light("features of tensors")
    if isinstance(options.config.source, ScenarioDistribution):
        options.config.source.require_known_crane("features of tensors")
    if options.device == "cuda":
        open_device("cuda")


SPEC: Final = LearnerSpec(
    command="train.gpu_ppo",
    description="Train a PPO agent of rsl_rl on rows of tensors, then compare it with the paper's drives.",
    options=Options,
    build=build,
    check=check,
)
