"""Policies side by side on the same held-out scenarios, with the same noise: the run behind every comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Final, Literal

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from aframe_env import task
from aframe_env.flexible_engine import mesh_of
from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.validation import require_integer
from agents.drives.tuned import TUNED
from agents.policy import Knowledge, Policy
from agents.registry import DRUM_STILL, BuildContext, PolicySpec, as_spec, choose_all
from agents.rollout import Episodes, held_out_scenarios, run
from train.evaluate.figure import comparison_figure
from train.evaluate.statistics import Entry, Row, compare
from train.evaluate.tables import rich_table, write_comparison
from train.shared.jobs import run_jobs
from train.shared.tuned_drives import DURATION

CONTROL_PERIOD: Final = 0.1
AFTER_TRAINING: Final = (
    *TUNED,
    "feed-forward + feedback (state)",
    "feed-forward + feedback",
    "S-Ω1 for each scenario",
    "H-Ω1 for each scenario",
)
"""What an agent is compared with at the end of its training."""


@dataclass(frozen=True, kw_only=True)
class HeldOut:
    """On what policies are compared."""

    scenarios: int = 200
    """Held-out scenarios: the first so many of a series that training never draws from."""
    privileged: int = 20
    """The first so many of them for the drives that are optimised for each scenario, its whole future known."""
    observation: Literal["state", "sensors"] = "state"
    """What a policy sees that is not made for either; an agent sees what it was trained on."""
    model: Literal["simplified", "rfem"] = "simplified"
    """Model that the policies run on; drives are optimised on the simplified one."""
    rfem_modes: int | None = None
    """With rfem, the number of natural modes to keep; all by default."""

    def __post_init__(self) -> None:
        mesh_of(self.model, None, self.rfem_modes)
        require_integer("scenarios", self.scenarios, low=1, high=20_000)
        require_integer("privileged", self.privileged, low=0, high=self.scenarios)


@dataclass(frozen=True)
class Comparison:
    """Policies side by side; the first one is the drum still."""

    entries: tuple[Entry, ...]
    scenarios: tuple[Scenario, ...]
    held_out: HeldOut

    @property
    def still(self) -> Episodes:
        """The yardstick: the drum left alone."""
        return self.entries[0].episodes

    @cached_property
    def rows(self) -> list[Row]:
        """Every policy's figures."""
        return compare(self.entries, self.still)


def run_all(specs: Sequence[PolicySpec], held_out: HeldOut, console: Console) -> Comparison:
    """Run the drum still and every policy that was chosen over the held-out scenarios."""
    distribution = ScenarioDistribution()
    scenarios = held_out_scenarios(distribution, held_out.scenarios)
    first = scenarios[: held_out.privileged]
    entries = []
    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), console=console
    ) as progress:
        for spec in (DRUM_STILL, *(c for c in specs if c.name != DRUM_STILL.name)):
            mine = first if spec.for_each_scenario else scenarios
            if not mine:
                continue
            policy = spec.build(
                BuildContext(
                    scenarios=mine,
                    nominal=distribution.nominal(),
                    episode_duration=DURATION,
                    observation=held_out.observation,
                    spread=partial(run_jobs, progress=progress, description=f"{spec.name}: preparing"),
                )
            )
            bar = progress.add_task(spec.name, total=round(DURATION / CONTROL_PERIOD))
            episodes = run(
                policy,
                mine,
                observation=_observation(policy, held_out),
                control_period=CONTROL_PERIOD,
                episode_duration=DURATION,
                model=held_out.model,
                rfem_modes=held_out.rfem_modes,
                progress=lambda step, bar=bar: progress.update(bar, completed=step),  # type: ignore[misc]
            )
            entries.append(Entry(spec.name, policy.knows, episodes))
    return Comparison(tuple(entries), tuple(scenarios), held_out)


def _observation(policy: Policy, held_out: HeldOut) -> task.Observation:
    seen: dict[Knowledge, task.Observation] = {
        Knowledge.STATE: "state",
        Knowledge.FUTURE: "state",
        Knowledge.SENSORS: "sensors",
    }
    return seen.get(policy.knows, held_out.observation)


def write(folder: Path, comparison: Comparison, console: Console) -> None:
    """Write figures, table and picture of a comparison into a folder, and print the table."""
    console.print(rich_table(comparison.rows))
    write_comparison(folder, comparison.rows, comparison.entries)
    comparison_figure(folder / "comparison.png", comparison.entries, comparison.still)
    console.print(f"comparison: {folder / 'comparison.md'}, {folder / 'comparison.png'}")


def evaluate(policy: Policy, folder: Path, count: int, privileged: int, console: Console) -> None:
    """Compare an agent with the drum still and the paper's drives, and write the comparison into ``folder``."""
    held_out = HeldOut(scenarios=count, privileged=privileged)
    write(folder, run_all([as_spec(policy), *choose_all(AFTER_TRAINING)], held_out, console), console)
