"""Gauss-Newton beside Nelder-Mead, on the paper's case and on held-out seas: ``python -m train.optimisers``.

Writes comparison.json and comparison.md (evaluations and least Ω1 of each; then, under the winch's limits, how many
intervals and harmonics pay) and run.json into the output folder. Finished searches are kept: the same command goes on
after an interruption.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar, Final

import numpy as np
from rich.progress import Progress

import agents
from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario, ScenarioSource
from aframe_env.validation import require_integer
from agents.control.optimum import optimise as best_commands
from agents.control.optimum import saturating
from agents.drives.objectives import Objective, coarse_step
from agents.drives.optimisation import FAMILIES, OPTIMISERS, Family, Optimiser, optimise
from agents.drives.tuned import EVALUATIONS
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run
from train.drives.experiment import paper_case
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.job_store import JobStore, version_of
from train.shared.jobs import Where, run_jobs
from train.shared.markdown import table
from train.shared.run_folder import RunOptions, open_jobs, user_errors, write_json, write_text
from train.shared.scenarios import ScenarioOptions


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, Where, ScenarioOptions):
    """Size of the comparison."""

    bounds: ClassVar[tuple[int, int]] = (0, 10_000)
    scenarios: int | Path = 5
    """Number of held-out scenarios beside the paper's case; or a TOML file with a distribution of your own."""
    max_evaluations: int = 20_000
    """Most evaluations of the objective for each drive."""
    first_limited: int = 22
    """First held-out scenario of the second part: from here on some ask more of the winch than it has."""
    limited: int = 20
    """Number of held-out scenarios of the second part, under the winch's limits."""
    limited_evaluations: int = EVALUATIONS
    """Most evaluations of the objective for each drive of the second part."""

    def __post_init__(self) -> None:
        Where.__post_init__(self)
        ScenarioOptions.__post_init__(self)
        require_integer("max_evaluations", self.max_evaluations, low=1, high=10**9)
        require_integer("first_limited", self.first_limited, low=0, high=10**6)
        require_integer("limited", self.limited, low=0, high=10_000)
        require_integer("limited_evaluations", self.limited_evaluations, low=1, high=10**9)


@dataclass(frozen=True, kw_only=True)
class Search:
    """One search for the least Ω1."""

    scenario: int | None
    """Number of the held-out scenario; None for the paper's case."""
    family: Family
    optimiser: Optimiser
    max_evaluations: int


@dataclass(frozen=True)
class Found:
    """Result of a search."""

    search: Search
    variables: int
    """Number of decision variables."""
    still: float
    """Ω1 with the drum still, m² s."""
    omega1: float
    """m² s."""
    evaluations: int
    seconds: float


def solve(source: ScenarioSource, search: Search) -> Found:
    """Run a search: the paper's case as in the paper, a scenario of ``source`` with the comparison's drives."""
    if search.scenario is None:
        scenario, duration, intervals, harmonics = paper_case(), 36.0, 18, 1
    else:
        scenario = held_out_scenarios(source, search.scenario + 1)[-1]
        duration, intervals, harmonics = 60.0, 48, 8
    found = optimise(
        search.family,
        scenario,
        "omega1",
        duration,
        intervals,
        harmonics,
        max_evaluations=search.max_evaluations,
        optimiser=search.optimiser,
    )
    still = Objective(scenario, duration, coarse_step(scenario)).still().omega1
    return Found(search, len(found.drive.variables), still, found.omega1, found.evaluations, round(found.seconds, 3))


NUMBERS: Final[dict[Family, tuple[int, ...]]] = {"spline": (24, 48, 96, 144), "harmonic": (4, 8, 16, 24)}
"""Intervals and harmonics of the second part."""


@dataclass(frozen=True, kw_only=True)
class LimitedSearch:
    """One search for the least Ω1 under the winch's limits."""

    scenario: int
    """Number of the held-out scenario."""
    family: Family
    number: int
    """Intervals or harmonics."""
    optimiser: Optimiser
    max_evaluations: int


@dataclass(frozen=True)
class Played:
    """Result of a search under the winch's limits."""

    rms: float
    """m."""
    variables: int
    evaluations: int
    seconds: float


def solve_limited(source: ScenarioSource, search: LimitedSearch) -> Played:
    """Run a search on the task as it is by default."""
    config = TaskConfig()
    found = optimise(
        search.family,
        held_out_scenarios(source, search.scenario + 1)[-1],
        "omega1",
        config.duration,
        search.number if search.family == "spline" else 3,
        search.number if search.family == "harmonic" else 1,
        max_evaluations=search.max_evaluations,
        optimiser=search.optimiser,
        control_period=config.control_period,
    )
    return Played(found.rms, len(found.drive.variables), found.evaluations, round(found.seconds, 3))


