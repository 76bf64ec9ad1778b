"""The paper's four drives for any number of scenarios, found in parallel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.progress import Progress

import agents
from aframe_env.scenario import Scenario
from agents.drives.optimisation import OptimisedDrive, Optimiser
from agents.drives.tuned import TUNED, optimised
from train.shared.job_store import JobStore, version_of
from train.shared.jobs import HERE, Where, run_jobs


@dataclass(frozen=True)
class _Job:
    name: str
    scenario: Scenario
    duration: float
    optimiser: Optimiser


def _solve(job: _Job) -> OptimisedDrive:
    return optimised(TUNED[job.name], job.duration, job.scenario, job.optimiser)


def tune(
    names: Sequence[str],
    scenarios: Sequence[Scenario],
    duration: float,
    store: Path,
    *,
    optimiser: Optimiser = "nelder-mead",
    where: Where = HERE,
    progress: Progress | None = None,
) -> dict[str, list[OptimisedDrive]]:
    """Drives of those names for each scenario, over ``duration`` s; what is found is kept in the file ``store``."""
    jobs = [_Job(name, scenario, duration, optimiser) for name in names for scenario in scenarios]
    with JobStore(store, OptimisedDrive, version_of(agents)) as drives:
        found = run_jobs(_solve, jobs, store=drives, where=where, progress=progress, description="optimising drives")
    count = len(scenarios)
    return {name: found[i * count : (i + 1) * count] for i, name in enumerate(names)}
