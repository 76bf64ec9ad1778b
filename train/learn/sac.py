"""SAC of Stable-Baselines3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

from stable_baselines3 import SAC
from torch.optim import Optimizer

from aframe_env.memory import require_memory
from aframe_env.validation import require_integer, require_number
from train.learn.actor_critic import TwoPathSACPolicy
from train.learn.learner import Learner, LearnerSpec, Range, Search
from train.learn.options import LearningOptions
from train.learn.sb3_env import make_rows
from train.learn.share import ShareSACPolicy, slow_down


@dataclass(frozen=True, kw_only=True)
class Options(LearningOptions):
    """Options of the training."""

    timesteps: int = 300_000
    """Control steps to learn from, over all rows."""
    batch_size: int = 256
    """Minibatch."""
    horizon: float = 20.0
    """Rows start a new scenario after this time, s."""
    drift_limit: float = 4.0
    """Depth error at which a row starts anew, m; its last state's value stands for the rest."""
    reward_scale: float = 20.0
    """Reward for a metre of root mean square depth error over a step."""
    critic_hidden: int = 128
    """Units of each hidden layer of the critics."""
    replay: int = 200_000
    """Control steps kept to learn from, over all rows; old ones of a drifting load only do harm."""
    gradient_steps: int = 4
    """Updates for each step of all rows."""
    tau: float = 0.01
    """Share by which the target critics follow at each update."""
    target_entropy: float = -1.0
    """Entropy of an action to aim at, nat: -1 is a standard deviation of 0.09."""
    ent_coef: float = 0.01
    """Entropy's weight at the start."""
    n_steps: int = 1
    """Steps of the return before the critic's estimate."""
    learning_starts: int = 6400
    """Control steps of random actions before the first update."""
    critic_first: int = 0
    """Control steps at the start that the critics learn from alone."""
    log_std_init: float = -2.3
    """Logarithm of the first standard deviation of an action, with ``start_from``."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_integer("critic_hidden", self.critic_hidden, low=1, high=4096)
        require_integer("replay", self.replay, low=self.n_envs, high=10**9)
        require_integer("gradient_steps", self.gradient_steps, low=1, high=10**4)
        require_number("tau", self.tau, "", low=0.0, high=1.0, low_open=True)
        require_number("target_entropy", self.target_entropy, "nat", low=-20.0, high=1.0)
        require_number("ent_coef", self.ent_coef, "", low=0.0, high=1e3, low_open=True)
        require_integer("n_steps", self.n_steps, low=1, high=1000)
        require_integer("learning_starts", self.learning_starts, low=0, high=10**9)
        require_integer("critic_first", self.critic_first, low=0, high=10**9)
        require_number("log_std_init", self.log_std_init, "", low=-20.0, high=2.0)


class CriticFirstSAC(SAC):
    """SAC whose critics learn alone at first: untrained, they would lead an actor astray that has learned already."""

    def __init__(self, critic_first: int, *args: Any, **kwargs: Any) -> None:
        self._critic_first = critic_first
        super().__init__(*args, **kwargs)

    def train(self, gradient_steps: int, batch_size: int = 64) -> None:
        """Update the networks from the replay; at first neither the actor nor the entropy's weight."""
        alone, tuned = self.num_timesteps <= self._critic_first, self.ent_coef_optimizer
        self.actor.requires_grad_(not alone)
        if alone and self.log_ent_coef is not None:
            self.ent_coef_optimizer, self.ent_coef_tensor = None, self.log_ent_coef.detach().exp()
        try:
            super().train(gradient_steps, batch_size)
        finally:
            self.ent_coef_optimizer = tuned

    def _update_learning_rate(self, optimizers: list[Optimizer] | Optimizer) -> None:
        super()._update_learning_rate(optimizers)
        slow_down(optimizers)


def check(options: Options) -> None:
    """Raise where the replay does not fit into memory."""
    kept = options.replay // options.n_envs * options.n_envs
    require_memory(f"--replay {options.replay}", kept * 4 * (2 * options.width + 4))


def build(options: Options) -> Learner:
    """The learner and its rows."""
    rows = make_rows(options)
    start = options.start
    model = CriticFirstSAC(
        options.critic_first,
        TwoPathSACPolicy if start is None else ShareSACPolicy,
        rows,
        learning_rate=options.rate,
        buffer_size=options.replay,
        learning_starts=options.learning_starts,
        batch_size=options.batch_size,
        tau=options.tau,
        gamma=options.gamma,
        train_freq=1,
        gradient_steps=options.gradient_steps,
        n_steps=options.n_steps,
        ent_coef=f"auto_{options.ent_coef}",
        target_entropy=options.target_entropy,
        policy_kwargs={
            "actor_inputs": rows.actor_inputs,
            "hidden": options.hidden,
            "critic_hidden": options.critic_hidden,
            **(
                {}
                if start is None
                else {"network": start.network, "actor_rate": options.actor_rate, "log_std_init": options.log_std_init}
            ),
        },
        seed=options.seed,
        device="cpu",
    )
    policy = model.policy
    assert isinstance(policy, TwoPathSACPolicy)
    return Learner("SAC", model, rows, policy.to_actor)


def _successor(options: Options) -> str | None:
    return None if options.start_from is None else "sac-recurrent"


SPEC: Final = LearnerSpec(
    command="train.sac",
    description="Train a SAC agent to hold the load still, then compare it with the paper's drives.",
    options=Options,
    build=build,
    check=check,
    search=Search(
        {
            "learning_rate": Range(2e-4, 4e-3, logarithmic=True),
            "gamma": Range(0.9, 0.98),
            "tau": Range(0.003, 0.03, logarithmic=True),
            "target_entropy": Range(-4.0, -0.5),
            "drift_limit": Range(1.0, 10.0, logarithmic=True),
        },
        {"gradient_steps": (2, 4, 8), "batch_size": (256, 512, 1024)},
    ),
    successor=_successor,
)
