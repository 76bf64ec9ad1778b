"""Search for a learner's hyper-parameters: ``python -m train.tune --algorithm ppo --out runs/tune-ppo``.

Optuna's tree-structured Parzen estimator, for the greatest median heave reduction over validation scenarios, which are
neither those of training nor the held-out ones. The first trial is the defaults. Every trial is kept as it ends:
call again with the same folder to go on after an interruption, or for more trials. The sampler is told of the trials
that are kept in their order, so that a search that was interrupted ends as one that was not.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import optuna
from rich.console import Console
from rich.progress import Progress

import aframe_env
import agents
import train.learn
from aframe_env.scenario import Scenario, ScenarioSource
from aframe_env.validation import InvalidValue, require_choice, require_integer
from agents.policy import DrumStill, FloatArray
from agents.rollout import HELD_OUT_SEED, drawn_scenarios, run
from train.learn.learner import Search
from train.learn.options import LearningOptions
from train.learn.registry import LEARNERS, find_learner
from train.learn.trained import to_policy
from train.shared.cli import parse, to_mapping
from train.shared.console import PlainConsole
from train.shared.job_store import JobStore, version_of
from train.shared.jobs import Where, run_jobs
from train.shared.markdown import table
from train.shared.run_folder import Run, RunOptions, open_jobs, user_errors, write_text
from train.shared.scenarios import ScenarioOptions

VALIDATION_SEED: Final = 7_000_001
"""Seed of the scenarios that trials are judged by."""


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, Where, ScenarioOptions):
    """Learner, and size of the search."""

    algorithm: str = "ppo"
    """Learner: ppo or sac, or another of ``train.learn.registry`` that has a search space."""
    observation: Literal["state", "sensors"] = "state"
    """Observation of the agent."""
    trials: int = 20
    """Trials in all, those of earlier calls included."""
    timesteps: int | None = None
    """Control steps to learn from in a trial; by default those of a training."""
    scenarios: int | Path = 200
    """Number of validation scenarios; or a TOML file with a scenario or a distribution of your own."""
    at_once: int = 1
    """Trials that are drawn before any of them is told of: as many can run side by side."""
    workers: int | None = 1
    """Trials that run at once, out of those that are drawn together."""
    seed: int = 0
    """Seed of the search; trial k learns with seed + k, so that no seed is tuned for."""
    out: Path | None = Path("runs/tune")
    """Output folder, or that of a search to go on with."""

    def __post_init__(self) -> None:
        Where.__post_init__(self)
        ScenarioOptions.__post_init__(self)
        require_choice("algorithm", self.algorithm, tuple(LEARNERS))
        if find_learner(self.algorithm).search is None:
            raise InvalidValue(f"algorithm = {self.algorithm!r}: has no search space in its SPEC")
        require_integer("trials", self.trials, low=1, high=10**6)
        require_integer("at_once", self.at_once, low=1, high=1000)
        if self.timesteps is not None:
            require_integer("timesteps", self.timesteps, low=1, high=10**12)
        require_integer("seed", self.seed, low=0, high=2**31)


def validation_scenarios(source: ScenarioSource, count: int) -> list[Scenario]:
    """The first ``count`` of the scenarios that trials are judged by."""
    assert VALIDATION_SEED != HELD_OUT_SEED
    return drawn_scenarios(source, VALIDATION_SEED, count)


def suggest(trial: optuna.Trial, space: Search) -> dict[str, Any]:
    """Hyper-parameters for a trial."""
    found: dict[str, Any] = {
        name: trial.suggest_float(name, r.low, r.high, log=r.logarithmic) for name, r in space.ranges.items()
    }
    return found | {name: trial.suggest_categorical(name, values) for name, values in space.choices.items()}


@dataclass(frozen=True)
class Score:
    """What came of a trial."""

    median: float | None
    """Median heave reduction; None if the trial failed."""
    fifth: float | None
    """Heave reduction that 95 % of the scenarios exceed; None if the trial failed."""
    failure: str = ""
    """Why it failed."""


@dataclass(frozen=True)
class Trial:
    """Hyper-parameters, and what came of them."""

    number: int
    seed: int
    parameters: dict[str, Any]
    score: Score

    @property
    def cells(self) -> tuple[str, str]:
        """Median and fifth percentile as text."""
        median, fifth = self.score.median, self.score.fifth
        return ("failed", "") if median is None or fifth is None else (f"{median:.2%}", f"{fifth:.2%}")


def best_of(trials: Sequence[Trial]) -> Trial:
    """The trial of the greatest median; ``InvalidValue`` if all have failed."""
    best = max(trials, key=_median)
    if best.score.median is None:
        raise InvalidValue(f"trials = {len(trials)}: all have failed; the first: {trials[0].score.failure}")
    return best


def _median(trial: Trial) -> float:
    return -np.inf if trial.score.median is None else trial.score.median


def trials_table(trials: Sequence[Trial]) -> str:
    """Trials as Markdown, the best first."""
    lines = []
    for trial in sorted(trials, key=_median, reverse=True):
        which = f"{trial.number}{' (defaults)' if trial.number == 0 else ''}"
        lines.append([which, *trial.cells, *(f"{value:.3g}" for value in trial.parameters.values())])
    return table(["trial", "median heave reduction", "fifth percentile", *trials[0].parameters], lines)


def rows(trials: Sequence[Trial]) -> str:
    """Trials as CSV, in their order; a failed one has no median."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["trial", "median", "fifth", "seed", *trials[0].parameters])
    for trial in trials:
        found = ("" if value is None else f"{value:.6f}" for value in (trial.score.median, trial.score.fifth))
        values = (f"{value:.6g}" for value in trial.parameters.values())
        writer.writerow([trial.number, *found, trial.seed, *values])
    return text.getvalue()


