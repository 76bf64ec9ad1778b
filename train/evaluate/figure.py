"""Pictures of the comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from agents.policy import Knowledge
from agents.rollout import Episodes
from train.evaluate.statistics import Entry, Interval, Row, family, reductions
from train.shared.run_folder import write_atomically

GREY = "#8a8f98"
_PALETTE = [matplotlib.colormaps["tab20"](i) for i in (*range(0, 20, 2), *range(1, 20, 2))]
COLOURS = tuple(to_hex(colour) for colour in _PALETTE if len(set(colour[:3])) > 1)
"""All but the greys: dark ones first."""


TICKS: Final = (1.0, 0.5, 0.2, 0.1, 0.03, 0.01, 0.003, 0.001, 0.0003)
"""What is left, where reductions are labelled: from 0 to 90 % is as far as from 90 to 99 %."""
LEAST: Final = 1e-4
WINDOW: Final = 10.0
"""Time over which one scenario's error is averaged, s: about a wave."""
_ALL: Final = Interval(1.0, 1.0, 1.0)


def comparison_figure(path: Path, entries: Sequence[Entry], still: Episodes, families: Sequence[Row]) -> None:
    """Draw the share of scenarios above a heave reduction, one scenario's running error, and each mean and tail.

    Of agents that differ in their seed alone the first is shown, and the others' profiles as thin lines of its colour.
    """
    kinds = list(dict.fromkeys(family(entry.policy) for entry in entries[1:]))
    colour = {family(entries[0].policy): GREY} | {kind: COLOURS[i % len(COLOURS)] for i, kind in enumerate(kinds)}
    figure = Figure(figsize=(13.0, max(7.6, 2.0 + 0.36 * len(families))), layout="constrained")
    axes = figure.subplot_mosaic([["profiles", "means"], ["history", "means"]], width_ratios=[1.0, 0.9])
    _draw_profiles(axes["profiles"], entries, still, colour)
    _draw_history(axes["history"], entries, still, families, colour)
    _draw_means(axes["means"], families[1:], colour)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=130))


def _style(knows: str) -> str:
    return "--" if knows == Knowledge.FUTURE.value else "-"


def _reduction_axis(axis: Axes) -> None:
    axis.set_xscale("log")
    axis.set_xlim(1.5, LEAST)
    axis.set_xticks(TICKS, [f"{100 * (1 - t):.4g}%" for t in TICKS])
    axis.minorticks_off()
    axis.grid(alpha=0.3)
    axis.tick_params(axis="x", labelsize=8)


def _draw_profiles(axis: Axes, entries: Sequence[Entry], still: Episodes, colour: Mapping[str, str]) -> None:
    first = {family(entry.policy): entry.policy for entry in reversed(entries)}
    for entry in entries[1:]:
        reduction = np.sort(reductions(entry, still))
        share = 1.0 - np.arange(len(reduction)) / len(reduction)
        width = 1.8 if entry.policy in first.values() else 0.6
        kind = family(entry.policy)
        left = np.maximum(1.0 - reduction, LEAST)
        axis.step(left, share, _style(entry.knows.value), where="post", color=colour[kind], lw=width)
    _reduction_axis(axis)
    axis.set_ylim(0.0, 1.02)
    axis.set_xlabel("heave reduction 1 − RMS / RMS(drum still)")
    axis.set_ylabel("share of scenarios with at least this")
    axis.set_title("Held-out scenarios (dashed: knows the future)", fontsize=11)


def _draw_history(
    axis: Axes, entries: Sequence[Entry], still: Episodes, families: Sequence[Row], colour: Mapping[str, str]
) -> None:
    """Draw how one scenario's error grows and falls: the drum still, and the best in the mean of each knowledge."""
    best: dict[str, Row] = {}
    for row in families[1:]:
        if row.scenarios == len(still.rms) and (row.knows not in best or row.mean.value > best[row.knows].mean.value):
            best[row.knows] = row
    chosen = [
        entries[0],
        *(next(e for e in entries if family(e.policy) == family(row.policy)) for row in best.values()),
    ]
    example = int(np.argsort(still.rms)[len(still.rms) // 2])
    for entry in chosen:
        episodes = entry.episodes
        window = min(round(WINDOW / episodes.control_period), episodes.error.shape[1])
        square = episodes.error[example].astype(np.float64) ** 2
        # The error itself passes through nothing twice a wave: on a logarithmic axis a thicket of spikes.
        running = np.sqrt(np.convolve(square, np.full(window, 1.0 / window), mode="valid"))
        times = episodes.control_period * (np.arange(len(running)) + 0.5 * (window - 1))
        line = _style(entry.knows.value)
        shown = np.maximum(running, LEAST)
        axis.plot(times, shown, line, color=colour[family(entry.policy)], lw=1.8, label=entry.policy)
    axis.set_yscale("log")
    axis.set_xlim(0.0, still.duration)
    axis.set_xlabel("time, s")
    axis.set_ylabel(f"RMS depth error over {WINDOW:g} s, m")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=3, frameon=False)
    axis.set_title(f"Scenario {example}, the median sea: the best of each knowledge", fontsize=11)


def _draw_means(axis: Axes, rows: Sequence[Row], colour: Mapping[str, str]) -> None:
    """Draw mean (dot) and mean of the worst 5 % (ring) with their intervals, the best mean on top."""
    shares = all(row.share is not None for row in rows)
    rows = [row for row in rows if not shares or row.share != _ALL]  # the optimum itself
    ranked = sorted(rows, key=lambda row: (row.share or row.mean).value if shares else row.mean.value)
    for place, row in enumerate(ranked):
        kind = family(row.policy)
        pair = (row.share, row.share_tail) if shares else (row.mean, row.tail)
        for figure, face in zip(pair, (colour[kind], "white"), strict=True):
            assert figure is not None
            left = np.clip(1.0 - np.array([figure.value, figure.low, figure.high]), LEAST, 1.4)
            axis.plot(left[1:], [place, place], "-", color=colour[kind], lw=1.4)
            axis.plot(left[0], place, "o", color=colour[kind], markerfacecolor=face, markersize=6)
    _reduction_axis(axis)
    axis.set_yticks(range(len(ranked)), [f"{row.policy}  ({_short(row.knows)})" for row in ranked], fontsize=8)
    axis.set_ylim(-0.7, len(ranked) - 0.3)
    axis.yaxis.tick_right()
    what = "share of the winch-limited optimum" if shares else "heave reduction"
    axis.set_xlabel(f"{what}; what is below 0 % stands at the left edge", fontsize=8)
    axis.set_title("Mean (dot), mean of the worst 5 % (ring), 95 % intervals", fontsize=11)


def _short(knows: str) -> str:
    return knows.split(" (")[0]
