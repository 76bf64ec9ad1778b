"""What every learner's command does around its own algorithm: options, run folder, progress, agent, comparison."""

from __future__ import annotations

import contextlib
import shlex
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Literal, Protocol

import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, configure

from aframe_env import task
from aframe_env.scenario.sensors import Sensors
from aframe_env.validation import InvalidValue, require_choice, require_integer, require_number
from agents.learned.agent import CARD, WEIGHTS, AgentCard, LearnedPolicy, card_text, digest, serialise
from agents.learned.features import feature_names
from agents.learned.network import Actor
from train.bridge import TrainingVecEnv
from train.config import to_toml
from train.held_out import evaluate
from train.output import new_folder, versions, write_atomically, write_json, write_text

EPISODE_DURATION = 60.0


@dataclass(frozen=True, kw_only=True)
class LearningOptions:
    """Options that all learners share."""

    timesteps: int = 1_000_000
    """Control steps to learn from, over all rows."""
    n_envs: int = 64
    """Rows of the environment."""
    seed: int = 0
    """Seeds everything; the same seed gives the same agent."""
    seeds: int = 1
    """Train so many agents, with seeds one after another, each in a folder of its own."""
    out: Path | None = None
    """Run folder; by default runs/ALGORITHM-DATE-TIME."""
    overwrite: bool = False
    """Write into the run folder even if it has something in it."""
    observation: Literal["state", "sensors"] = "state"
    """What the agent sees."""
    control_period: float = 0.1
    """Control step, s."""
    batch_size: int = 1024
    """Minibatch."""
    learning_rate: float = 1e-3
    """At the start; it falls linearly to a thirtieth."""
    gamma: float = 0.95
    """Discount for a control step: a horizon of two seconds."""
    hidden: int = 64
    """Units of each hidden layer."""
    horizon: float = 30.0
    """Rows start a new scenario after this time, s."""
    drift_limit: float = 10.0
    """Depth error at which a row starts anew, m; its last state's value stands for the rest."""
    reward_scale: float = 1.0
    """Reward for a metre of root mean square depth error over a step."""
    reward_knee: float = 0.05
    """Depth error beyond which the reward falls with its logarithm only, m: what is learned would otherwise be spent on
    the few loads that drift far off, not on the last centimetres of all others."""
    eval_scenarios: int = 200
    """Held-out scenarios of the comparison at the end; 0 leaves it out."""
    eval_privileged: int = 20
    """The first so many of them, or all if there are fewer, for the drives that are optimised with the whole future
    known."""
    threads: int = 1
    """Threads of torch; more than one only slows so small a network down."""

    def __post_init__(self) -> None:
        require_integer("timesteps", self.timesteps, low=1, high=10**12)
        require_integer("n_envs", self.n_envs, low=1, high=2**20)
        require_integer("seed", self.seed, low=0, high=2**32 - 1)
        require_integer("seeds", self.seeds, low=1, high=10_000)
        require_choice("observation", self.observation, ("state", "sensors"))
        require_number("control_period", self.control_period, "s", low=0.01, high=2.0)
        require_integer("batch_size", self.batch_size, low=2, high=10**9)
        require_number("learning_rate", self.learning_rate, "", low=0.0, high=1.0, low_open=True)
        require_number("gamma", self.gamma, "", low=0.0, high=1.0)
        require_integer("hidden", self.hidden, low=1, high=4096)
        require_number("horizon", self.horizon, "s", low=self.control_period, high=EPISODE_DURATION)
        require_number("drift_limit", self.drift_limit, "m", low=0.0, high=1e3, low_open=True)
        require_number("reward_scale", self.reward_scale, "1/m", low=0.0, high=1e6, low_open=True)
        require_integer("eval_scenarios", self.eval_scenarios, low=0, high=10**6)
        require_integer("eval_privileged", self.eval_privileged, low=0, high=10**6)
        require_integer("threads", self.threads, low=1, high=256)

    def rate(self, remaining: float) -> float:
        """Learning rate when a share ``remaining`` of the training is left."""
        return self.learning_rate * max(remaining, 1.0 / 30.0)


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


def make_rows(options: LearningOptions) -> TrainingVecEnv:
    """Rows of the environment for a learner."""
    torch.set_num_threads(options.threads)
    return TrainingVecEnv(
        options.n_envs,
        scenario=None,
        observation=options.observation,
        control_period=options.control_period,
        episode_duration=EPISODE_DURATION,
        horizon=options.horizon,
        drift_limit=options.drift_limit,
        reward_scale=options.reward_scale,
        reward_knee=options.reward_knee,
        seed=options.seed,
    )


