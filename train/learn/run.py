"""The run of a learner's command: folder, progress, agent, comparison."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList

from aframe_env.text import read_json
from aframe_env.validation import InvalidValue
from train.evaluate.run import evaluate
from train.learn.checkpoint import FOLDER, Checkpoints, KeepCheckpoints, Stopped, stop_by_signal
from train.learn.learner import LearnerSpec, Rows
from train.learn.logs import open_logger, require_logs
from train.learn.options import LearningOptions
from train.learn.registry import find_learner, learner_of
from train.learn.selection import KeepBest
from train.learn.trained import best_policy, load_trained, save
from train.shared.cli import parse, read_options, to_mapping
from train.shared.console import PlainConsole
from train.shared.jobs import Where, run_jobs
from train.shared.run_folder import (
    CONFIG,
    Run,
    open_run,
    release,
    user_errors,
    versions,
    write_atomically,
    write_json,
)

METRICS: Final = "metrics.json"
EVALUATED: Final = "comparison.json"


def learning_progress(console: Console) -> Progress:
    """Bars for ``ShowReduction``."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("heave reduction {task.fields[reduction]}"),
        TimeRemainingColumn(),
        console=console,
    )


class ShowReduction(BaseCallback):
    """Show progress and heave reduction while learning."""

    def __init__(self, progress: Progress, total: int, rows: Rows) -> None:
        super().__init__()
        self._progress = progress
        self._task = progress.add_task("learning", total=total, reduction="   -  ")
        self._rows = rows
        self._interval = 64 * rows.num_envs
        self._shown = 0

    def _on_training_start(self) -> None:
        self._shown = self.num_timesteps // self._interval

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        # By the steps alone, so that a training that goes on shows what one that was never interrupted does.
        shown = self.num_timesteps // self._interval
        if shown == self._shown:
            return
        self._shown = shown
        reduction = self._rows.pop_reduction()
        self.logger.record("rollout/heave_reduction", reduction)
        self._progress.update(
            self._task,
            completed=min(self.num_timesteps, self._progress.tasks[0].total or 0),
            reduction=f"{reduction:6.1%}",
        )


def main(name: str) -> int:
    """Run the command of a learner."""
    with user_errors():
        spec = find_learner(name)
        options = _options(spec)
        successor = spec.successor(options)
        if successor is not None:
            spec = find_learner(successor)
            options = _options(spec)
        return train(spec, options, PlainConsole())


def _options(spec: LearnerSpec) -> LearningOptions:
    """Options of the command line, or those of the training that it goes on with."""
    options = parse(spec.options, spec.command, spec.description)
    folder = options.resume
    if folder is None:
        return options
    config = folder / CONFIG
    if not config.is_file():
        raise InvalidValue(f"resume = {str(folder)!r}: no folder of a training, which has {CONFIG}")
    # What was begun with --overwrite must not be overwritten now.
    return replace(read_options(config, spec.options), out=folder, overwrite=False)


def train(spec: LearnerSpec, options: LearningOptions, console: Console) -> int:
    """Train, save and compare the agents of all seeds, or go on with that; return the exit status."""
    spec.check(options)
    require_logs(options.log)
    if options.seeds == 1:
        return _train_one(spec, options, console)
    opened = open_run(options, spec.command, goes_on=True)
    opened.record(options)
    each = [
        replace(options, seed=seed, seeds=1, cluster=None, out=opened.folder / f"seed-{seed}")
        for seed in range(options.seed, options.seed + options.seeds)
    ]
    if options.asked_for:
        _learn_elsewhere([one for one in each if not (opened.taken_up and _learned(_folder(one)))], options)
        each = [replace(one, overwrite=False) for one in each]
    for one in each:
        if (opened.taken_up or options.asked_for) and _finished(one):
            console.print(f"{one.out}: finished")
            continue
        if status := _train_one(spec, one, console):
            return status
    return 0


@dataclass(frozen=True)
class _Training:
    """A training for another process."""

    options: LearningOptions
    command: tuple[str, ...]
    """Command line of the process that asks for it."""

    def run(self) -> dict[str, bytes]:
        """Learn in the folder of the options, from the newest checkpoint there; return what is in it, by name."""
        sys.argv, console, folder = list(self.command), PlainConsole(), _folder(self.options)
        console.quiet = True
        try:
            status = _train_one(learner_of(self.options), self.options, console, compared=False)
        finally:
            release(folder)
        if status:
            raise RuntimeError(f"{folder}: stopped by a signal ({status})")
        return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def _learn_elsewhere(trainings: Sequence[LearningOptions], where: Where) -> None:
    """Let other processes learn, and see to it that what they wrote is on this machine."""
    jobs = [_Training(one, tuple(sys.argv)) for one in trainings]
    for one, files in zip(trainings, run_jobs(_Training.run, jobs, where=where, description="trainings"), strict=True):
        for name, data in files.items():
            path = _folder(one) / name
            if not path.exists() or path.read_bytes() != data:
                write_atomically(path, partial(Path.write_bytes, data=data))


