"""Pictures of the comparison."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from agents.policy import Knowledge
from agents.rollout import Episodes
from train.evaluate.statistics import Entry, reductions
from train.shared.run_folder import write_atomically

GREY = "#8a8f98"
_PALETTE = [matplotlib.colormaps["tab20"](i) for i in (*range(0, 20, 2), *range(1, 20, 2))]
COLOURS = tuple(to_hex(colour) for colour in _PALETTE if len(set(colour[:3])) > 1)
"""All but the greys: dark ones first."""


def comparison_figure(path: Path, entries: Sequence[Entry], still: Episodes) -> None:
    """Share of scenarios above a heave reduction; and one scenario's depth error over time.

    Of agents that differ in their seed alone the first is shown, and the others' profiles as thin lines of its colour.
    """
    figure = Figure(figsize=(11.0, 7.6), layout="constrained")
    profile, history, magnified = figure.subplot_mosaic([["p", "h"], ["p", "m"]], width_ratios=[1.0, 1.25]).values()
    kinds = list(dict.fromkeys(_kind(entry) for entry in entries[1:]))
    colour = {_kind(entries[0]): GREY} | {kind: COLOURS[i % len(COLOURS)] for i, kind in enumerate(kinds)}
    first = {_kind(entry): entry.policy for entry in reversed(entries)}
    for entry in entries:
        reduction = np.sort(reductions(entry, still))
        if entry.policy == entries[0].policy:
            continue
        share = 1.0 - np.arange(len(reduction)) / len(reduction)
        # 1 - reduction on a logarithmic axis: from 0 to 90 % is as far as from 90 to 99 %.
        left = np.maximum(1.0 - reduction, 1e-4)
        style = "--" if entry.knows is Knowledge.FUTURE else "-"
        width = 2.0 if entry.policy in first.values() else 0.7
        profile.step(left, share, style, where="post", color=colour[_kind(entry)], lw=width)
    profile.set_xscale("log")
    profile.set_xlim(3.0, 2e-4)
    ticks = [1.0, 0.5, 0.1, 0.03, 0.01, 0.003, 0.001, 0.0003]
    profile.set_xticks(ticks, [f"{100 * (1 - t):.4g}%" for t in ticks])
    profile.minorticks_off()
    profile.set_xlabel("heave reduction 1 − RMS / RMS(drum still)")
    profile.set_ylabel("share of scenarios with at least this reduction")
    profile.set_ylim(0.0, 1.02)
    profile.grid(alpha=0.3)
    profile.set_title("Held-out scenarios (dashed: knows the future)", fontsize=11)
    example = int(np.argsort(still.rms)[len(still.rms) // 2])
    shown = min(len(e.episodes.rms) for e in entries)
    example = example if example < shown else int(np.argmax(still.rms[:shown]))
    for axis in (history, magnified):
        for entry in entries:
            if entry.policy not in first.values():
                continue
            error = entry.episodes.error[example]
            times = np.linspace(0.0, entry.episodes.duration, len(error))
            style = "--" if entry.knows is Knowledge.FUTURE else "-"
            axis.plot(times, error, style, color=colour[_kind(entry)], lw=1.3, label=entry.policy)
        axis.set_ylabel("depth error, m")
        axis.grid(alpha=0.3)
        axis.set_xlim(0.0, still.duration)
    limit = 1.15 * float(np.abs(still.error[example]).max())
    history.set_ylim(-limit, limit)
    history.set_title(f"Scenario {example}: depth error, and the same magnified", fontsize=11)
    magnified.set_ylim(-0.06 * limit, 0.06 * limit)
    magnified.set_xlabel("time, s")
    figure.legend(
        *history.get_legend_handles_labels(), loc="outside lower center", ncols=min(5, len(first)), fontsize=9
    )
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=130))


def _kind(entry: Entry) -> str:
    """The policy, whatever its seed."""
    return re.sub(r", seed \d+$", "", entry.policy)
