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
    hidden: int = 128
    """Units of each hidden layer of the critic."""


SPEC: Final = LearnerSpec(
    command="train.ppo",
    description="Train a recurrent agent on with PPO, then compare it with the paper's drives.",
    options=Options,
    build=ppo.build,
    check=ppo.check,
)
