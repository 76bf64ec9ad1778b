"""The drives of one scenario, as in the paper's section 4: the search, the full model, other starts and dampings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from rich.progress import Progress

from aframe_env.rfem.simulate import Drum, DynamicCase, PrescribedDrum, StillDrum, simulate
from aframe_env.scenario import Initial, Scenario
from aframe_env.validation import InvalidValue, require_choice, require_integer, require_number
from agents.drives.functions import Drive
from agents.drives.guesses import required_angle
from agents.drives.objectives import FINE_STEP, Objective, coarse_step
from agents.drives.optimisation import (
    FAMILIES,
    OBJECTIVES,
    OPTIMISERS,
    Family,
    ObjectiveName,
    OptimisedDrive,
    Optimiser,
    optimise,
)
from agents.drives.optimisation import Progress as SearchProgress
from agents.policy import FloatArray
from train.drives.notes import Variant
from train.drives.results import Experiment, Result, SummaryRow, Transfer
from train.shared.job_store import JobStore
from train.shared.run_folder import RunOptions

STEP = 2.5e-3
"""Step of the full model, s."""
OUTPUT_INTERVAL = 0.01
"""Output interval of the full model, s."""
PAPER_DAMPING_RATIO = 0.03
"""Damping of the load's bobbing on the rope in ``--case paper``, share of critical: the middle of the range that
scenarios are drawn from. The paper states no figure."""
VARIANTS: tuple[tuple[Initial, float, bool], ...] = (
    ("rest", PAPER_DAMPING_RATIO, True),
    ("rest", 0.0, False),
    ("rest", 0.05, False),
    ("comoving", PAPER_DAMPING_RATIO, False),
    ("comoving", 0.0, False),
)
"""Other starts of the load, rope dampings and starts of the drum (free or not) that the notes show."""


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions):
    """Drives to optimise, and the scenario."""

    case: Literal["paper"] | None = None
    """A case by name; "paper" (the default when there is no --scenario) is the paper's section 4."""
    scenario: Path | None = None
    """Any scenario, from a TOML file."""
    drive: Literal["spline", "harmonic", "both"] = "both"
    """Family of drives."""
    objective: Literal["omega1", "omega2", "both"] = "both"
    """Objective to minimise: omega1 = ∫(x−h)² dt, omega2 = max|x−h|."""
    optimiser: Optimiser = "nelder-mead"
    """Optimiser for Ω1: the paper's Nelder-Mead, or Gauss-Newton. Ω2 is Nelder-Mead's in either case."""
    duration: float = 36.0
    """Duration t_k of the drive, s."""
    intervals: int = 18
    """Intervals of the spline."""
    harmonics: int = 1
    """Harmonics of the pseudo-harmonic drive."""
    free_start: bool = False
    """Take φ_H⁰ and A_0 as decision variables, too, as the paper does: the drum may have moved the load before the
    start."""
    max_evaluations: int = 20_000
    """Greatest number of evaluations of the objective for each drive."""
    seed: int = 0
    """Seed of the restarts' simplexes."""
    check: Literal["rfem"] | None = None
    """Model to run the drives in once more: "rfem" is the full one, with the frame flexible."""

    def __post_init__(self) -> None:
        if self.case is not None and self.scenario is not None:
            raise InvalidValue("case, scenario: give one of the two")
        if self.free_start and self.check is not None:
            raise InvalidValue("free_start, check: give one of the two: the full model's drum starts at 0")
        require_choice("drive", self.drive, (*FAMILIES, "both"))
        require_choice("objective", self.objective, (*OBJECTIVES, "both"))
        require_choice("optimiser", self.optimiser, OPTIMISERS)
        require_number("duration", self.duration, "s", low=0.1, high=3600.0)
        require_integer("intervals", self.intervals, low=3, high=500)
        require_integer("harmonics", self.harmonics, low=1, high=64)
        require_integer("max_evaluations", self.max_evaluations, low=1, high=10**9)
        require_integer("seed", self.seed, low=0, high=2**32 - 1)

    @property
    def families(self) -> tuple[Family, ...]:
        """Families asked for."""
        return FAMILIES if self.drive == "both" else (self.drive,)

    @property
    def objectives(self) -> tuple[ObjectiveName, ...]:
        """Objectives asked for."""
        return OBJECTIVES if self.objective == "both" else (self.objective,)


