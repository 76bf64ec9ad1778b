"""The comparison at the end of a training: the agent against the drum still and the paper's drives."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from aframe_env import task
from aframe_env.scenario import ScenarioDistribution
from agents.drive_map import DriveMap
from agents.drive_map_policy import DriveMapPolicy
from agents.drive_policy import DrivePolicy
from agents.policy import DrumStill, Knowledge, Policy
from agents.rollout import held_out_scenarios, run
from train.comparison import Entry, compare, rich_table, write_comparison
from train.figures import comparison_figure
from train.tuned_drives import DURATION, TUNED, tune

FOR_EACH = ("S-Ω1", "H-Ω1")
"""Drives that are optimised once more for each of the first scenarios."""


def evaluate(
    policy: Policy,
    folder: Path,
    count: int,
    privileged: int,
    console: Console,
    *,
    model: str = "simplified",
    rfem_modes: int | None = None,
    drive_map: DriveMap | None = None,
) -> None:
    """Run every policy over ``count`` held-out scenarios and write the comparison into ``folder``.

    The drives of the first ``privileged`` scenarios are optimised once more with the scenario's future known; always
    on the simplified model, whatever the ``model`` that the policies then run on.
    """
    distribution = ScenarioDistribution()
    scenarios = held_out_scenarios(distribution, count)
    observation: task.Observation = "state" if policy.knows is Knowledge.STATE else "sensors"
    with Progress(console=console) as progress:
        nominal = tune(tuple(TUNED), [distribution.nominal()], progress=progress)
        known = tune(FOR_EACH, scenarios[:privileged], progress=progress) if privileged else {}
        policies: list[Policy] = [DrumStill(), policy]
        for name, drives in nominal.items():
            policies.append(DrivePolicy(name=name, drives=drives * count))
        if drive_map is not None:
            policies.append(DriveMapPolicy(drive_map, duration=DURATION))
        for name, drives in known.items():
            policies.append(DrivePolicy(name=f"{name} for each scenario", drives=drives, knows=Knowledge.FUTURE))
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
