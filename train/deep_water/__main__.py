"""Study what deep water and heavy ropes do to control: ``python -m train.deep_water``.

Policies that were made for light ropes in air at several depths; the drive map made anew; and a load that is lowered
through its resonance. Writes zero_shot.csv, drive_map.csv, between_nodes.csv, lowering.csv, a picture of each, and
README.md. What is finished is kept: the same command goes on after an interruption.
"""

from __future__ import annotations

import itertools
import sys
from dataclasses import dataclass

from rich.console import Console
from rich.progress import Progress

import aframe_env
import agents
from aframe_env.validation import InvalidValue, require_integer, require_number
from train.deep_water import harmonics, lifts, passage, zero_shot
from train.deep_water.figures import draw_lowering, draw_map, draw_zero_shot
from train.deep_water.notes import Study, between_csv, lowering_csv, map_csv, readme, zero_shot_csv
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.job_store import JobStore, version_of
from train.shared.jobs import Where, run_jobs
from train.shared.run_folder import Run, RunOptions, open_jobs, user_errors, write_text


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, Where):
    """Size of the study."""

    depths: tuple[float, ...] = (300.0, 1000.0, 2000.0, 3000.0)
    """Depths below the pulley, m."""
    lifts: int = 24
    """Held-out lifts at each depth."""
    policies: tuple[str, ...] = zero_shot.POLICIES
    """Policies of the first part, the drum still among them, by their names."""
    amplitudes: tuple[float, ...] = (0.5, 2.0)
    """Heave amplitudes of the map, m."""
    periods: tuple[float, ...] = (5.0, 6.0, 7.0, 8.5, 10.0, 12.0, 15.0, 20.0)
    """Periods of the map, s."""
    masses: tuple[float, ...] = (30e3, 100e3)
    """Load masses of the map, kg."""
    top: float = 200.0
    """Depth from which the load is lowered, m."""
    bottom: float = 3000.0
    """Depth to which it is lowered, m."""
    speed: float = 1.0
    """Speed of the lowering, m/s."""

    def __post_init__(self) -> None:
        Where.__post_init__(self)
        for name, unit, low, high in (
            ("depths", "m", 50.0, 3100.0),
            ("amplitudes", "m", 1e-3, 20.0),
            ("periods", "s", 1.0, 100.0),
            ("masses", "kg", 1e3, 2e5),
        ):
            values: tuple[float, ...] = getattr(self, name)
            for value in values:
                require_number(name, value, unit, low=low, high=high)
            if len(values) < 2 or any(b <= a for a, b in itertools.pairwise(values)):
                raise InvalidValue(f"{name} = {values}: must be at least 2 rising values")
        unknown = set(self.policies) - set(zero_shot.POLICIES)
        if unknown or self.policies.count("drum still") != 1 or len(self.policies) < 2:
            raise InvalidValue(
                f"policies = {self.policies}: must be 'drum still' and one or more of "
                f"{', '.join(zero_shot.POLICIES[1:])}"
            )
        require_integer("lifts", self.lifts, low=2, high=10_000)
        require_number("top", self.top, "m", low=50.0, high=3000.0)
        require_number("bottom", self.bottom, "m", low=self.top + 1.0, high=3100.0)
        require_number("speed", self.speed, "m/s", low=0.01, high=2.0)

    @property
    def grid(self) -> harmonics.Grid:
        """Nodes of the map."""
        return harmonics.Grid(amplitudes=self.amplitudes, periods=self.periods, masses=self.masses, depths=self.depths)


def compute(options: Options, opened: Run, bars: Progress) -> Study:
    """Compute what is not finished yet."""
    every = zero_shot.trials(options.depths, options.lifts)
    trials = [trial for trial in every if trial.policy in options.policies]
    grid, nodes = options.grid, options.grid.nodes
    passages = [
        passage.Passage(policy=policy, top=options.top, bottom=options.bottom, speed=options.speed)
        for policy in passage.POLICIES
    ]
    with (
        JobStore(opened.jobs, zero_shot.Left, version_of(aframe_env, agents, lifts, zero_shot)) as left,
        JobStore(opened.jobs, harmonics.Found, version_of(aframe_env, agents, lifts, harmonics)) as found,
        JobStore(opened.jobs, harmonics.Checked, version_of(aframe_env, agents, lifts, harmonics)) as checked,
        JobStore(opened.jobs, passage.Passed, version_of(aframe_env, agents, lifts, passage)) as passed,
    ):
        zero = run_jobs(
            zero_shot.try_policy,
            trials,
            zero_shot.key,
            store=left,
            where=options,
            progress=bars,
            description="policies",
        )
        best = run_jobs(
            harmonics.find, nodes, store=found, where=options, progress=bars, description="nodes of the map"
        )
        middles = harmonics.between(grid.map_of(best), grid)
        held = run_jobs(
            harmonics.check, middles, store=checked, where=options, progress=bars, description="between the nodes"
        )
        lowered = run_jobs(
            passage.lower,
            passages,
            passage.key,
            store=passed,
            where=options,
            progress=bars,
            description="lowerings",
        )
    return Study(
        trials=list(zip(trials, zero, strict=True)),
        nodes=list(zip(nodes, best, strict=True)),
        middles=list(zip(middles, held, strict=True)),
        passages=list(zip(passages, lowered, strict=True)),
    )


def run(options: Options, console: Console) -> int:
    """Compute, write; return the exit status."""
    opened = open_jobs(options, "train.deep_water", "README.md")
    folder = opened.folder
    try:
        with Progress(console=console) as bars:
            study = compute(options, opened, bars)
    except KeyboardInterrupt:
        console.print("interrupted: what is finished is kept; the same command goes on from there")
        return 130
    for name, text in (
        ("zero_shot.csv", zero_shot_csv(study)),
        ("drive_map.csv", map_csv(study)),
        ("between_nodes.csv", between_csv(study)),
        ("lowering.csv", lowering_csv(study)),
    ):
        write_text(folder / name, text)
    draw_zero_shot(folder / "zero_shot.png", study)
    draw_map(folder / "drive_map.png", study)
    draw_lowering(folder / "lowering.png", study)
    text = readme(opened.command, study)
    write_text(folder / "README.md", text)
    opened.finish()
    console.print(text, soft_wrap=True)
    console.print(f"written: {folder}")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.deep_water", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
