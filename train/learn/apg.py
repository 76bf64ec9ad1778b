"""Analytic policy gradient: the gradient of the depth error along a linear twin of the task, by back-propagation.

No rewards and no exploration: a network runs along stretches of recorded episodes (:mod:`train.learn.twin`), what share
of the heave it leaves is a function of its weights, and Adam goes down its gradient. Half of the episodes are those in
which the winch saturates, since there is most to learn.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
import torch
from rich.progress import Progress
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from aframe_env import task
from aframe_env.scenario import Scenario
from aframe_env.validation import require_integer, require_number
from agents.control.optimum import saturating
from agents.learned.features import FEATURES
from agents.learned.network import Actor
from agents.rollout import drawn_scenarios
from train.learn.learner import Learner, LearnerSpec
from train.learn.options import LearningOptions
from train.learn.twin import Recording, record, rollout

SERIES: Final = 500_000_003
"""Series of scenarios that are learned from: this plus the seed."""
DIVERGED: Final = 1.0
"""Share of the heave beyond which a row counts with its logarithm only."""
FINEST: Final = 0.003
"""Share of the heave below which less is no longer worth twice the effort."""
WARM_UP: Final = 10
"""Updates over which the learning rate rises."""


@dataclass(frozen=True, kw_only=True)
class Options(LearningOptions):
    """Options of the training."""

    timesteps: int = 30_000_000
    """Control steps of the twin to learn from, over all rows."""
    n_envs: int = 512
    """Rows of the twin in an update."""
    learning_rate: float = 2e-3
    """At the start; it falls linearly to a thirtieth."""
    episodes: int = 1200
    """Recorded episodes."""
    saturating_share: float = 0.5
    """Share of them in which the winch saturates, if so many are found among four times as many."""
    stretch: float = 15.0
    """Length of a stretch, s."""
    tail: float = 0.3
    """Weight of the squared share of the heave that is left, beside the share: of the worst rows."""
    detail: float = 0.0
    """Weight of its logarithm: of the best rows."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_integer("episodes", self.episodes, low=1, high=10**6)
        require_number("saturating_share", self.saturating_share, "", low=0.0, high=1.0)
        require_number("stretch", self.stretch, "s", low=self.control_period, high=self.config.duration)
        require_number("tail", self.tail, "", low=0.0, high=1e3)
        require_number("detail", self.detail, "", low=0.0, high=1e3)


class TwinRows:
    """Recorded episodes as a learner's rows."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self.num_envs = options.n_envs
        self._recording: Recording | None = None
        self._left: list[float] = []

    @property
    def quantities(self) -> tuple[task.Quantity, ...]:
        """Quantities of the environment's observation."""
        return self._options.config.quantities

    def reset(self) -> Recording:
        """Record the episodes, once."""
        if self._recording is None:
            options = self._options
            with Progress(transient=True) as progress:
                bar = progress.add_task("recording episodes", total=options.config.steps)
                self._recording = record(
                    _scenarios(options),
                    options.config,
                    options.features,
                    options.seed,
                    partial(_show, progress, bar),
                )
        return self._recording

    def push(self, left: torch.Tensor) -> None:
        """Take note of the shares of the heave (N,) that rows left."""
        self._left.append(float(left.median()))

    def pop_reduction(self) -> float:
        """Median of the heave reduction over the stretches since the last call; half of them are hard ones."""
        median = float(np.median(self._left)) if self._left else 1.0
        self._left.clear()
        return 1.0 - median


def _show(progress: Progress, bar: int, step: int) -> None:
    progress.update(bar, completed=step)  # type: ignore[arg-type]


