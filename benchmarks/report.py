"""The report: benchmarks.json, benchmarks.md, benchmarks.png."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from benchmarks.bars import Verdict, shown, verdicts
from benchmarks.catalogue import MEASURES
from benchmarks.pictures import draw
from benchmarks.results import Run
from train.output import write_json, write_text

HEADINGS = ("what", "bar", "measured", "peer", "ratio", "met")
NOTES = """\
Medians of rounds in turn [least, greatest]; ratios are taken round by round, and a peer with several settings counts
with its best. Every process is warm and pinned to the same cores. Control step 0.1 s, inner step 0.01 s (ten RK4 steps
an env step) unless said, float64, a load in three dimensions, 32 wave components; a peer's env step is one Euler step
(pendulum, cart-pole), two RK4 steps (MuJoCo), or what its row says. "C++" is
[limit.cpp](../benchmarks/limit/limit.cpp) (-O3 -march=native -ffast-math, OpenMP): the same equations and integrator,
without sea, lag, limit switches and a rope that parts. "Dynamics alone" is `Engine.step`, which with a sea includes
its synthesis.
"""


def markdown(run: Run, rows: Sequence[Verdict]) -> str:
    """The report as Markdown."""
    met = {True: "yes", False: "**no**", None: "not measured"}
    table = [(v.what, v.bar, v.measured, v.peer, v.ratio, met[v.met]) for v in rows]
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
        NOTES,
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
