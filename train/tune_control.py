"""Tune the gains of the control policies over training scenarios: ``python -m train.tune_control``.

Nelder-Mead on the logarithms of effort and, where the law has one, share, for the greatest mean share of what is
achievable: heave reduction 1 - RMS / RMS(drum still) over that of the winch-limited optimum. A mean, since the seas in
which the winch's limits are met are few, and it is there that gains differ by more than a hair.
"""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from rich.progress import Progress
from scipy.optimize import minimize

import aframe_env
import agents
from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.scenario import Sensors
from aframe_env.validation import InvalidValue, require_integer
from agents.control.expected_waves import ExpectedWaves
from agents.control.feedback import SENSOR_GAINS, STATE_GAINS, Feedback
from agents.control.inverse_dynamics import GAINS as INVERSE_GAINS
from agents.control.inverse_dynamics import InverseDynamics
from agents.control.optimum import optimise
from agents.control.predictive import SENSOR_EFFORT, STATE_EFFORT, PlanningConfig, PredictiveControl
from agents.control.regulator import Gains
from agents.policy import DrumStill, FloatArray, Policy
from agents.rollout import HELD_OUT_SEED, drawn_scenarios, run
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.job_store import JobStore, version_of
from train.shared.run_folder import RunOptions, open_jobs, user_errors, write_text
from train.shared.scenarios import ScenarioOptions

Name = Literal["state", "sensors", "predictive-state", "predictive-sensors", "inverse-dynamics"]


@dataclass(frozen=True)
class Tunable:
    """A policy of which the gains can be tuned, for a task's sensors and waves."""

    make: Callable[[Gains, Sensors, ExpectedWaves], Policy]
    observation: task.Observation
    start: Gains
    has_share: bool = True
    """False if the law makes no use of the gains' share."""


TUNABLE: dict[Name, Tunable] = {
    "state": Tunable(lambda gains, sensors, waves: Feedback(None, gains, waves), "state", STATE_GAINS),
    "sensors": Tunable(lambda gains, sensors, waves: Feedback(sensors, gains, waves), "sensors", SENSOR_GAINS),
    "predictive-state": Tunable(
        lambda gains, sensors, waves: PredictiveControl(PlanningConfig(sensors=None, effort=gains.effort, waves=waves)),
        "state",
        Gains(effort=STATE_EFFORT, share=1.0),
        has_share=False,
    ),
    "predictive-sensors": Tunable(
        lambda gains, sensors, waves: PredictiveControl(
            PlanningConfig(sensors=sensors, effort=gains.effort, waves=waves)
        ),
        "sensors",
        Gains(effort=SENSOR_EFFORT, share=1.0),
        has_share=False,
    ),
    "inverse-dynamics": Tunable(lambda gains, sensors, waves: InverseDynamics(gains), "state", INVERSE_GAINS),
}


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, ScenarioOptions):
    """Policies to tune, and size of the search."""

    policies: tuple[Name, ...] = tuple(TUNABLE)
    """Policies to tune."""
    scenarios: int | Path = 200
    """Number of training scenarios; or a TOML file with a scenario or a distribution of your own."""
    evaluations: int = 24
    """Gains to try for each policy."""
    seed: int = 1
    """Seed of the training scenarios; never that of the held-out ones."""
    out: Path | None = Path("runs/control")
    """Output folder."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_integer("evaluations", self.evaluations, low=1, high=10**6)
        require_integer("seed", self.seed, low=0, high=2**63 - 1)
        if self.seed == HELD_OUT_SEED:
            raise InvalidValue(f"seed = {self.seed}: is that of the held-out scenarios; choose another")


@dataclass(frozen=True)
class Trial:
    """Gains, and what came of them."""

    gains: Gains
    share: float
    """Mean share of what is achievable: what is sought."""
    mean: float
    """Mean heave reduction."""
    median: float
    """Median heave reduction."""
    fifth: float
    """Heave reduction that 95 % of the scenarios exceed."""
    worst: float
    """Least heave reduction."""


def study(name: Name, options: Options, store: JobStore[Trial], tried: Callable[[], object]) -> list[Trial]:
    """Every trial of the search for one policy's gains; ``tried`` is called after each. ``store`` keeps them."""
    tunable = TUNABLE[name]
    scenarios = drawn_scenarios(options.source, options.seed, options.number)
    config = TaskConfig(scenario=options.source)
    sensors = config.replaced(observation="sensors").sensors or Sensors()
    waves = ExpectedWaves.of(options.source)
    still = run(DrumStill(), scenarios).rms
    best = 1.0 - np.sqrt(optimise(scenarios, config).omega1 / config.duration) / still
    trials: list[Trial] = []

    def trial_of(gains: Gains) -> Trial:
        left = run(tunable.make(gains, sensors, waves), scenarios, observation=tunable.observation).rms / still
        return Trial(
            gains=gains,
            share=float(np.mean((1.0 - left) / best)),
            mean=float(np.mean(1.0 - left)),
            median=float(np.median(1.0 - left)),
            fifth=float(np.quantile(1.0 - left, 0.05)),
            worst=float(1.0 - left.max()),
        )

    def score(x: FloatArray) -> float:
        effort, share = np.clip(10.0 ** np.append(x, 0.0)[:2], (1e-7, 1e-3), (1e3, 1.0)).tolist()
        gains = Gains(effort=effort, share=share)
        trial = store.get([name, gains, config, options.seed, options.number], lambda: trial_of(gains))
        trials.append(trial)
        tried()
        return -trial.share

    start = np.log10([tunable.start.effort, tunable.start.share])
    simplex = start + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.5]])
    if not tunable.has_share:
        start, simplex = start[:1], simplex[:2, :1]
    minimize(
        score,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "maxfev": options.evaluations, "xatol": 0.02, "fatol": 1e-5},
    )
    return trials


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "train.tune_control", __doc__ or ""), PlainConsole()
        opened = open_jobs(options, "train.tune_control", "trials.csv")
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["policy", "effort_s2", "share", "share_of_optimum", "mean", "median", "fifth", "worst"])
        with (
            Progress(console=console) as progress,
            JobStore(opened.jobs, Trial, version_of(aframe_env, agents)) as store,
        ):
            for name in options.policies:
                bar = progress.add_task(name, total=options.evaluations)
                trials = study(name, options, store, partial(progress.advance, bar))
                for t in trials:
                    values = (t.gains.effort, t.gains.share, t.share, t.mean, t.median, t.fifth, t.worst)
                    writer.writerow([name, *(f"{v:.6g}" for v in values)])
                best = max(trials, key=lambda t: t.share)
                progress.update(bar, completed=options.evaluations)
                console.print(
                    f"{name}: {best.gains}: share of the optimum {best.share:.2%}, mean {best.mean:.2%}, "
                    f"median {best.median:.2%}, 5th percentile {best.fifth:.1%}, worst {best.worst:.1%}"
                )
        write_text(opened.folder / "trials.csv", text.getvalue())
        opened.finish()
    return 0


if __name__ == "__main__":
    sys.exit(main())
