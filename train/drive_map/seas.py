"""The map's drives in the environment, in three kinds of sea, beside drives optimised for each scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice

from rich.progress import Progress

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario, ScenarioSource
from agents.drives.map import DriveMap
from agents.drives.map_policy import DriveMapPolicy
from agents.drives.policy import DrivePolicy
from agents.drives.realtime_map import RealTimeMapPolicy
from agents.policy import DrumStill, Knowledge, Policy
from agents.rollout import held_out_scenarios, run
from train.evaluate.run import observation_of
from train.evaluate.statistics import Entry, Row, compare
from train.evaluate.tables import write_comparison
from train.shared.jobs import Where
from train.shared.run_folder import Run
from train.shared.scenarios import ScenarioOptions
from train.shared.tuned_drives import tune


def kinds_of(source: ScenarioSource) -> dict[str, ScenarioSource]:
    """Kinds of sea to run in: three of a distribution of seas; what is given, where it is none.

    Load mass, rope length and heading are drawn alike in all of them; swell is as narrow as JONSWAP goes.
    """
    if isinstance(source, Scenario) or source.records:
        return {"as given": source}
    return {
        "regular waves": replace(source, components=1),
        "swell": replace(source, tp=(12.0, 18.0), gamma=10.0),
        "random seas": source,
    }


@dataclass(frozen=True)
class InSea:
    """Results of the policies in one kind of sea."""

    kind: str
    entries: Sequence[Entry]
    """The drum still first."""
    rows: Sequence[Row]


def compare_in(
    drive_map: DriveMap, opened: Run, scenarios: ScenarioOptions, where: Where, progress: Progress
) -> list[InSea]:
    """Run every policy over held-out scenarios of each kind of sea, and write a folder for each."""
    kinds, config = kinds_of(scenarios.source), TaskConfig(scenario=scenarios.source)
    drawn = {kind: held_out_scenarios(source, scenarios.number) for kind, source in kinds.items()}
    every = [scenario for each in drawn.values() for scenario in each]
    tuned = tune(
        ("S-Ω1",), every, config.duration, opened.jobs, optimiser="gauss-newton", where=where, progress=progress
    )
    sensors = config.replaced(observation="sensors").sensors
    best = iter(tuned["S-Ω1"])
    bar = progress.add_task("seas", total=5 * len(kinds))
    found = []
    for kind, met in drawn.items():
        policies: list[Policy] = [
            DrumStill(),
            RealTimeMapPolicy(drive_map, sensors),
            DriveMapPolicy(drive_map, duration=config.duration),
            DriveMapPolicy(drive_map, None, duration=config.duration),
            DrivePolicy("S-Ω1 for each scenario", list(islice(best, len(met))), Knowledge.FUTURE),
        ]
        entries = []
        for policy in policies:
            episodes = run(policy, met, config.replaced(observation=observation_of(policy, config)))
            entries.append(Entry(policy.name, policy.knows, episodes))
            progress.advance(bar)
        rows = compare(entries, entries[0].episodes)
        write_comparison(opened.folder / kind.replace(" ", "-"), rows, rows, entries)
        found.append(InSea(kind, entries, rows))
    return found