@dataclass(frozen=True)
class Judge:
    """What trials are judged by."""

    algorithm: str
    scenarios: Sequence[Scenario]
    still: FloatArray
    """RMS depth error of each with the drum still, m."""

    def score(self, options: LearningOptions) -> Score:
        """Learn with ``options``, and look at the agent."""
        learner = find_learner(self.algorithm).build(options)
        try:
            learner.model.learn(options.timesteps)
            policy, _ = to_policy(learner, options)
            reduction = 1.0 - run(policy, self.scenarios, options.config).rms / self.still
        except ValueError as error:  # networks that diverge: what is no number is refused, by whoever sees it first
            return Score(None, None, " ".join(str(error).split()))
        if not np.isfinite(reduction).all():
            return Score(None, None, "the agent's actions are no numbers")
        return Score(float(np.median(reduction)), float(np.quantile(reduction, 0.05)))


def search(options: Options, opened: Run, console: Console) -> list[Trial]:
    """Run the trials that are not in the store, and write the tables after each."""
    spec = find_learner(options.algorithm)
    assert spec.search is not None
    space, defaults = spec.search, spec.options()
    scenarios = validation_scenarios(options.source, options.number)
    judge = Judge(options.algorithm, scenarios, run(DrumStill(), scenarios, defaults.config).rms)
    # Of trials that run beside it, a new one must not be a twin.
    sampler = optuna.samplers.TPESampler(seed=options.seed, constant_liar=options.at_once > 1)
    study = optuna.create_study(direction="maximize", sampler=sampler)
    study.enqueue_trial({name: getattr(defaults, name) for name in space.names})
    trials: list[Trial] = []
    with (
        Progress(console=console) as progress,
        JobStore(opened.jobs, Score, version_of(aframe_env, agents, train.learn)) as store,
    ):
        bar = progress.add_task("trials", total=options.trials)
        for first in range(0, options.trials, options.at_once):
            asked = [study.ask() for _ in range(first, min(first + options.at_once, options.trials))]
            parameters = [suggest(each, space) for each in asked]
            chosen = [
                replace(
                    defaults,
                    **each,
                    scenarios=options.scenarios if isinstance(options.scenarios, Path) else None,
                    observation=options.observation,
                    seed=options.seed + number,
                    timesteps=options.timesteps or defaults.timesteps,
                )
                for number, each in enumerate(parameters, first)
            ]
            scores = _scores(judge, chosen, options, store)
            for number, score in enumerate(scores, first):
                k = number - first
                state = optuna.trial.TrialState.FAIL if score.median is None else optuna.trial.TrialState.COMPLETE
                study.tell(asked[k], score.median, state)
                trials.append(Trial(number, chosen[k].seed, parameters[k], score))
                write_text(opened.folder / "trials.csv", rows(trials))
                write_text(opened.folder / "study.md", trials_table(trials))
                console.print(f"trial {number}: {trials[-1].cells[0]} {score.failure}".rstrip())
                progress.advance(bar)
    return trials


def _scores(
    judge: Judge, chosen: Sequence[LearningOptions], options: Options, store: JobStore[Score]
) -> Iterable[Score]:
    """Scores of trials that were drawn together: one after another in this process, or where it was asked for."""

    def key(one: LearningOptions) -> list[Any]:
        return [options.algorithm, to_mapping(one), options.source, options.number]

    if options.asked_for:
        return run_jobs(judge.score, chosen, key, store=store, where=options, description="trials drawn together")
    return (store.get(key(one), partial(judge.score, one)) for one in chosen)


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "train.tune", __doc__ or ""), PlainConsole()
        opened = open_jobs(options, "train.tune", "study.md")
        if opened.taken_up:
            opened.record(options)  # with the number of trials that is asked for now
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        try:
            best = best_of(search(options, opened, console))
        except KeyboardInterrupt:
            console.print("interrupted: the trials that ended are kept; the same command goes on from there")
            return 130
        table_of_all = opened.folder / "study.md"
        console.print(f"best: {best.cells[0]} with {best.parameters}; all trials: {table_of_all}")
    return 0
