"""Options of ``python -m train.apg``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, Literal

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.scenario.series import drawn_scenarios
from aframe_env.suite import Task, find_task
from aframe_env.validation import require_choice, require_integer, require_number
from train.shared.run_folder import RunOptions

VALIDATION_SEED: Final = 8_100_001
"""Seed of the scenarios that agents are chosen by where there is no task, which has its own."""
TRAINING_SEED: Final = 8_200_000
"""The first of the seeds of the scenarios that are learned from, one for each agent's."""


@dataclass(frozen=True, kw_only=True)
class ApgOptions(RunOptions):
    """Options of a training."""

    task: str | None = "Storm"
    """Task of the suite to learn, by name; None for the package's seas."""
    observation: Literal["state", "sensors"] = "sensors"
    """Observation of the agent."""
    seed: int = 0
    """Seeds everything; the same seed gives the same agent."""
    seeds: int = 1
    """Train so many agents, with seeds one after another, each in a folder of its own."""
    episodes: int = 2000
    """Scenarios that are recorded with the real engine, and learned from."""
    memory: int = 96
    """Units of the GRU."""
    hidden: int = 128
    """Units of each hidden layer of the perceptron."""
    forecaster_steps: int = 250
    """Steps of the forecaster's training, each on ``forecaster_batch`` episodes."""
    forecaster_batch: int = 64
    """Episodes."""
    forecaster_rate: float = 2e-3
    """Learning rate of the forecaster at the start. Each of these rates falls linearly to a thirtieth in its stage."""
    rounds: int = 2
    """Rounds of imitation: the first in the states that the untrained network visits, which is a regulator, each
    further one (DAgger) in those that the network visits that was taught before."""
    labels: int = 300_000
    """States in each round that the teacher is asked about."""
    imitation_steps: int = 3000
    """Steps of each round, each on ``imitation_batch`` states of all rounds so far."""
    imitation_batch: int = 4096
    """States."""
    imitation_rate: float = 1.5e-3
    """Learning rate of each round at the start."""
    updates: int = 260
    """Steps along the gradient of the score through the twin, each on ``batch`` whole episodes; 0 for what imitation
    has taught alone."""
    batch: int = 128
    """Episodes."""
    rate: float = 1e-3
    """Learning rate along the gradient, from the tenth update on."""
    tail: float = 0.1
    """Share of a batch that counts as its worst cases."""
    tail_weight: float = 0.5
    """Weight of the worst cases' mean beside that of all."""
    look_every: int = 20
    """Updates between two looks at the agent on validation scenarios, with the real engine; the best is kept."""
    validation: int = 100
    """Validation scenarios."""
    threads: int = 1
    """Threads of torch; more than one only slows so small a network down."""
    resume: Path | None = None
    """Folder of a training that was interrupted, to go on with; its own options hold. The same command with the same
    --out goes on, too."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("seed", 0, 10**6),
            ("seeds", 1, 10_000),
            ("episodes", 2, 10**6),
            ("memory", 1, 4096),
            ("hidden", 1, 4096),
            ("forecaster_steps", 0, 10**7),
            ("forecaster_batch", 1, 10**6),
            ("rounds", 0, 100),
            ("labels", 1, 10**8),
            ("imitation_steps", 0, 10**7),
            ("imitation_batch", 1, 10**7),
            ("updates", 0, 10**6),
            ("batch", 1, 10**6),
            ("look_every", 1, 10**6),
            ("validation", 1, 10_000),
            ("threads", 1, 256),
        ):
            require_integer(name, getattr(self, name), low=low, high=high)
        for name in ("forecaster_rate", "imitation_rate", "rate"):
            require_number(name, getattr(self, name), "", low=0.0, high=1.0, low_open=True)
        require_number("tail", self.tail, "of a batch", low=0.0, high=1.0, low_open=True)
        require_number("tail_weight", self.tail_weight, "", low=0.0, high=1e3)
        require_choice("observation", self.observation, ("state", "sensors"))
        self.config  # noqa: B018 - raises here, before anything is written

    @cached_property
    def suite_task(self) -> Task | None:
        """The task of the suite, if it is one."""
        return None if self.task is None else find_task(self.task)

    @cached_property
    def config(self) -> TaskConfig:
        """The task."""
        arguments = {} if self.suite_task is None else self.suite_task.arguments
        return TaskConfig(**{**arguments, "observation": self.observation})

    def training_scenarios(self, first: int, count: int) -> list[Scenario]:
        """Scenarios to learn from: ``count`` of them from number ``first`` on."""
        return drawn_scenarios(self.config.source, TRAINING_SEED + self.seed, first + count)[first:]

    def validation_scenarios(self) -> list[Scenario]:
        """Scenarios to choose by."""
        if self.suite_task is None:
            return drawn_scenarios(self.config.source, VALIDATION_SEED, self.validation)
        self.suite_task.require_frozen("validation")
        return self.suite_task.scenarios("validation", self.validation)
