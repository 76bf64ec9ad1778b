"""SAC that learns on from a recurrent agent: ``python -m train.sac --start-from FOLDER``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

from train.learn import sac
from train.learn.learner import LearnerSpec


@dataclass(frozen=True, kw_only=True)
class Options(sac.Options):
    """Options of the training."""

    observation: Literal["state", "sensors"] = "sensors"
    """Observation of the agent, as that of the one to start from."""
    timesteps: int = 400_000
    """Control steps to learn from, over all rows."""
    practice: int = 400
    """Learn from so many scenarios, in half of which the winch saturates."""
    selected_by: int = 100
    """Give the agent that leaves the least heave in so many scenarios of their own."""
    horizon: float = 60.0
    """Rows start a new scenario after this time, s."""
    learning_rate: float = 3e-4
    """At the start; it falls linearly to a thirtieth."""
    actor_rate: float = 0.03
    """Learning rate of the actor, as a share of the critics'."""
    batch_size: int = 1024
    """Minibatch."""
    gradient_steps: int = 2
    """Updates for each step of all rows."""
    gamma: float = 0.99
    """Discount for a control step: a horizon of ten seconds, as far as the teacher of imitation looks ahead."""
    tau: float = 0.005
    """Share by which the target critics follow at each update."""
    target_entropy: float = -2.0
    """Entropy of an action to aim at, nat: where it is not at its limits, -2 is a standard deviation of 0.04."""
    ent_coef: float = 1e-3
    """Entropy's weight at the start."""
    learning_starts: int = 0
    """Control steps of random actions before the first update: none, for the agent knows what to do."""
    critic_first: int = 100_000
    """Control steps at the start that the critics learn from alone."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_start()


SPEC: Final = LearnerSpec(
    command="train.sac",
    description="Train a recurrent agent on with SAC, then compare it with the paper's drives.",
    options=Options,
    build=sac.build,
    check=sac.check,
)
