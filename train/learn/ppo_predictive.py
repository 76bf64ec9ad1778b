"""PPO that corrects predictive control: ``python -m train.ppo --action predictive``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from agents.learned.features import Action
from train.learn import ppo
from train.learn.learner import LearnerSpec


@dataclass(frozen=True, kw_only=True)
class Options(ppo.Options):
    """Options of the training."""

    action: Action = "predictive"
    """As for the other agents."""
    timesteps: int = 1_500_000
    """Control steps to learn from, over all rows."""
    practice: int = 400
    """Learn from so many scenarios, in half of which the winch saturates."""
    selected_by: int = 100
    """Give the agent that leaves the least heave in so many scenarios of their own."""
    n_envs: int = 256
    """Rows of the environment."""
    n_steps: int = 64
    """Steps of each row between two updates."""
    learning_rate: float = 3e-4
    """At the start; it falls linearly to a thirtieth."""
    gamma: float = 0.97
    """Discount for a control step: a horizon of three seconds."""
    horizon: float = 60.0
    """Rows start a new scenario after this time, s."""
    n_epochs: int = 8
    """Passes over the data of an update."""
    gae_lambda: float = 0.95
    """λ of the generalised advantage estimate."""
    clip_range: float = 0.2
    """PPO's clipping."""
    log_std_init: float = -2.3
    """Logarithm of the first standard deviation of an action."""
    critic_first: int = 6
    """Updates at the start that the critic learns from alone."""


SPEC: Final = LearnerSpec(
    command="train.ppo",
    description="Train a PPO agent to correct predictive control, then compare it with the paper's drives.",
    options=Options,
    build=ppo.build,
    check=ppo.check,
)
