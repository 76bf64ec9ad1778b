"""The page of a leaderboard: a table and a picture of each task."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from aframe_env.suite import TASKS, find_task
from aframe_env.suite.definition import Measure
from agents.policy import Knowledge
from agents.registry import OPTIMUM
from train.benchmark.leaderboard import YARDSTICKS, LeaderboardRow
from train.benchmark.measures import MEASURES
from train.evaluate.figure import COLOURS
from train.evaluate.statistics import Interval
from train.shared.markdown import table
from train.shared.run_folder import write_atomically, write_text

PAGE: Final = "README.md"
PICTURE: Final = "leaderboard.png"
LOWEST: Final = -0.2
"""Share at the left edge of the picture."""
_COLOUR: Final = {each.value: COLOURS[i] for i, each in enumerate(Knowledge)}
HEADINGS: Final = (
    "policy",
    "knows",
    "share of the ceiling",
    "median",
    "worst 5 %",
    "reduction",
    "worse than still",
)
CAPTION: Final = """\
Share of the ceiling: a policy's heave reduction, 1 − RMS / RMS(drum still), over that of the best drum commands that
the winch can follow, the whole future known; mean over the scenarios, median, and mean of the 5 % where it is least. In
brackets: 95 % bootstrap intervals over the scenarios, and over the seeds, too, where a row stands for several.
Reduction: the mean heave reduction itself. Worse than still: number of scenarios, a mean over the seeds. Where the
target moves, a drum "still" pays out what its way asks for, and nothing else.
"""


def write_page(folder: Path, rows: Sequence[LeaderboardRow]) -> None:
    """Write table and picture of a leaderboard's rows into a folder."""
    write_text(folder / PAGE, page(rows))
    draw(folder / PICTURE, rows)


def page(rows: Sequence[LeaderboardRow]) -> str:
    """The page as Markdown."""
    parts = ["# Leaderboard\n", f"![mean and worst 5 % of every policy]({PICTURE})\n", CAPTION]
    for title, group in _tables(rows):
        ceiling = next((row.reduction for row in group if row.policy == OPTIMUM.name), None)
        parts.append(f"## {title}\n")
        if ceiling is not None:
            parts.append(f"The ceiling removes {_percent(ceiling)} of the heave in the mean.\n")
        further = find_task(group[0].task).measures
        headings = (*HEADINGS, *(MEASURES[measure].heading for measure in further))
        parts.append(table(headings, (_cells(row, further) for row in group)))
        commands = dict.fromkeys(row.command for row in group)
        parts.append("Made by:\n\n" + "\n".join(f"    {command}" for command in commands) + "\n")
    return "\n".join(parts)


def _tables(rows: Iterable[LeaderboardRow]) -> list[tuple[str, list[LeaderboardRow]]]:
    """Rows that may stand side by side, with a title; rows come sorted."""
    isolates = {task.id: task.isolates for task in TASKS.values()}
    return [
        (f"{task}, {split}, {count} scenarios: {isolates[task]}", list(group))
        for (task, split, count), group in groupby(rows, lambda row: (row.task, row.split, row.scenarios))
    ]


def _percent(figure: Interval) -> str:
    return f"{figure.value:.1%} [{figure.low:.1%}, {figure.high:.1%}]"


def _cells(row: LeaderboardRow, further: Sequence[Measure]) -> tuple[str, ...]:
    shares = map(_percent, (row.share, row.share_median, row.share_worst, row.reduction))
    measures = (f"{row.measures[measure]:.3g}" if measure in row.measures else "" for measure in further)
    return (name_of(row), row.knows, *shares, f"{row.worse_than_still:g}", *measures)


def draw(path: Path, rows: Sequence[LeaderboardRow]) -> None:
    """Draw mean and worst 5 % of every policy as bars, a panel for each task."""
    tables = _tables(row for row in rows if row.policy not in YARDSTICKS)
    columns = min(2, max(1, len(tables)))
    lines = max(1, -(-len(tables) // columns))
    most = max((len(group) for _, group in tables), default=1)
    figure = Figure(figsize=(7.5 * columns, 0.8 + lines * (1.2 + 0.36 * most)), layout="constrained")
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    for axis, (title, group) in zip(axes, tables, strict=False):
        _draw_task(axis, title, group[::-1])
    for axis in axes[len(tables) :]:
        axis.set_visible(False)
    shown = [each for each in _COLOUR if any(row.knows == each for _, group in tables for row in group)]
    patches = [Patch(color=_COLOUR[each], label=each) for each in shown]
    figure.legend(handles=patches, loc="outside lower center", ncols=len(_COLOUR), fontsize=9, title="knows")
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))


def _draw_task(axis: Axes, title: str, rows: Sequence[LeaderboardRow]) -> None:
    for place, row in enumerate(rows):
        for share, y, height, alpha in (
            (row.share, place + 0.14, 0.42, 1.0),
            (row.share_worst, place - 0.24, 0.28, 0.4),
        ):
            value, low, high = np.clip((share.value, share.low, share.high), LOWEST, 1.0)
            axis.barh(y, value, height, color=_COLOUR[row.knows], alpha=alpha)
            axis.plot([low, high], [y, y], color="#333333", lw=1.0)
            if share.value < LOWEST:
                axis.text(LOWEST, y, f"◂ {share.value:.0%}", va="center", fontsize=7)
    axis.set_yticks(range(len(rows)), [name_of(row) for row in rows], fontsize=8)
    axis.set_xlim(LOWEST, 1.0)
    ticks = np.arange(LOWEST, 1.01, 0.2)
    axis.set_xticks(ticks, [f"{100 * tick:.0f} %" for tick in ticks])
    axis.axvline(0.0, color="#333333", lw=0.8)
    axis.grid(axis="x", alpha=0.3)
    axis.set_title(title.replace(": ", "\n", 1), fontsize=10)
    axis.set_xlabel("share of the ceiling: mean (strong), worst 5 % (pale), 95 % intervals", fontsize=8)


def name_of(row: LeaderboardRow) -> str:
    """Name of a row, with its seeds and with who added it."""
    seeds = f", {row.seeds} seeds" if row.seeds > 1 else ""
    return f"{row.policy}{seeds}" + (f" ({row.by})" if row.by else "")
