"""The comparison at the end of a training: the agent against the drum still and the paper's drives."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

from rich.console import Console
from rich.progress import Progress

from aframe_env import task
from aframe_env.scenario import Scenario, ScenarioDistribution
from agents.drive_policy import DrivePolicy
from agents.optimisation import OptimisedDrive, optimise
from agents.policy import DrumStill, Knowledge, Policy
from agents.rollout import held_out_scenarios, run
from train.comparison import Entry, compare, rich_table, write_comparison
from train.figures import comparison_figure

DURATION = 60.0
FAMILIES: tuple[tuple[str, Literal["spline", "harmonic"]], ...] = (("S-Ω1", "spline"), ("H-Ω1", "harmonic"))


def evaluate(
    policy: Policy,
    folder: Path,
    count: int,
    privileged: int,
    console: Console,
    *,
    model: str = "simplified",
    rfem_modes: int | None = None,
) -> None:
    """Run every policy over ``count`` held-out scenarios and write the comparison into ``folder``.

    The drives of the first ``privileged`` scenarios are optimised once more with the scenario's future known; always
    on the simplified model, whatever the ``model`` that the policies then run on.
    """
    distribution = ScenarioDistribution()
    scenarios = held_out_scenarios(distribution, count)
    observation: task.Observation = "state" if policy.knows is Knowledge.STATE else "sensors"
    with Progress(console=console) as progress:
        drives = optimise_all([distribution.nominal(), *scenarios[:privileged]], progress)
        policies: list[Policy] = [DrumStill(), policy]
        for name, family in FAMILIES:
            policies.append(DrivePolicy(name=name, drives=drives[family][:1] * count))
        for name, family in FAMILIES if privileged else ():
            known = drives[family][1:]
            policies.append(DrivePolicy(name=f"{name} for each scenario", drives=known, knows=Knowledge.FUTURE))
        entries = []
        for each in policies:
            bar = progress.add_task(each.name, total=round(DURATION / 0.1))
            episodes = run(
                each,
                scenarios[:privileged] if each.knows is Knowledge.FUTURE else scenarios,
                observation=observation,
                episode_duration=DURATION,
                model=model,
                rfem_modes=rfem_modes,
                progress=lambda step, bar=bar: progress.update(bar, completed=step),  # type: ignore[misc]
            )
            entries.append(Entry(each.name, each.knows, episodes))
    still = entries[0].episodes
    rows = compare(entries, still)
    console.print(rich_table(rows))
    write_comparison(folder, rows, entries)
    comparison_figure(folder / "comparison.png", entries, still)
    console.print(f"comparison: {folder / 'comparison.md'}, {folder / 'comparison.png'}")


def optimise_all(scenarios: Sequence[Scenario], progress: Progress) -> dict[str, list[OptimisedDrive]]:
    """Optimised drives for each scenario, by family."""
    bar = progress.add_task("optimising drives", total=len(FAMILIES) * len(scenarios))
    found: dict[str, list[OptimisedDrive]] = {}
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for _, family in FAMILIES:
            found[family] = []
            for drive in pool.map(partial(_optimise, family), scenarios):
                found[family].append(drive)
                progress.advance(bar)
    return found


def _optimise(family: Literal["spline", "harmonic"], scenario: Scenario) -> OptimisedDrive:
    return optimise(family, scenario, duration=DURATION)
