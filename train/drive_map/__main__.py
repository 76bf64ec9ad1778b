"""Build the map of basic drives and assess it: ``python -m train.drive_map``.

Optimises a pseudo-harmonic drive at every node of heave amplitude × period × load mass × rope length, over worker
processes; finished drives are kept, so that an interrupted build goes on where it was. Then holds the approximation
against fresh optimisations between the nodes, and runs the map's drives in regular waves, swell and random seas.
Writes the map (drive_map.safetensors, drive_map.json), held_out.json, a comparison for each kind of sea, drive_map.png
and notes.md.
"""

from __future__ import annotations

import itertools
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from rich.console import Console
from rich.progress import Progress

from aframe_env.validation import InvalidValue, require_integer, require_number
from agents.drives import functions, objectives, optimisation
from agents.drives import map as module
from agents.drives.map import ARRAYS, CARD, DriveMap, Node, NodeDrive, optimise_node, serialise
from train.drive_map.between_nodes import Checked, HeldOut, between_nodes, check
from train.drive_map.figures import draw
from train.drive_map.notes import notes
from train.drive_map.seas import compare_in
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.job_store import JobStore, version_of
from train.shared.jobs import Where, run_jobs
from train.shared.run_folder import (
    RunOptions,
    open_jobs,
    user_errors,
    versions,
    write_atomically,
    write_json,
    write_text,
)
from train.shared.scenarios import ScenarioOptions


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, Where, ScenarioOptions):
    """The map's grid, and its tests."""

    amplitudes: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0, 4.0)
    """Heave amplitudes of the crane's tip, m."""
    periods: tuple[float, ...] = (5.0, 6.0, 7.0, 8.5, 10.0, 12.0, 15.0, 20.0)
    """Periods, s."""
    masses: tuple[float, ...] = (10e3, 35e3, 60e3, 85e3, 110e3)
    """Load masses, kg."""
    lengths: tuple[float, ...] = (40.0, 70.0, 120.0, 210.0, 370.0, 640.0, 1000.0, 1600.0)
    """Rope lengths |LS|, m."""
    held_out: int = 200
    """Regular heaves between the nodes that the approximation is held against."""
    bounds: ClassVar[tuple[int, int]] = (2, 10**6)
    scenarios: int | Path = 60
    """Number of held-out scenarios of each kind of sea; or a TOML file with a scenario or a distribution of your own,
    whose crane the map is then made for."""
    seed: int = 0
    """Seed of the heaves between the nodes."""
    store: Path = Path("runs/drive-map.sqlite")
    """File that keeps finished optimisations."""

    def __post_init__(self) -> None:
        Where.__post_init__(self)
        ScenarioOptions.__post_init__(self)
        for name, unit, low, high in (
            ("amplitudes", "m", 1e-3, 20.0),
            ("periods", "s", 1.0, 100.0),
            ("masses", "kg", 1.0, 1e7),
            ("lengths", "m", 10.0, 1e4),
        ):
            values: tuple[float, ...] = getattr(self, name)
            for value in values:
                require_number(name, value, unit, low=low, high=high)
            if len(values) < 2 or any(b <= a for a, b in itertools.pairwise(values)):
                raise InvalidValue(f"{name} = {values}: must be at least 2 rising values")
        require_integer("held_out", self.held_out, low=1, high=10**6)
        require_integer("seed", self.seed, low=0, high=2**32 - 1)

    @property
    def nodes(self) -> list[Node]:
        """Every node, in the order of the map's axes."""
        grid = itertools.product(self.amplitudes, self.periods, self.masses, self.lengths)
        return [Node(amplitude=a, period=p, mass=m, length=length, crane=self.source.crane) for a, p, m, length in grid]


def assemble(options: Options, found: list[NodeDrive]) -> DriveMap:
    """The map of the optima at ``options.nodes``."""
    axes = (options.amplitudes, options.periods, options.masses, options.lengths)
    shape = tuple(map(len, axes))
    ratio = np.array([complex(each.real, each.imaginary) for each in found]).reshape(shape)
    remaining = np.array([each.remaining for each in found]).reshape(shape)
    amplitude, period, mass, length = (np.array(axis, dtype=np.float64) for axis in axes)
    return DriveMap(amplitude, period, mass, length, ratio, remaining)


def run(options: Options, console: Console) -> int:
    """Build, test, write; return the exit status."""
    opened = open_jobs(options, "train.drive_map", "notes.md", seed=options.seed)
    folder, command = opened.folder, opened.command
    version = version_of(module, functions, objectives, optimisation)
    nodes, crane = options.nodes, options.source.crane
    try:
        with Progress(console=console) as bars:
            begin = time.perf_counter()
            with JobStore(options.store, NodeDrive, version) as store:
                fresh = len(nodes) - len(store.read([store.key(node) for node in nodes]))
                found = run_jobs(optimise_node, nodes, store=store, where=options, progress=bars, description="nodes")
            rate = fresh / (time.perf_counter() - begin)
            drive_map = assemble(options, found)
            between = between_nodes(drive_map, crane, options.held_out, options.seed)
            with JobStore(opened.jobs, Checked, version) as answers:
                checked = run_jobs(
                    check,
                    between,
                    store=answers,
                    where=options,
                    progress=bars,
                    description="between the nodes",
                )
            held_out = [
                HeldOut(each.optimum, each.ratio_error, each.remaining, where.node)
                for where, each in zip(between, checked, strict=True)
            ]
            seas = compare_in(drive_map, opened, options, options, bars)
    except KeyboardInterrupt:
        console.print("interrupted: what is finished is kept; the same command goes on from there")
        return 130
    arrays, card = serialise(drive_map, command, versions())
    write_atomically(folder / ARRAYS, lambda temporary: temporary.write_bytes(arrays))
    write_text(folder / CARD, card)
    write_json(folder / "held_out.json", [each.plain for each in held_out])
    draw(folder / "drive_map.png", drive_map, crane, held_out, seas)
    text = notes(command, drive_map, crane, found, held_out, seas, fresh, rate)
    write_text(folder / "notes.md", text)
    opened.finish()
    console.print(text)
    console.print(f"written: {folder}")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.drive_map", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
