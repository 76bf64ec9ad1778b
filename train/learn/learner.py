"""What a learner is to the commands that train and tune it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from aframe_env import task
from agents.learned.network import Actor
from train.learn.options import LearningOptions


class Model(Protocol):
    """What is needed of a learner of Stable-Baselines3, or of another that does the same."""

    num_timesteps: int

    @property
    def logger(self) -> Logger:
        """Where figures go."""
        ...

    def set_logger(self, logger: Logger) -> None:
        """Say where figures go."""
        ...

    def learn(self, total_timesteps: int, callback: BaseCallback | None = None) -> object:
        """Learn from so many control steps, over all rows."""
        ...


class Rows(Protocol):
    """What is needed of a learner's rows."""

    num_envs: int

    @property
    def quantities(self) -> tuple[task.Quantity, ...]:
        """What an observation of the environment consists of."""
        ...

    def reset(self) -> object:
        """Start all rows."""
        ...

    def pop_reduction(self) -> float:
        """Heave reduction over all steps since the last call."""
        ...


@dataclass(frozen=True)
class Learner:
    """A learner, its rows, and how to take the agent out of it."""

    algorithm: str
    model: Model
    rows: Rows
    to_actor: Callable[[], Actor]


@dataclass(frozen=True)
class Range:
    """Where a hyper-parameter may lie."""

    low: float
    high: float
    logarithmic: bool = False


@dataclass(frozen=True)
class Search:
    """Which of a learner's options are searched by ``train.tune``, and where."""

    ranges: dict[str, Range]
    choices: dict[str, tuple[int, ...]] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        """The options' names."""
        return [*self.ranges, *self.choices]


@dataclass(frozen=True)
class LearnerSpec:
    """A learner to choose: its command, its options, and how it is built."""

    command: str
    """As in "train.ppo"."""
    description: str
    options: type[LearningOptions]
    build: Callable[[Any], Learner]
    """(options): the learner and its rows."""
    search: Search | None = None
    check: Callable[[Any], None] = lambda options: None
    """(options): raise where they ask for what this machine has not, before anything is written."""
    successor: Callable[[Any], str | None] = lambda options: None
    """(options): name of the learner that takes over for such options, with defaults of its own; None for none."""