def limited_markdown(scenarios: Sequence[Scenario], searches: Sequence[LimitedSearch], found: Sequence[Played]) -> str:
    """What each number of intervals or harmonics brings, as a table."""
    still = run(DrumStill(), scenarios).rms
    best = 1.0 - np.sqrt(best_commands(scenarios).omega1 / TaskConfig().duration) / still
    hard = saturating(scenarios)
    lines = []
    for i in range(0, len(searches), len(scenarios)):
        first, part = searches[i], found[i : i + len(scenarios)]
        reduction = 1.0 - np.array([each.rms for each in part]) / still
        share = reduction / best
        name = "intervals" if first.family == "spline" else "harmonics"
        lines.append(
            (
                f"{first.family}, {first.number} {name}",
                str(part[0].variables),
                first.optimiser,
                f"{np.median(reduction):.2%}",
                f"{reduction.mean():.2%}",
                f"{share.mean():.2%}",
                f"{share[hard].mean():.2%}" if hard.any() else "",
                f"{np.mean([each.evaluations for each in part]):,.0f}",
                f"{np.mean([each.seconds for each in part]):.2f}",
            )
        )
    heads = ("drive", "variables", "optimiser", "median", "mean", "share of the optimum", "where the winch saturates")
    return LIMITED.format(count=len(scenarios), hard=int(hard.sum())) + table(
        (*heads, "evaluations", "seconds a scenario"), lines
    )


def markdown(found: Sequence[Found]) -> str:
    """The comparison as a table: a row for each drive, the optimisers side by side."""
    pairs: dict[tuple[int | None, Family], dict[Optimiser, Found]] = {}
    for each in found:
        pairs.setdefault((each.search.scenario, each.search.family), {})[each.search.optimiser] = each
    heads = ["scenario", "drive", "variables", "Ω1 still, m² s"]
    for optimiser in OPTIMISERS:
        heads += [f"Ω1 {optimiser}, m² s", f"evaluations {optimiser}"]
    lines = []
    for (scenario, family), pair in pairs.items():
        first = pair[OPTIMISERS[0]]
        name = "paper" if scenario is None else f"held-out {scenario}"
        cells = [name, family, str(first.variables), f"{first.still:.4g}"]
        for optimiser in OPTIMISERS:
            cells += [f"{pair[optimiser].omega1:.4g}", f"{pair[optimiser].evaluations:,}"]
        lines.append(cells)
    return table(heads, lines)


INTRODUCTION = """\
# Gauss-Newton beside Nelder-Mead
Made by `{command}`. Both start from the same guess, the inverse of the geometry. Each neighbour of the drive that
gives a column of Gauss-Newton's Jacobian counts as an evaluation; at most {limit:,} are made.

"""


LIMITED = """
## Under the winch's limits
Heave reduction over {count} held-out scenarios, {hard} of which ask more of the winch than it has, and its share of the
winch-limited optimum's. A drive is judged by what the winch makes of it, from rest.

"""


def study_limits(options: Options, jobs: Path, progress: Progress) -> str:
    """Second part of comparison.md: drives under the winch's limits; finished searches are kept in ``jobs``."""
    numbers = range(options.first_limited, options.first_limited + options.limited)
    if not numbers:
        return ""
    searches = [
        LimitedSearch(
            scenario=scenario,
            family=family,
            number=number,
            optimiser=optimiser,
            max_evaluations=options.limited_evaluations,
        )
        for family in FAMILIES
        for number in NUMBERS[family]
        for optimiser in OPTIMISERS
        for scenario in numbers
    ]
    with JobStore(jobs, Played, version_of(agents)) as store:
        found = run_jobs(
            partial(solve_limited, options.source),
            searches,
            lambda search: [options.source, search],
            store=store,
            where=options,
            progress=progress,
            description="under the winch's limits",
        )
    scenarios = held_out_scenarios(options.source, numbers.stop)[numbers.start :]
    return limited_markdown(scenarios, searches, found)


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "train.optimisers", __doc__ or ""), PlainConsole()
        opened = open_jobs(options, "train.optimisers", "comparison.json")
        searches = [
            Search(scenario=scenario, family=family, optimiser=optimiser, max_evaluations=options.max_evaluations)
            for scenario in (None, *range(options.number))
            for family in FAMILIES
            for optimiser in OPTIMISERS
        ]
        try:
            with Progress(console=console) as progress, JobStore(opened.jobs, Found, version_of(agents)) as store:
                found = run_jobs(
                    partial(solve, options.source),
                    searches,
                    lambda search: [options.source, search],
                    store=store,
                    where=options,
                    progress=progress,
                    description="searches",
                )
                limited = study_limits(options, opened.jobs, progress)
        except KeyboardInterrupt:
            console.print("interrupted: what is finished is kept; the same command goes on from there")
            return 130
        text = INTRODUCTION.format(command=opened.command, limit=options.max_evaluations) + markdown(found) + limited
        write_text(opened.folder / "comparison.md", text)
        write_json(opened.folder / "comparison.json", [asdict(each) for each in found])
        opened.finish()
        console.print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
