"""Tables of a comparison: for the terminal, as Markdown, JSON and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.box import SIMPLE
from rich.table import Table

from train.evaluate.statistics import Entry, Interval, Row
from train.shared.markdown import table
from train.shared.run_folder import write_json, write_text


def _share(interval: Interval) -> str:
    return f"{interval.median:.1%} [{interval.low:.1%}, {interval.high:.1%}]"


def _metres(interval: Interval) -> str:
    return f"{interval.median:.3g} [{interval.low:.3g}, {interval.high:.3g}]"


HEADINGS = (
    "policy",
    "knows",
    "scenarios",
    "heave reduction",
    "RMS error, m",
    "Ω1, m² s",
    "Ω2, m",
    "worst reduction",
    "worse than still",
)


def cells(row: Row) -> tuple[str, ...]:
    """A row of the table, as text."""
    return (
        row.policy,
        row.knows,
        str(row.scenarios),
        _share(row.reduction),
        _metres(row.rms),
        _metres(row.omega1),
        _metres(row.omega2),
        f"{row.worst_reduction:.1%}",
        str(row.worse_than_still),
    )


def rich_table(rows: Sequence[Row]) -> Table:
    """The table for a terminal of 80 columns; the rest of the figures is in the files."""
    shown_table = Table(title="Median over held-out scenarios [95 % bootstrap interval]", box=SIMPLE)
    shown = [HEADINGS.index(heading) for heading in ("policy", "knows", "heave reduction", "worst reduction")]
    for column in shown:
        shown_table.add_column(HEADINGS[column])
    for row in rows:
        values = cells(row)
        shown_table.add_row(*(values[column] for column in shown))
    return shown_table


def markdown_table(rows: Sequence[Row]) -> str:
    """The table as Markdown."""
    return table(HEADINGS, map(cells, rows))


def write_comparison(folder: Path, rows: Sequence[Row], entries: Sequence[Entry]) -> None:
    """Write comparison.json, comparison.md and, scenario by scenario, comparison.csv."""
    write_json(folder / "comparison.json", [asdict(row) for row in rows])
    write_text(folder / "comparison.md", markdown_table(rows))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["policy", "scenario", "rms_m", "omega1_m2s", "omega2_m", "slack", "parted"])
    for entry in entries:
        e = entry.episodes
        for i, values in enumerate(zip(e.rms, e.omega1, e.omega2, e.slack, e.parted, strict=True)):
            writer.writerow([entry.policy, i, *(repr(float(v)) for v in values[:3]), *(int(v) for v in values[3:])])
    write_text(folder / "comparison.csv", text.getvalue())