class ShowReduction(BaseCallback):
    """Show progress and heave reduction while learning."""

    def __init__(self, progress: Progress, total: int, rows: Rows) -> None:
        super().__init__()
        self._progress = progress
        self._task = progress.add_task("learning", total=total, reduction="   -  ")
        self._rows = rows
        self._interval = 64 * rows.num_envs
        self._next = self._interval

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        if self.num_timesteps < self._next:
            return
        self._next = self.num_timesteps + self._interval
        reduction = self._rows.pop_reduction()
        self.logger.record("rollout/heave_reduction", reduction)
        self._progress.update(
            self._task,
            completed=min(self.num_timesteps, self._progress.tasks[0].total or 0),
            reduction=f"{reduction:6.1%}",
        )


def to_policy(learner: Learner, options: LearningOptions) -> tuple[LearnedPolicy, bytes]:
    """The agent as a policy, and the bytes of its weights."""
    actor = learner.to_actor()
    weights = serialise(actor)
    card = AgentCard(
        algorithm=learner.algorithm,
        observation=options.observation,
        sensors=Sensors() if options.observation == "sensors" else None,
        features=feature_names(learner.rows.quantities),
        hidden=options.hidden,
        squashed=actor.squashed,
        control_period=options.control_period,
        seed=options.seed,
        timesteps=learner.model.num_timesteps,
        versions=versions(),
        sha256=digest(weights),
    )
    return LearnedPolicy(actor, card), weights


def save(folder: Path, policy: LearnedPolicy, weights: bytes) -> None:
    """Write the agent: weights first, the card that vouches for them last."""
    write_atomically(folder / WEIGHTS, lambda path: path.write_bytes(weights))
    write_text(folder / CARD, card_text(policy.card))


Build = Callable[[LearningOptions], Learner]


def train(options: LearningOptions, name: str, build: Callable[..., Learner], console: Console) -> int:
    """Train, save and compare the agents of all seeds; return the exit status."""
    out = options.out or Path("runs") / f"{name}-{datetime.now():%Y%m%d-%H%M%S}"
    if options.seeds == 1:
        return _train_one(replace(options, out=out), name, build, console)
    new_folder(out, overwrite=options.overwrite)
    for seed in range(options.seed, options.seed + options.seeds):
        one = replace(options, seed=seed, seeds=1, out=out / f"seed-{seed}")
        if status := _train_one(one, name, build, console):
            return status
    return 0


def _train_one(options: LearningOptions, name: str, build: Callable[..., Learner], console: Console) -> int:
    if options.out is None:
        raise InvalidValue("out: must be given")
    folder = new_folder(options.out, overwrite=options.overwrite)
    write_text(folder / "config.toml", to_toml(options))
    command = shlex.join([Path(sys.executable).name, "-m", f"train.{name}", *sys.argv[1:]])
    write_json(folder / "run.json", {"command": command, "versions": versions()})
    console.print(f"run folder: {folder}")
    with console.status("compiling the engine (about half a minute at the very first start)"):
        learner = build(options)
        learner.rows.reset()
    model = learner.model
    model.set_logger(configure(str(folder / "log"), ["tensorboard", "csv"]))
    begin = time.perf_counter()
    interrupted = False
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("heave reduction {task.fields[reduction]}"),
        TimeRemainingColumn(),
        console=console,
    ) as progress:
        try:
            model.learn(options.timesteps, callback=ShowReduction(progress, options.timesteps, learner.rows))
        except KeyboardInterrupt:
            interrupted = True
        finally:
            model.logger.close()
    seconds = time.perf_counter() - begin
    policy, weights = to_policy(learner, options)
    save(folder, policy, weights)
    write_json(
        folder / "metrics.json",
        {"timesteps": model.num_timesteps, "training_seconds": round(seconds, 1), "interrupted": interrupted},
    )
    console.print(f"agent: {folder / WEIGHTS} after {model.num_timesteps:,} steps in {seconds:.0f} s")
    if interrupted:
        console.print("interrupted: what was learned is kept; the comparison was left out")
        return 130
    if options.eval_scenarios:
        with contextlib.suppress(KeyboardInterrupt):
            privileged = min(options.eval_privileged, options.eval_scenarios)
            evaluate(policy, folder, options.eval_scenarios, privileged, console)
    return 0
