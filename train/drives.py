"""Optimise drum drives for one scenario, as in the source's section 4: ``python -m train.drives --case paper``.

Writes summary.json and summary.csv (figures of merit), drives.json (decision variables), histories.csv, pictures, and
notes.md (what was assumed, and where it differs from the source) into the output folder.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Literal

from rich.box import SIMPLE
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from aframe_env.scenario import Initial, Scenario
from aframe_env.scenario.file import read_scenario, scenario_text
from aframe_env.validation import InvalidValue, require_choice, require_integer, require_number
from agents.drives.objectives import FINE_STEP, Objective, coarse_step
from agents.drives.optimisation import (
    FAMILIES,
    OBJECTIVES,
    OPTIMISERS,
    Family,
    ObjectiveName,
    Optimiser,
    optimise,
    required_angle,
)
from agents.drives.optimisation import Progress as SearchProgress
from train.config import parse
from train.drive_experiment.figures import draw
from train.drive_experiment.full_model import transfer
from train.drive_experiment.notes import Variant, notes
from train.drive_experiment.results import HEADINGS, Experiment, Result, SummaryRow, write_results
from train.output import new_folder, user_errors, versions, write_json, write_text

PAPER_DAMPING_RATIO = 0.03
"""Damping of the load's bobbing on the rope in ``--case paper``, share of critical: the middle of the range that
scenarios are drawn from. The source states no figure."""
VARIANTS: tuple[tuple[Initial, float], ...] = (
    ("rest", 0.0),
    ("rest", 0.05),
    ("comoving", PAPER_DAMPING_RATIO),
    ("comoving", 0.0),
)
"""Other starts of the load and rope dampings that the notes show."""


@dataclass(frozen=True)
class Options:
    """What to optimise, and for which scenario."""

    case: Literal["paper"] | None = None
    """A case by name; "paper" (the default when there is no --scenario) is the source's section 4."""
    scenario: Path | None = None
    """Any scenario, from a TOML file."""
    drive: Literal["spline", "harmonic", "both"] = "both"
    """Family of drives."""
    objective: Literal["omega1", "omega2", "both"] = "both"
    """What is made least: omega1 = ∫(x−h)² dt, omega2 = max|x−h|."""
    optimiser: Optimiser = "nelder-mead"
    """What finds the least Ω1: the source's Nelder-Mead, or Gauss-Newton. Ω2 is Nelder-Mead's in either case."""
    duration: float = 36.0
    """How long the drive runs, s."""
    intervals: int = 18
    """Intervals of the spline."""
    harmonics: int = 1
    """Harmonics of the pseudo-harmonic drive."""
    max_evaluations: int = 20_000
    """Most evaluations of the objective for each drive."""
    seed: int = 0
    """Turns the simplexes of the restarts."""
    check: Literal["rfem"] | None = None
    """Model to run the drives in once more: "rfem" is the full one, with the frame flexible."""
    out: Path | None = None
    """Output folder; by default runs/drives-DATE-TIME."""
    overwrite: bool = False
    """Write into the output folder even if it has something in it."""

    def __post_init__(self) -> None:
        if self.case is not None and self.scenario is not None:
            raise InvalidValue("case, scenario: give one of the two")
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
    critical = 2.0 * scenario.load_mass * scenario.rope_frequency
    return replace(scenario, rope_damping=damping_ratio * critical)


def solve(scenario: Scenario, options: Options, follow: Callable[[str], SearchProgress | None]) -> Experiment:
    """Leave the drum still, and find every drive asked for.

    ``follow`` is called with a drive's label and returns what its search reports its progress to.
    """
    objective = Objective(scenario, options.duration, min(FINE_STEP, coarse_step(scenario)))
    times, error = objective.trajectory()
    still = objective.still()
    row = SummaryRow("still", None, still.omega1, still.omega2, still.rms, still.amplitude, 0, 0.0)
    results = [Result(row, None, error)]
    for family in options.families:
        for name in options.objectives:
            found = optimise(
                family,
                scenario,
                name,
                options.duration,
                options.intervals,
                options.harmonics,
                options.seed,
                options.max_evaluations,
                follow(f"{family[0].upper()}-Ω{name[-1]}"),
                optimiser=options.optimiser,
            )
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


def checked(scenario: Scenario, duration: float, experiment: Experiment, bars: Progress) -> Experiment:
    """Run every drive in the full model too."""
    bar = bars.add_task("full model", total=len(experiment.results), unit="runs")
    results = []
    for result in experiment.results:
        results.append(replace(result, full=transfer(scenario, duration, result)))
        bars.advance(bar)
    return replace(experiment, results=tuple(results))


def variants(options: Options, bars: Progress) -> list[Variant]:
    """The paper's case with other starts and rope dampings, which the source does not state."""
    found = []
    bar = bars.add_task("other starts and dampings", total=len(VARIANTS), unit="variants")
    for initial, ratio in VARIANTS:
        experiment = solve(paper_case(initial, ratio), options, lambda label: None)
        found.append(Variant(initial, ratio, experiment.results))
        bars.advance(bar)
    return found


def run(options: Options, console: Console) -> int:
    """Optimise, print, write; return the exit status."""
    scenario = paper_case() if options.scenario is None else read_scenario(options.scenario)
    folder = new_folder(
        options.out or Path("runs") / f"drives-{datetime.now():%Y%m%d-%H%M%S}", overwrite=options.overwrite
    )
    command = shlex.join(["python", "-m", "train.drives", *sys.argv[1:]])
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:,} {task.fields[unit]}"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as bars:

        def follow(label: str) -> SearchProgress:
            bar = bars.add_task(label, total=options.max_evaluations, unit="evaluations")
            return lambda count, best: bars.update(bar, completed=count, unit=f"evaluations, best {best:.4g}")

        try:
            experiment = solve(scenario, options, follow)
            for bar in bars.task_ids:
                bars.update(bar, total=bars.tasks[bar].completed)
            if options.check is not None:
                experiment = checked(scenario, options.duration, experiment, bars)
            others = variants(options, bars) if options.scenario is None else []
        except KeyboardInterrupt:
            console.print("interrupted: nothing was written")
            return 130
    table = Table(title=f"Optimised drives over {options.duration:g} s", box=SIMPLE, padding=0)
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading == "drive" else "right", no_wrap=True)
    for result in experiment.results:
        table.add_row(*result.row.cells)
    console.print(table)
    write_results(folder, experiment)
    winch = scenario.crane.winch
    draw(folder, scenario.target_level, winch.drum_radius, experiment)
    write_text(folder / "notes.md", notes(command, winch, experiment, others, PAPER_DAMPING_RATIO))
    write_json(folder / "run.json", {"command": command, "seed": options.seed, "versions": versions()})
    write_text(folder / "scenario.toml", scenario_text(scenario))
    console.print(f"written: {folder} (notes.md says what was assumed)")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, __doc__ or ""), Console())


if __name__ == "__main__":
    sys.exit(main())