def _folder(options: LearningOptions) -> Path:
    assert options.out is not None
    return options.out


def _finished(options: LearningOptions) -> bool:
    """Whether the training of these options ended, its comparison included."""
    folder = _folder(options)
    return _learned(folder) and (not options.eval_scenarios or (folder / EVALUATED).exists())


def _learned(folder: Path) -> bool:
    """Whether the training in a folder came to its end."""
    metrics = folder / METRICS
    if not metrics.exists():
        return False
    data = read_json(metrics, "metrics")
    if not isinstance(data, dict) or not isinstance(data.get("interrupted"), bool):
        raise InvalidValue(f"{metrics}: must be the figures of a training; pass --overwrite to do it again")
    return not data["interrupted"]


def _train_one(spec: LearnerSpec, options: LearningOptions, console: Console, *, compared: bool = True) -> int:
    opened = open_run(options, spec.command, goes_on=True)
    folder = opened.folder
    if opened.taken_up and _finished(replace(options, out=folder)):
        raise InvalidValue(f"out = {str(folder)!r}: this training is finished; pass --overwrite to do it again")
    console.print(f"run folder: {folder}")
    if not (opened.taken_up and _learned(folder)):
        if not opened.taken_up:
            # They would say of what begins now that it is finished.
            for name in (METRICS, EVALUATED):
                (folder / name).unlink(missing_ok=True)
            opened.record(options)
        try:
            status = _learn(spec, options, opened, console)
        except OSError as error:
            if any((folder / FOLDER).glob("[0-9]*")):
                raise OSError(f"{error}; the last checkpoint is kept, and --resume {folder} goes on from it") from error
            raise
        if status:
            return status
    if options.eval_scenarios and compared:
        evaluate(load_trained(folder), folder, options.held_out, console)
    return 0


def _learn(spec: LearnerSpec, options: LearningOptions, opened: Run, console: Console) -> int:
    """Learn from the start or from the newest checkpoint, and save the agent; return the exit status."""
    folder, checkpoints = opened.folder, Checkpoints(opened.folder)
    with console.status("compiling the engine (about half a minute at the very first start)"):
        learner = spec.build(options)
        learner.rows.reset()
    model = learner.model
    begun, card = 0, None
    if opened.taken_up:
        card = checkpoints.take_up(learner)
    else:
        checkpoints.remove()
    if card is not None:
        begun = model.num_timesteps
        console.print(f"goes on from {begun:,} control steps")
        if card["versions"] != versions():
            console.print("the checkpoint is of other versions: the agent may differ from that of one run")
    begin = time.perf_counter()
    stopped: Stopped | None = None
    with (
        stop_by_signal() as stop,
        open_logger(folder, options.log, to_mapping(options), begun) as logger,
        learning_progress(console) as progress,
    ):
        model.set_logger(logger)
        keep = KeepCheckpoints(checkpoints, learner, options.checkpoint_every, stop)
        # Before the checkpoints, which keep what it finds.
        select = [KeepBest(learner, options)] if options.selected_by else []
        callback = CallbackList([*select, ShowReduction(progress, options.timesteps, learner.rows), keep])
        try:
            if isinstance(model, BaseAlgorithm):
                model.learn(options.timesteps - begun, callback=callback, reset_num_timesteps=card is None)
            else:
                model.learn(options.timesteps, callback=callback)
        except Stopped as signalled:
            stopped = signalled
    seconds = time.perf_counter() - begin
    policy, weights = best_policy(learner, options)
    place = save(folder, policy, weights)
    write_json(
        folder / METRICS,
        {
            "timesteps": model.num_timesteps,
            "training_seconds": round(seconds, 1),
            "checkpoint_seconds": round(keep.seconds, 1),
            "interrupted": stopped is not None,
            **({"best_after": learner.best.timesteps, "heave_left": learner.best.left} if options.selected_by else {}),
        },
    )
    console.print(f"agent: {place} after {model.num_timesteps:,} steps in {seconds:.0f} s")
    if stopped is not None:
        console.print(f"stopped by {stopped}: --resume {folder} goes on")
        return stopped.status
    checkpoints.remove()
    return 0
