"""The run of a learner's command: folder, progress, agent, comparison."""

from __future__ import annotations

import contextlib
import time
from dataclasses import replace
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from stable_baselines3.common.callbacks import BaseCallback

from agents.learned.agent import CARD, WEIGHTS, AgentCard, LearnedPolicy, card_text, digest, serialise
from agents.learned.feature_sets import feature_names
from agents.learned.features import Action
from train.evaluate.run import evaluate
from train.learn.learner import Learner, LearnerSpec, Rows
from train.learn.logs import open_logger, require_logs
from train.learn.options import LearningOptions
from train.learn.registry import find_learner
from train.shared.cli import parse, to_mapping
from train.shared.run_folder import open_run, user_errors, versions, write_atomically, write_json, write_text

AGENT_NAMES: Final[dict[Action, str]] = {
    "speed": "{}",
    "residual": "residual {}",
    "predictive": "predictive {}",
}
"""Names of agents by their action, to be filled in with the learner's."""


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
        algorithm=AGENT_NAMES[options.action].format(learner.algorithm),
        observation=options.observation,
        sensors=options.features.sensors,
        waves=options.features.waves,
        action=options.action,
        features=feature_names(options.features),
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


def main(name: str) -> int:
    """Run the command of a learner."""
    with user_errors():
        spec = find_learner(name)
        options = parse(spec.options, spec.command, spec.description)
        successor = spec.successor(options)
        if successor is not None:
            spec = find_learner(successor)
            options = parse(spec.options, spec.command, spec.description)
        return train(spec, options, Console())


def train(spec: LearnerSpec, options: LearningOptions, console: Console) -> int:
    """Train, save and compare the agents of all seeds; return the exit status."""
    spec.check(options)
    require_logs(options.log)
    if options.seeds == 1:
        return _train_one(spec, options, console)
    folder = open_run(options, spec.command).folder
    for seed in range(options.seed, options.seed + options.seeds):
        one = replace(options, seed=seed, seeds=1, out=folder / f"seed-{seed}")
        if status := _train_one(spec, one, console):
            return status
    return 0


def _train_one(spec: LearnerSpec, options: LearningOptions, console: Console) -> int:
    opened = open_run(options, spec.command)
    folder = opened.folder
    opened.record(options)
    console.print(f"run folder: {folder}")
    with console.status("compiling the engine (about half a minute at the very first start)"):
        learner = spec.build(options)
        learner.rows.reset()
    model = learner.model
    begin = time.perf_counter()
    interrupted = False
    progress = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("heave reduction {task.fields[reduction]}"),
        TimeRemainingColumn(),
        console=console,
    )
    with open_logger(folder, options.log, to_mapping(options)) as logger, progress:
        model.set_logger(logger)
        try:
            model.learn(options.timesteps, callback=ShowReduction(progress, options.timesteps, learner.rows))
        except KeyboardInterrupt:
            interrupted = True
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
            evaluate(policy, folder, options.held_out, console)
    return 0
