"""The source's four drives, S-Ω1, S-Ω2, H-Ω1 and H-Ω2, for any number of scenarios."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rich.progress import Progress

from aframe_env.scenario import Scenario
from agents.optimisation import Family, ObjectiveName, OptimisedDrive, Optimiser, optimise
from train.tasks import run_tasks

DURATION: Final = 60.0


@dataclass(frozen=True)
class Tuned:
    """A family of drives, tuned for an objective."""

    family: Family
    objective: ObjectiveName


TUNED: Final[dict[str, Tuned]] = {
    "S-Ω1": Tuned("spline", "omega1"),
    "S-Ω2": Tuned("spline", "omega2"),
    "H-Ω1": Tuned("harmonic", "omega1"),
    "H-Ω2": Tuned("harmonic", "omega2"),
}
"""By the source's names."""


@dataclass(frozen=True)
class _Task:
    name: str
    scenario: Scenario
    optimiser: Optimiser


def _solve(task: _Task) -> OptimisedDrive:
    tuned = TUNED[task.name]
    return optimise(tuned.family, task.scenario, tuned.objective, DURATION, optimiser=task.optimiser)


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
