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


def evaluate(policy: Policy, folder: Path, count: int, privileged: int, console: Console) -> None:
    """Run every policy over ``count`` held-out scenarios and write the comparison into ``folder``.

    The drives of the first ``privileged`` scenarios are optimised once more with the scenario's future known.
    """
    distribution = ScenarioDistribution()
    scenarios = held_out_scenarios(distribution, count)
    observation: task.Observation = "state" if policy.knows is Knowledge.STATE else "sensors"
    with Progress(console=console) as progress:
        drives = optimise_all([distribution.nominal(), *scenarios[:privileged]], progress)
        entries = [_entry(DrumStill(), scenarios, observation, progress)]
        still = entries[0].episodes
        entries.append(_entry(policy, scenarios, observation, progress))
        for name, family in FAMILIES:
            nominal = DrivePolicy(name=name, drives=drives[family][:1] * count)
            entries.append(_entry(nominal, scenarios, observation, progress))
        for name, family in FAMILIES if privileged else ():
            known = DrivePolicy(name=f"{name} for each scenario", drives=drives[family][1:], knows=Knowledge.FUTURE)
            entries.append(_entry(known, scenarios[:privileged], observation, progress))
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


def _entry(policy: Policy, scenarios: Sequence[Scenario], observation: task.Observation, progress: Progress) -> Entry:
    bar = progress.add_task(policy.name, total=round(DURATION / 0.1))
    episodes = run(
        policy,
        scenarios,
        observation=observation,
        episode_duration=DURATION,
        progress=lambda step: progress.update(bar, completed=step),
    )
    return Entry(policy.name, policy.knows, episodes)