def _scenarios(options: Options) -> list[Scenario]:
    count = options.episodes
    drawn = drawn_scenarios(options.config.source, SERIES + options.seed, 4 * count)
    hard = saturating(drawn, options.config)
    most = np.flatnonzero(hard)[: round(options.saturating_share * count)].tolist()
    rest = np.flatnonzero(~hard)[: count - len(most)].tolist()
    chosen = most + rest
    # A source of hard scenarios alone has no others.
    chosen += [i for i in range(len(drawn)) if i not in set(chosen)][: count - len(chosen)]
    return [drawn[i] for i in chosen]


class AnalyticPolicyGradient:
    """Adam on the share of the heave that the network leaves in the twin."""

    def __init__(self, rows: TwinRows, options: Options) -> None:
        self.num_timesteps = 0
        self._rows, self._options = rows, options
        self._logger: Logger | None = None
        torch.manual_seed(options.seed)
        self.actor = Actor(len(FEATURES), options.hidden)
        with torch.no_grad():
            # It begins by saying next to nothing.
            self.actor.head.weight[:, : options.hidden] *= 0.01
            self.actor.head.weight[:, options.hidden :] = 0.0
            self.actor.head.bias.zero_()
        self._optimiser = torch.optim.Adam(self.actor.parameters(), lr=options.learning_rate)

    @property
    def logger(self) -> Logger:
        """Logger of the figures."""
        assert self._logger is not None
        return self._logger

    def set_logger(self, logger: Logger) -> None:
        """Say where figures go."""
        self._logger = logger

    def learn(self, total_timesteps: int, callback: BaseCallback | None = None) -> None:
        """Learn from so many control steps of the twin, over all rows."""
        begin = time.perf_counter()
        options, recording = self._options, self._rows.reset()
        rng = np.random.default_rng(options.seed)
        episodes, length = recording.features.shape[:2]
        steps = max(1, min(length, round(options.stretch / options.control_period)))
        if callback:
            callback.init_callback(self)  # type: ignore[arg-type]
            callback.on_training_start({}, {})
        updates = 0
        while self.num_timesteps < total_timesteps:
            rate = options.rate(1.0 - self.num_timesteps / total_timesteps) * min(1.0, (updates + 1) / WARM_UP)
            for group in self._optimiser.param_groups:
                group["lr"] = rate
            if callback:
                callback.on_rollout_start()
            rows = rng.choice(episodes, options.n_envs, replace=options.n_envs > episodes)
            stretch = recording.stretch(rows, rng.integers(0, length - steps + 1, len(rows)), steps)
            loss = self._update(stretch)
            updates += 1
            self.num_timesteps += steps * len(rows)
            if callback and not callback.on_step():
                return
            if callback:
                callback.on_rollout_end()
            if self._logger:
                self._logger.record("train/loss", loss)
                self._logger.record("train/learning_rate", rate)
                self._logger.record("time/seconds", time.perf_counter() - begin)
                self._logger.record("time/total_timesteps", self.num_timesteps)
                self._logger.dump(self.num_timesteps)
        if callback:
            callback.on_training_end()

    def _update(self, stretch: Recording) -> float:
        """Take a step down the gradient; return the loss."""
        options = self._options
        square, beyond = rollout(self.actor, stretch)
        left = torch.sqrt(square + 1e-10) / stretch.still
        left = torch.where(left < DIVERGED, left, DIVERGED * (1.0 + torch.log(left / DIVERGED)))
        self._rows.push(left.detach())
        loss = (
            left.mean()
            + options.tail * left.square().mean()
            + options.detail * torch.log(left + FINEST).mean()
            + 0.01 * beyond
        )
        self._optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.actor.parameters(), 2.0)
        self._optimiser.step()
        return float(loss.detach())


def build(options: Options) -> Learner:
    """The learner and its rows."""
    torch.set_num_threads(options.threads)
    rows = TwinRows(options)
    model = AnalyticPolicyGradient(rows, options)
    return Learner("APG", model, rows, lambda: model.actor)


SPEC: Final = LearnerSpec(
    command="train.apg",
    description="Train an agent by analytic policy gradient, then compare it with the paper's drives.",
    options=Options,
    build=build,
)
