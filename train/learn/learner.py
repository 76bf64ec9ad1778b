"""A learner as the commands that train and tune it see it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from torch import nn

from aframe_env import task
from train.learn.memory import Memory, of_tensors, to_tensors
from train.learn.options import LearningOptions


class Model(Protocol):
    """Interface of a learner: that of Stable-Baselines3, as far as it is needed."""

    num_timesteps: int

    @property
    def logger(self) -> Logger:
        """Logger of the figures."""
        ...

    def set_logger(self, logger: Logger) -> None:
        """Say where figures go."""
        ...

    def learn(self, total_timesteps: int, callback: BaseCallback | None = None) -> object:
        """Learn from so many control steps, over all rows."""
        ...


@runtime_checkable
class Remembers(Protocol):
    """Interface of what checkpoints keep."""

    def memory(self) -> Memory:
        """Everything that its rest depends on."""
        ...

    def recall(self, memory: Memory) -> None:
        """Put back what ``memory`` told of one with the same options."""
        ...


class Rows(Remembers, Protocol):
    """Interface of a learner's rows."""

    num_envs: int

    @property
    def quantities(self) -> tuple[task.Quantity, ...]:
        """Quantities of the environment's observation."""
        ...

    def reset(self) -> object:
        """Start all rows."""
        ...

    def pop_reduction(self) -> float:
        """Heave reduction over all steps since the last call."""
        ...


@dataclass
class Best:
    """The best agent that was looked at while learning."""

    left: float = math.inf
    """Mean share of the heave that it leaves in the scenarios that it is looked at on."""
    timesteps: int = 0
    """Control steps that it has learned from."""
    actor: nn.Module | None = None

    def memory(self) -> Memory:
        """What is kept of it."""
        if self.actor is None:
            return Memory(values={"left": None, "timesteps": 0})
        return Memory(of_tensors(self.actor.state_dict()).arrays, {"left": self.left, "timesteps": self.timesteps})

    def recall(self, memory: Memory, to_actor: Callable[[], nn.Module]) -> None:
        """Put back what ``memory`` told; ``to_actor`` makes an agent of its kind."""
        if memory.values["left"] is not None:
            self.left, self.timesteps, self.actor = memory.values["left"], memory.values["timesteps"], to_actor()
            self.actor.load_state_dict(to_tensors(memory))


@dataclass(frozen=True)
class Learner:
    """A learner, its rows, and how to take the agent out of it."""

    algorithm: str
    model: Model
    rows: Rows
    to_actor: Callable[[], nn.Module]
    """The agent's network as it is, a copy."""
    best: Best = field(default_factory=Best)


@dataclass(frozen=True)
class Range:
    """Interval of a hyper-parameter."""

    low: float
    high: float
    logarithmic: bool = False


@dataclass(frozen=True)
class Search:
    """Search space of ``train.tune``: options of a learner, and their values."""

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
