"""The report: benchmarks.json, benchmarks.md, benchmarks.png."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final

from benchmarks.bars import ENVPOOL_64_KEYS, ENVPOOL_KEYS, Verdict, best_of, number, ratios, shown, spread, verdicts
from benchmarks.catalogue import MEASURES
from benchmarks.pictures import draw
from benchmarks.results import Run
from train.shared.run_folder import write_json, write_text

HEADINGS = ("what", "bar", "measured", "peer", "ratio", "met")
NOTES = """\
Medians of rounds in turn [least, greatest]; ratios are taken round by round, and a peer with several settings counts
with its best. Every process is warm and pinned to the same cores. Control step 0.1 s, inner step 0.01 s (ten RK4 steps
an env step) unless said, float64, a load in three dimensions, 32 wave components; a peer's env step is one Euler step
(pendulum, cart-pole), two RK4 steps (MuJoCo), or what its row says. "C++" is
[limit.cpp](../benchmarks/limit/limit.cpp) (-O3 -march=native -ffast-math, OpenMP): the same equations and integrator,
without sea, lag, limit switches and a rope that parts. "Dynamics alone" is `Engine.step`, which with a sea includes
its synthesis. Start-up: SciPy's interpolation is loaded by the first drawn sea, so its time is in the first reset and
not in the import.
"""
HEADLINES: Final[tuple[tuple[str, str, tuple[str, ...], str], ...]] = (
    (
        "vector environment, 4096 rows, two cores: whole episodes with autoreset, seas drawn anew",
        "env/episodes-4096@2",
        ENVPOOL_KEYS,
        "EnvPool's Pendulum-v1 at its best setting",
    ),
    ("the same with 64 rows", "env/episodes-64@2", ENVPOOL_64_KEYS, "EnvPool's Pendulum-v1 with 64 rows"),
    ("scalar `env.step`", "env/scalar@1", ("gymnasium/pendulum@1",), "Gymnasium's Pendulum-v1"),
    ("dynamics alone, ship at rest, 4096 rows, one core", "dynamics/calm@1", ("limit/double@1",), "hand-written C++"),
    ("the same with 32 wave components", "dynamics/sea@1", ("solve_ivp/episode@1",), "`scipy.solve_ivp`"),
    ("one evaluation of Ω1 over 36 s, the paper's case", "drives/omega1-alone@1", (), ""),
    ("each of 64 of these together", "drives/omega1-filled@1", (), ""),
    ("memory of a row of the vector environment", "env/memory-peak@2", (), ""),
    ("make and reset the environment, warm compile cache", "startup/warm@1", (), ""),
)
"""Figures that the README quotes: title, measure, peer's measures, peer."""


def headlines(run: Run) -> Iterator[tuple[str, str, str]]:
    """Title, median, and spread of the ratio to the peer of each figure."""
    for what, key, peers, name in HEADLINES:
        if run.get(key).measured:
            best = best_of(run, peers)
            ratio = f"{spread(ratios(run.get(key), run.get(best)))} × {name}" if best else ""
            yield what, f"{number(run.get(key).median)} {MEASURES[key].unit}", ratio


def markdown(run: Run, rows: Sequence[Verdict]) -> str:
    """The report as Markdown."""
    table = [(v.what, v.bar, v.measured, v.peer, v.ratio, f"**{v.word}**" if v.met is False else v.word) for v in rows]
    figures = [
        (key, MEASURES[key].what, shown(series, MEASURES[key].unit), str(len(series.samples)))
        for key, series in run.series.items()
        if series.measured
    ]
    missing = [(key, MEASURES[key].what, series.error) for key, series in run.series.items() if not series.measured]
    machine = run.machine
    pinned = "pinned" if machine.pinned else "not pinned (the system does not offer it)"
    peers = "; ".join(
        f"{Path(script).stem}: " + ", ".join(f"{name} {version}" for name, version in found.items())
        for script, found in run.peer_versions.items()
        if found
    )
    parts = [
        "# Benchmarks",
        f"`{run.command}` on {machine.processor}, {machine.cores} cores, {pinned}; {machine.system}; "
        f"{machine.compiler}; {run.rounds} rounds.",
        _table(("what", "figure", "beside its peer"), list(headlines(run))),
        NOTES,
        "## Bars",
        _table(HEADINGS, table),
        "![Cost against the number of rows; env steps a second](benchmarks.png)",
        "## Every figure",
        "`@1`, `@2`: on one core, on two.",
        _table(("measure", "what", "median [least, greatest]", "rounds"), figures),
    ]
    if missing:
        parts += ["## Not measured", _table(("measure", "what", "why"), missing)]
    parts += ["## Versions", ", ".join(f"{name} {version}" for name, version in run.versions.items()) + "."]
    if peers:
        parts += [f"Peers: {peers}."]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def write_report(folder: Path, run: Run) -> list[Verdict]:
    """Write all three; return the verdicts."""
    rows = verdicts(run)
    write_json(folder / "benchmarks.json", {"bars": [asdict(row) for row in rows], **run.data()})
    write_text(folder / "benchmarks.md", markdown(run, rows))
    draw(folder / "benchmarks.png", run)
    return rows
