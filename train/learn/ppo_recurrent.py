"""PPO that learns on from a recurrent agent: ``python -m train.ppo --start-from FOLDER``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from train.learn import ppo, ppo_predictive
from train.learn.learner import LearnerSpec


@dataclass(frozen=True, kw_only=True)
class Options(ppo_predictive.Options):
    """Options of the training: those of the other agent whose start is hard to better."""

    action: Literal["residual"] = "residual"
    """Left out: the agent to start from has one of its own."""
    observation: Literal["state", "sensors"] = "sensors"
    """Observation of the agent, as that of the one to start from."""
    timesteps: int = 3_000_000
    """Control steps to learn from, over all rows."""
    n_steps: int = 128
    """Steps of each row between two updates."""
    batch_size: int = 8192
    """Minibatch."""
    n_epochs: int = 5
    """Passes over the data of an update."""
    actor_rate: float = 0.1
    """Learning rate of the actor, as a share of the critic's: at the critic's, what it knows is lost in a few
    updates."""
    log_std_init: float = -1.9
    """Logarithm of the first standard deviation of an action."""
    gamma: float = 0.99
    """Discount for a control step: a horizon of ten seconds, as far as the teacher of imitation looks ahead."""
    gae_lambda: float = 0.97
    """λ of the generalised advantage estimate."""
    hidden: int = 128
    """Units of each hidden layer of the critic."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_start()


SPEC: Final = LearnerSpec(
    command="train.ppo",
    description="Train a recurrent agent on with PPO, then compare it with the paper's drives.",
    options=Options,
    build=ppo.build,
    check=ppo.check,
)
