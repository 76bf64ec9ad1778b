"""The source's four drives for any number of scenarios, found in parallel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rich.progress import Progress

from aframe_env.scenario import Scenario
from agents.drives.optimisation import OptimisedDrive, Optimiser
from agents.drives.tuned import TUNED, optimised
from train.tasks import run_tasks

DURATION: Final = 60.0


@dataclass(frozen=True)
class _Task:
    name: str
    scenario: Scenario
    optimiser: Optimiser


def _solve(task: _Task) -> OptimisedDrive:
    return optimised(TUNED[task.name], DURATION, task.scenario, task.optimiser)


def tune(
    names: Sequence[str],
    scenarios: Sequence[Scenario],
    *,
    optimiser: Optimiser = "nelder-mead",
    workers: int | None = None,
    progress: Progress | None = None,
) -> dict[str, list[OptimisedDrive]]:
    """Drives of those names for each scenario, over ``DURATION`` s."""
    tasks = [_Task(name, scenario, optimiser) for name in names for scenario in scenarios]
    found = run_tasks(_solve, tasks, workers=workers, progress=progress, description="optimising drives")
    count = len(scenarios)
    return {name: found[i * count : (i + 1) * count] for i, name in enumerate(names)}
