"""Tables of a comparison: for the terminal, as Markdown, JSON and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final

from rich.box import SIMPLE
from rich.table import Table

from train.evaluate.statistics import Entry, Interval, Row, family
from train.shared.markdown import table
from train.shared.run_folder import write_json, write_text

HEADINGS: Final = (
    "policy",
    "knows",
    "scenarios",
    "median",
    "mean",
    "worst 5 %",
    "share of the optimum",
    "its worst 5 %",
    "where the winch saturates",
    "RMS error, m",
    "Ω2, m",
    "worse than still",
)
CAPTION: Final = """\
Heave reduction 1 − RMS / RMS(drum still) over the scenarios: median, mean, and mean of the worst 5 %. Share of the
optimum: reduction over that of the winch-limited optimum, in the mean, in the 5 % where it is least, and where holding
the load still asks more of the winch than it has. In brackets: 95 % bootstrap intervals over the scenarios, and over
the seeds, too, where a row stands for several. Worse than still: number of scenarios, a mean over the seeds.
"""


def _share(interval: Interval | None) -> str:
    if interval is None:
        return ""
    # 100.0 % is said of nothing that leaves anything.
    digits = 1 if abs(1.0 - interval.value) > 5e-3 else 2
    return f"{interval.value:.{digits}%} [{interval.low:.{digits}%}, {interval.high:.{digits}%}]"


def _metres(interval: Interval) -> str:
    return f"{interval.value:.3g} [{interval.low:.3g}, {interval.high:.3g}]"


def cells(row: Row) -> tuple[str, ...]:
    """A row of the table, as text."""
    return (
        row.policy,
        row.knows,
        str(row.scenarios),
        _share(row.reduction),
        _share(row.mean),
        _share(row.tail),
        _share(row.share),
        _share(row.share_tail),
        _share(row.share_saturating),
        _metres(row.rms),
        _metres(row.omega2),
        f"{row.worse_than_still:g}",
    )


def rich_table(rows: Sequence[Row]) -> Table:
    """The table for a terminal of 80 columns; the rest of the figures is in the files."""
    shown = Table(title="Heave reduction over held-out scenarios", box=SIMPLE)
    for heading in ("policy", "knows", "median", "mean", "worst 5 %"):
        shown.add_column(heading)
    for row in rows:
        figures = (row.reduction, row.mean, row.tail)
        shown.add_row(row.policy, row.knows, *(f"{figure.value:.2%}" for figure in figures))
    return shown


def markdown_table(rows: Sequence[Row]) -> str:
    """The table as Markdown."""
    return table(HEADINGS, map(cells, rows))


def write_comparison(folder: Path, families: Sequence[Row], rows: Sequence[Row], entries: Sequence[Entry]) -> None:
    """Write comparison.md, comparison.json and, scenario by scenario, comparison.csv.

    ``families``: rows in which agents that differ in their seed alone are one; ``rows``: one by one.
    """
    write_json(
        folder / "comparison.json", {"families": list(map(asdict, families)), "policies": list(map(asdict, rows))}
    )
    text = f"{markdown_table(families)}\n{CAPTION}"
    seeds = [row for row in rows if family(row.policy) != row.policy]
    if len(families) < len(rows):
        text += f"\n## Seed by seed\n{markdown_table(seeds)}"
    write_text(folder / "comparison.md", text)
    lines = io.StringIO()
    writer = csv.writer(lines, lineterminator="\n")
    writer.writerow(["policy", "scenario", "rms_m", "omega1_m2s", "omega2_m", "slack", "parted"])
    for entry in entries:
        e = entry.episodes
        for i, values in enumerate(zip(e.rms, e.omega1, e.omega2, e.slack, e.parted, strict=True)):
            writer.writerow([entry.policy, i, *(repr(float(v)) for v in values[:3]), *(int(v) for v in values[3:])])
    write_text(folder / "comparison.csv", lines.getvalue())
