"""Gauss-Newton beside Nelder-Mead, on the paper's case and on held-out seas: ``python -m train.optimisers``.

Writes comparison.json and comparison.md (evaluations and least Ω1 of each) and run.json into the output folder.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from rich.console import Console
from rich.progress import Progress

from aframe_env.scenario import ScenarioSource
from aframe_env.validation import require_integer
from agents.drives.objectives import Objective, coarse_step
from agents.drives.optimisation import FAMILIES, OPTIMISERS, Family, Optimiser, optimise
from agents.rollout import held_out_scenarios
from train.drives.experiment import paper_case
from train.shared.cli import parse
from train.shared.jobs import run_jobs
from train.shared.markdown import table
from train.shared.run_folder import RunOptions, open_run, user_errors, write_json, write_text
from train.shared.scenarios import ScenarioOptions


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, ScenarioOptions):
    """Size of the comparison."""

    bounds: ClassVar[tuple[int, int]] = (0, 10_000)
    scenarios: int | Path = 5
    """Number of held-out scenarios beside the paper's case; or a TOML file with a distribution of your own."""
    max_evaluations: int = 20_000
    """Most evaluations of the objective for each drive."""
    workers: int | None = None
    """Worker processes; by default one for each core."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_integer("max_evaluations", self.max_evaluations, low=1, high=10**9)


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


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "train.optimisers", __doc__ or ""), Console()
        opened = open_run(options, "train.optimisers")
        searches = [
            Search(scenario=scenario, family=family, optimiser=optimiser, max_evaluations=options.max_evaluations)
            for scenario in (None, *range(options.number))
            for family in FAMILIES
            for optimiser in OPTIMISERS
        ]
        try:
            with Progress(console=console) as progress:
                found = run_jobs(
                    partial(solve, options.source),
                    searches,
                    workers=options.workers,
                    progress=progress,
                    description="searches",
                )
        except KeyboardInterrupt:
            console.print("interrupted: nothing was written")
            return 130
        text = INTRODUCTION.format(command=opened.command, limit=options.max_evaluations) + markdown(found)
        console.print(text, soft_wrap=True, markup=False)
        write_text(opened.folder / "comparison.md", text)
        write_json(opened.folder / "comparison.json", [asdict(each) for each in found])
        opened.record(options)
    return 0


if __name__ == "__main__":
    sys.exit(main())
