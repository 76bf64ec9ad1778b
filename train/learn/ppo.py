"""PPO of Stable-Baselines3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

from stable_baselines3 import PPO
from torch import nn
from torch.optim import Optimizer

from aframe_env.memory import require_memory
from aframe_env.validation import require_choice, require_integer, require_number
from train.learn.actor_critic import TwoPathPolicy
from train.learn.learner import Learner, LearnerSpec, Range, Search
from train.learn.options import LearningOptions
from train.learn.sb3_env import make_rows
from train.learn.share import SharePolicy, slow_down


@dataclass(frozen=True, kw_only=True)
class Options(LearningOptions):
    """Options of the training; the defaults are a trial of results/tune-ppo, rounded."""

    device: Literal["cpu", "cuda"] = "cpu"
    """cuda: environment and learner on the GPU (extra ``cuda``), with defaults of their own: see ``train.gpu_ppo``."""
    batch_size: int = 2048
    """Minibatch."""
    learning_rate: float = 1.8e-3
    """At the start; it falls linearly to a thirtieth."""
    gamma: float = 0.94
    """Discount for a control step: a horizon of 1.6 seconds."""
    n_steps: int = 128
    """Steps of each row between two updates."""
    n_epochs: int = 10
    """Passes over the data of an update."""
    gae_lambda: float = 0.97
    """λ of the generalised advantage estimate."""
    clip_range: float = 0.3
    """PPO's clipping."""
    log_std_init: float = -1.65
    """Logarithm of the first standard deviation of an action."""
    critic_first: int = 0
    """Updates at the start that the critic learns from alone."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_choice("device", self.device, ("cpu", "cuda"))
        require_integer("n_steps", self.n_steps, low=2, high=10**6)
        if self.device == "cpu":  # for "cuda" they are read anew, with the defaults of train.learn.ppo_rsl
            require_integer("batch_size", self.batch_size, low=2, high=self.n_steps * self.n_envs)
        require_integer("n_epochs", self.n_epochs, low=1, high=1000)
        require_number("gae_lambda", self.gae_lambda, "", low=0.0, high=1.0)
        require_number("clip_range", self.clip_range, "", low=0.0, high=1.0, low_open=True)
        require_integer("critic_first", self.critic_first, low=0, high=10**6)
        require_number("log_std_init", self.log_std_init, "", low=-20.0, high=2.0)


class CriticFirstPPO(PPO):
    """PPO whose critic learns alone at first: it has everything to learn where the actor has not."""

    def __init__(self, critic_first: int, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self._critic_first = critic_first

    def train(self) -> None:
        """Update the networks from what was collected; in the first updates the critic only."""
        update = self.num_timesteps // (self.n_steps * self.n_envs)
        policy = self.policy
        assert isinstance(policy, TwoPathPolicy)
        policy.freeze_actor(update <= self._critic_first)
        super().train()

    def _update_learning_rate(self, optimizers: list[Optimizer] | Optimizer) -> None:
        super()._update_learning_rate(optimizers)
        slow_down(optimizers)


def check(options: Options) -> None:
    """Raise where a rollout does not fit into memory."""
    kept = options.n_steps * options.n_envs
    require_memory(f"--n-steps {options.n_steps} of --n-envs {options.n_envs}", 4 * kept * (options.width + 7))


def build(options: Options) -> Learner:
    """The learner and its rows."""
    rows = make_rows(options)
    start = options.start
    model = CriticFirstPPO(
        options.critic_first,
        TwoPathPolicy if start is None else SharePolicy,
        rows,
        n_steps=options.n_steps,
        batch_size=options.batch_size,
        n_epochs=options.n_epochs,
        learning_rate=options.rate,
        gamma=options.gamma,
        gae_lambda=options.gae_lambda,
        clip_range=options.clip_range,
        policy_kwargs={
            "actor_inputs": rows.actor_inputs,
            "hidden": options.hidden,
            "log_std_init": options.log_std_init,
            **({} if start is None else {"network": start.network, "actor_rate": options.actor_rate}),
        },
        seed=options.seed,
        device="cpu",
    )
    policy = model.policy
    assert isinstance(policy, TwoPathPolicy)
    if options.action == "predictive":
        # Its base is hard to better: begin with just that, not beside it by what random weights add.
        nn.init.zeros_(policy.action_net.weight)  # type: ignore[arg-type]
    return Learner("PPO", model, rows, policy.to_actor)


def _successor(options: Options) -> str | None:
    if options.device == "cuda":
        return "ppo-rsl"
    if options.start_from is not None:
        return "ppo-recurrent"
    return "ppo-predictive" if options.action == "predictive" else None


SPEC: Final = LearnerSpec(
    command="train.ppo",
    description="Train a PPO agent to hold the load still, then compare it with the paper's drives.",
    options=Options,
    build=build,
    check=check,
    search=Search(
        {
            "learning_rate": Range(2e-4, 4e-3, logarithmic=True),
            "gamma": Range(0.9, 0.98),
            "gae_lambda": Range(0.8, 0.98),
            "clip_range": Range(0.1, 0.4),
            "log_std_init": Range(-2.5, -0.5),
            "reward_knee": Range(0.005, 0.2, logarithmic=True),
        },
        {"n_steps": (32, 64, 128), "n_epochs": (5, 10, 15), "batch_size": (512, 1024, 2048)},
    ),
    successor=_successor,
)
