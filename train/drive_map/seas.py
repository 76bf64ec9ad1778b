"""The map's drives in the environment, in three kinds of sea, beside drives optimised for each scenario."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Final

from rich.progress import Progress

from aframe_env.scenario import ScenarioDistribution
from agents.drives.map import DriveMap
from agents.drives.map_policy import DriveMapPolicy
from agents.drives.policy import DrivePolicy
from agents.policy import DrumStill, Knowledge, Policy
from agents.rollout import held_out_scenarios, run
from train.evaluate.statistics import Entry, Row, compare
from train.evaluate.tables import write_comparison
from train.shared.tuned_drives import DURATION, tune

KINDS: Final[dict[str, ScenarioDistribution]] = {
    "regular waves": ScenarioDistribution(components=1),
    "swell": ScenarioDistribution(tp=(12.0, 18.0), gamma=10.0),
    "random seas": ScenarioDistribution(),
}
"""Load mass, rope length and heading are drawn alike in all of them; swell is as narrow as JONSWAP goes."""


@dataclass(frozen=True)
class InSea:
    """Results of the policies in one kind of sea."""

    kind: str
    entries: Sequence[Entry]
    """The drum still first."""
    rows: Sequence[Row]


def compare_in(
    drive_map: DriveMap, folder: Path, scenarios: int, workers: int | None, progress: Progress
) -> list[InSea]:
    """Run every policy over ``scenarios`` held-out scenarios of each kind, and write a folder for each."""
    drawn = {kind: held_out_scenarios(distribution, scenarios) for kind, distribution in KINDS.items()}
    every = [scenario for each in drawn.values() for scenario in each]
    best = iter(tune(("S-Ω1",), every, optimiser="gauss-newton", workers=workers, progress=progress)["S-Ω1"])
    bar = progress.add_task("seas", total=4 * len(KINDS))
    found = []
    for kind, met in drawn.items():
        policies: list[Policy] = [
            DrumStill(),
            DriveMapPolicy(drive_map, duration=DURATION),
            DriveMapPolicy(drive_map, None, duration=DURATION),
            DrivePolicy("S-Ω1 for each scenario", list(islice(best, scenarios)), Knowledge.FUTURE),
        ]
        entries = []
        for policy in policies:
            entries.append(Entry(policy.name, policy.knows, run(policy, met, episode_duration=DURATION)))
            progress.advance(bar)
        rows = compare(entries, entries[0].episodes)
        write_comparison(folder / kind.replace(" ", "-"), rows, entries)
        found.append(InSea(kind, entries, rows))
    return found
