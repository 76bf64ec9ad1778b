"""Search for a learner's hyper-parameters: ``python -m train.tune --algorithm ppo --out runs/tune-ppo``.

Optuna's tree-structured Parzen estimator, for the greatest median heave reduction over validation scenarios, which are
neither those of training nor the held-out ones. The first trial is the defaults. Every trial is kept as it ends:
call again with the same folder to go on after an interruption, or for more trials.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import optuna
from optuna.storages.journal import JournalFileBackend
from rich.console import Console
from rich.progress import Progress

from aframe_env.scenario import Scenario, ScenarioSource
from aframe_env.text import read_toml
from aframe_env.validation import InvalidValue, require_choice, require_integer
from agents.policy import DrumStill
from agents.rollout import HELD_OUT_SEED, drawn_scenarios, run
from train.learn.learner import Search
from train.learn.registry import LEARNERS, find_learner
from train.learn.trained import to_policy
from train.shared.cli import parse, to_mapping, to_toml
from train.shared.console import PlainConsole
from train.shared.markdown import table
from train.shared.run_folder import command_line, user_errors, versions, write_json, write_text
from train.shared.scenarios import ScenarioOptions

VALIDATION_SEED: Final = 7_000_001
"""Seed of the scenarios that trials are judged by."""


@dataclass(frozen=True, kw_only=True)
class Options(ScenarioOptions):
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
    seed: int = 0
    """Seed of the search; trial k learns with seed + k, so that no seed is tuned for."""
    out: Path = Path("runs/tune")
    """Output folder, or that of a search to go on with."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_choice("algorithm", self.algorithm, tuple(LEARNERS))
        if find_learner(self.algorithm).search is None:
            raise InvalidValue(f"algorithm = {self.algorithm!r}: has no search space in its SPEC")
        require_integer("trials", self.trials, low=1, high=10**6)
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


def trials_table(study: optuna.Study, names: list[str]) -> str:
    """Finished trials as Markdown, the best first."""
    done = study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.COMPLETE,))
    lines = []
    for trial in sorted(done, key=lambda t: -(t.value or 0.0)):
        which = f"{trial.number}{' (defaults)' if trial.number == 0 else ''}"
        values = [f"{trial.params[name]:.3g}" for name in names]
        lines.append([which, f"{trial.value:.2%}", f"{trial.user_attrs['fifth']:.2%}", *values])
    return table(["trial", "median heave reduction", "fifth percentile", *names], lines)


def rows(study: optuna.Study, names: list[str]) -> str:
    """Finished trials as CSV, in their order."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["trial", "median", "fifth", "seed", *names])
    for trial in study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.COMPLETE,)):
        values = [f"{trial.params[name]:.6g}" for name in names]
        attributes = trial.user_attrs
        writer.writerow([trial.number, f"{trial.value:.6f}", f"{attributes['fifth']:.6f}", attributes["seed"], *values])
    return text.getvalue()


def search(options: Options, console: Console) -> optuna.Study:
    """Run the trials that are still to be run, and write the tables after each."""
    spec = find_learner(options.algorithm)
    assert spec.search is not None
    space, defaults = spec.search, spec.options()
    names = space.names
    scenarios = validation_scenarios(options.source, options.number)
    still = run(DrumStill(), scenarios, defaults.config).rms
    storage = optuna.storages.JournalStorage(JournalFileBackend(str(options.out / "journal.log")))
    study = optuna.create_study(
        storage=storage,
        study_name=f"{options.algorithm}-{options.observation}",
        direction="maximize",
        load_if_exists=True,
    )
    # A search that goes on must not draw its first trials again.
    study.sampler = optuna.samplers.TPESampler(seed=options.seed + len(study.trials))
    if not study.trials:
        study.enqueue_trial({name: getattr(defaults, name) for name in names})

    def score(trial: optuna.Trial) -> float:
        changes = suggest(trial, space)
        seed = options.seed + trial.number
        timesteps = options.timesteps or defaults.timesteps
        chosen = replace(
            defaults,
            **changes,
            scenarios=options.scenarios if isinstance(options.scenarios, Path) else None,
            observation=options.observation,
            seed=seed,
            timesteps=timesteps,
        )
        learner = spec.build(chosen)
        learner.model.learn(timesteps)
        policy, _ = to_policy(learner, chosen)
        reduction = 1.0 - run(policy, scenarios, chosen.config).rms / still
        trial.set_user_attr("seed", seed)
        trial.set_user_attr("fifth", float(np.quantile(reduction, 0.05)))
        return float(np.median(reduction))

    done = len(study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.COMPLETE,)))
    with Progress(console=console) as progress:
        bar = progress.add_task("trials", total=max(options.trials, done), completed=done)

        def ended(study: optuna.Study, trial: optuna.trial.FrozenTrial) -> None:
            write_text(options.out / "trials.csv", rows(study, names))
            write_text(options.out / "study.md", trials_table(study, names))
            console.print(f"trial {trial.number}: {trial.value:.2%}; best {study.best_value:.2%}")
            progress.advance(bar)

        study.optimize(score, n_trials=max(0, options.trials - done), callbacks=[ended])
    return study


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "train.tune", __doc__ or ""), PlainConsole()
        config = options.out / "config.toml"
        same = replace(options, trials=1)
        if config.exists() and not (options.out / "journal.log").exists():
            raise InvalidValue(f"out = {str(options.out)!r}: holds something else than a search; choose another")
        if config.exists() and read_toml(config, "config") != to_mapping(same):
            raise InvalidValue(f"out = {str(options.out)!r}: a search with other options; see its config.toml")
        options.out.mkdir(parents=True, exist_ok=True)
        write_text(config, to_toml(same))
        write_json(options.out / "run.json", {"command": command_line("train.tune"), "versions": versions()})
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        try:
            study = search(options, console)
        except KeyboardInterrupt:
            console.print("interrupted: the trials that ended are kept; call again to go on")
            return 130
        console.print(f"best: {study.best_value:.2%} with {study.best_params}; all trials: {options.out / 'study.md'}")
    return 0
