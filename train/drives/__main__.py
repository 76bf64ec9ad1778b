"""Optimise drum drives for one scenario, as in the paper's section 4: ``python -m train.drives --case paper``.

Writes summary.json and summary.csv (figures of merit), drives.json (decision variables), histories.csv, pictures, and
notes.md (assumptions, and differences from the paper) into the output folder.
"""

from __future__ import annotations

import sys

from rich.box import SIMPLE
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

import aframe_env
import agents
import train.drives
from aframe_env.scenario.file import read_scenario, scenario_text
from agents.drives.optimisation import OptimisedDrive
from agents.drives.optimisation import Progress as SearchProgress
from train.drives.experiment import PAPER_DAMPING_RATIO, Options, checked, paper_case, solve, variants
from train.drives.figures import draw
from train.drives.notes import notes
from train.drives.results import HEADINGS, Transfer, write_results
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.job_store import JobStore, version_of
from train.shared.run_folder import open_jobs, user_errors, write_text


def run(options: Options, console: Console) -> int:
    """Optimise, write, print; return the exit status."""
    scenario = paper_case() if options.scenario is None else read_scenario(options.scenario)
    opened = open_jobs(options, "train.drives", "notes.md", seed=options.seed)
    folder, command = opened.folder, opened.command
    version = version_of(aframe_env, agents, train.drives)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:,} {task.fields[unit]}"),
        TimeElapsedColumn(),
    )
    with (
        Progress(*columns, console=console) as bars,
        JobStore(opened.jobs, OptimisedDrive, version) as drives,
        JobStore(opened.jobs, Transfer, version) as transfers,
    ):

        def follow(label: str) -> SearchProgress:
            bar = bars.add_task(label, total=options.max_evaluations, unit="evaluations")
            return lambda count, best: bars.update(bar, completed=count, unit=f"evaluations, best {best:.4g}")

        try:
            experiment = solve(scenario, options, follow, drives)
            for bar in bars.task_ids:
                bars.update(bar, total=bars.tasks[bar].completed)
            if options.check is not None:
                experiment = checked(scenario, options.duration, experiment, bars, transfers)
            others = variants(options, bars, drives) if options.scenario is None else []
        except KeyboardInterrupt:
            console.print("interrupted: what is finished is kept; the same command goes on from there")
            return 130
    write_results(folder, experiment, options.free_start)
    winch = scenario.crane.winch
    draw(folder, scenario.target_level, winch.drum_radius, experiment)
    write_text(folder / "scenario.toml", scenario_text(scenario))
    write_text(folder / "notes.md", notes(command, winch, experiment, others, PAPER_DAMPING_RATIO))
    opened.finish()
    table = Table(title=f"Optimised drives over {options.duration:g} s", box=SIMPLE, padding=0)
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading == "drive" else "right", no_wrap=True)
    for result in experiment.results:
        table.add_row(*result.row.cells)
    console.print(table)
    console.print(f"written: {folder} (notes.md says what was assumed)")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.drives", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
