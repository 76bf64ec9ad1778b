"""Score policies on the tasks: ``python -m train.benchmark --tasks Storm --policies runs/mine "predictive control"``.

Every policy meets the same frozen scenarios. Its score is the share of the ceiling: its heave reduction over that of
the winch-limited optimum. Writes scores into leaderboard.json, which keeps the rows that it has, and draws README.md
and leaderboard.png of it; TASK/ceiling.json has the ceiling. What is finished is kept: the same command goes on after
an interruption.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from rich.console import Console
from rich.progress import Progress

from aframe_env.config import TaskConfig
from aframe_env.suite import TASKS, Task, find_task
from aframe_env.validation import InvalidValue, require_integer
from agents.registry import OPTIMUM, PolicySpec, choose_all
from train.benchmark import leaderboard, page
from train.benchmark.ceiling import ceiling_of
from train.benchmark.leaderboard import LeaderboardRow
from train.benchmark.measures import measures_of
from train.benchmark.specialists import forecasters, specialists
from train.evaluate.run import require_period, run_on
from train.evaluate.statistics import compare_families, family
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.jobs import Where
from train.shared.run_folder import Run, RunOptions, open_jobs, user_errors

POLICIES: Final = (
    "output zero on sensors",
    "feed-forward + feedback",
    "predictive control",
    "adaptive predictive control",
    "drive-map",
    "ppo-sensors",
    "sac-sensors",
    "predictive-ppo-sensors",
    "output zero",
    "feed-forward + feedback (state)",
    "predictive control (state)",
    "drive-map:state",
    "ppo",
    "sac",
    "predictive-ppo",
    "inverse dynamics",
)


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, Where):
    """Tasks, and the policies that are scored on them."""

    tasks: tuple[str, ...] = tuple(TASKS)
    """Tasks of the suite, by name."""
    policies: tuple[str, ...] = POLICIES
    """Names, folders of agents or module:function, as in train.evaluate; drum still and ceiling are always there. By
    default the laws, the agents that were trained on the nominal task, and those that were on the task at hand, with
    predictive control on their forecasts."""
    seeds: int | None = None
    """Of agents that differ in their seed alone the first so many; by default all."""
    split: Literal["test", "validation"] = "test"
    """Scenarios to score on: "validation" to choose by, "test" for what was chosen."""
    scenarios: int = 100
    """The first so many of the split; rows of a leaderboard that are to be compared have the same number."""
    leaderboard: Path | None = None
    """Leaderboard to add the rows to; by default leaderboard.json in the output folder."""
    by: str = ""
    """Who adds the rows: a name, a paper, a link."""

    def __post_init__(self) -> None:
        Where.__post_init__(self)
        require_integer("seeds", 1 if self.seeds is None else self.seeds, low=1, high=10_000)
        require_integer("scenarios", self.scenarios, low=1, high=20_000)
        if not self.tasks:
            raise InvalidValue(f"tasks = (): must be one or more of {', '.join(map(repr, TASKS))}")
        for name in self.tasks:
            find_task(name)


def chosen_for(task: Task, options: Options) -> list[PolicySpec]:
    """Policies that are scored on a task."""
    own = [*specialists(task), *forecasters(task)] if options.policies == POLICIES else []
    return first_seeds(choose_all([*options.policies, *own]), options.seeds)


def first_seeds(specs: list[PolicySpec], count: int | None) -> list[PolicySpec]:
    """Keep the first ``count`` of agents that differ in their seed alone; the optimum has a row anyway."""
    met: Counter[str] = Counter()
    kept = []
    for spec in specs:
        met[family(spec.name)] += 1
        if spec.name != OPTIMUM.name and (count is None or met[family(spec.name)] <= count):
            kept.append(spec)
    return kept


def digests(specs: list[PolicySpec]) -> dict[str, tuple[str, ...]]:
    """Digests of the files that policies come from, by their names without seeds."""
    found: dict[str, tuple[str, ...]] = {}
    for spec in specs:
        found[family(spec.name)] = (*found.get(family(spec.name), ()), *filter(None, [spec.digest]))
    return found


def score(task: Task, specs: list[PolicySpec], options: Options, opened: Run, console: Console) -> list[LeaderboardRow]:
    """Rows of a task; what is not finished yet is computed."""
    task.require_frozen(options.split)
    config = TaskConfig(**task.arguments)
    require_period(specs, config.control_period)
    with Progress(console=console) as bars:
        ceiling = ceiling_of(task, options.split, options.scenarios, opened.jobs, options, bars)
    ceiling.write(opened.folder / task.name.lower())
    scenarios = task.scenarios(options.split, options.scenarios)
    seed = task.seed(options.split)
    ran = run_on(specs, config, scenarios, console, seed=seed, jobs=opened.jobs, where=options)
    rows = compare_families(ran.entries, ran.still, ran.still.rms * (1.0 - ceiling.reductions))
    measures = measures_of(ran.entries, task.measures)
    return leaderboard.rows_of(task, ceiling, rows, measures, digests(specs), options.by, opened.command)


def run(options: Options, console: Console) -> int:
    """Compute, write, draw; return the exit status."""
    chosen = [(task := find_task(name), chosen_for(task, options)) for name in options.tasks]
    board = options.leaderboard
    if board is not None and not options.overwrite:
        for task, specs in chosen:
            leaderboard.require_room(board, [task], options.split, options.scenarios, digests(specs), options.by)
    opened = open_jobs(options, "train.benchmark", page.PAGE)
    board = board or opened.folder / leaderboard.NAME
    leaderboard.read(board)  # one that cannot be added to is refused before anything is computed
    try:
        rows = [row for task, specs in chosen for row in score(task, specs, options, opened, console)]
    except KeyboardInterrupt:
        console.print("interrupted: what is finished is kept; the same command goes on from there")
        return 130
    every = leaderboard.merged(leaderboard.read(board), rows, yardsticks=options.leaderboard is None)
    leaderboard.write(board, every)
    for folder in dict.fromkeys((board.parent, opened.folder)):
        page.write_page(folder, every)
    opened.finish()
    console.print(page.page(leaderboard.merged([], rows)), soft_wrap=True)
    console.print(f"written: {board}, {board.parent / page.PAGE}")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.benchmark", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