def paper_case(initial: Initial = "rest", damping_ratio: float = PAPER_DAMPING_RATIO) -> Scenario:
    """Scenario of ``--case paper``, or a variant of it."""
    scenario = Scenario.paper(initial=initial)
    critical = 2.0 * scenario.moved_mass * scenario.rope_frequency
    return replace(scenario, rope_damping=damping_ratio * critical)


def solve(
    scenario: Scenario,
    options: Options,
    follow: Callable[[str], SearchProgress | None],
    store: JobStore[OptimisedDrive] | None = None,
) -> Experiment:
    """Leave the drum still, and find every drive asked for; ``store`` keeps them.

    ``follow`` is called with a drive's label and returns the callback for its search's progress.
    """
    objective = Objective(scenario, options.duration, min(FINE_STEP, coarse_step(scenario)))
    times, error = objective.trajectory()
    still = objective.still()
    row = SummaryRow("still", None, still.omega1, still.omega2, still.rms, still.amplitude, 0, 0.0)
    results = [Result(row, None, error)]
    for family in options.families:
        for name in options.objectives:
            search: dict[str, Any] = {
                "family": family,
                "scenario": scenario,
                "objective": name,
                "duration": options.duration,
                "intervals": options.intervals,
                "harmonics": options.harmonics,
                "seed": options.seed,
                "max_evaluations": options.max_evaluations,
                "optimiser": options.optimiser,
                "free_start": options.free_start,
            }
            find = partial(optimise, **search, progress=follow(f"{family[0].upper()}-Ω{name[-1]}"))
            found = find() if store is None else store.get(search, find)
            row = SummaryRow(
                family,
                name,
                found.omega1,
                found.omega2,
                found.rms,
                found.amplitude,
                found.evaluations,
                round(found.seconds, 3),
            )
            results.append(Result(row, found.drive, objective.trajectory(found.drive)[1]))
    return Experiment(times, required_angle(objective)[::2], tuple(results))


def checked(
    scenario: Scenario, duration: float, experiment: Experiment, bars: Progress, store: JobStore[Transfer]
) -> Experiment:
    """Run every drive in the full model too; ``store`` keeps what comes of them."""
    bar = bars.add_task("full model", total=len(experiment.results), unit="runs")
    results = []
    for result in experiment.results:
        key = [scenario, duration, result.drive]
        results.append(replace(result, full=store.get(key, partial(transfer, scenario, duration, result))))
        bars.advance(bar)
    return replace(experiment, results=tuple(results))


def transfer(scenario: Scenario, duration: float, result: Result) -> Transfer:
    """Run a drive, or the drum still, in the full model for ``duration`` s; the drum follows the drive exactly."""
    case = DynamicCase(
        scenario=scenario,
        drum=StillDrum() if result.drive is None else _prescribed(result.drive),
        duration=duration,
        step=STEP,
        output_interval=OUTPUT_INTERVAL,
    )
    run = simulate(case)
    return Transfer(run.time, run.load[:, 2] - scenario.target_level)


def _prescribed(drive: Drive) -> Drum:
    def at(function: Callable[[float], FloatArray]) -> Callable[[float], float]:
        return lambda time: float(function(min(time, drive.duration)))

    return PrescribedDrum(angle=at(drive.angle), rate=at(drive.speed))


def variants(options: Options, bars: Progress, store: JobStore[OptimisedDrive]) -> list[Variant]:
    """Solve the paper's case with other starts and rope dampings, which the paper does not state."""
    found = []
    bar = bars.add_task("other starts and dampings", total=len(VARIANTS), unit="variants")
    for initial, ratio, free in VARIANTS:
        experiment = solve(
            paper_case(initial, ratio), replace(options, free_start=free, check=None), lambda label: None, store
        )
        found.append(Variant(initial, ratio, free, experiment.results))
        bars.advance(bar)
    return found
