"""Pictures of the study."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter

from agents.policy import FloatArray
from train.deep_water.harmonics import closed_forms, rms_of_heave
from train.deep_water.notes import Study
from train.deep_water.passage import bobbing_periods, running
from train.evaluate.figure import COLOURS, LEAST
from train.evaluate.statistics import tail_mean
from train.shared.run_folder import write_atomically

WINDOW = 60.0
"""Way over which the error of a lowering is averaged, m."""


def draw_zero_shot(path: Path, study: Study) -> None:
    """Draw median and tail of every policy at every depth."""
    names = sorted(study.policies(), key=lambda name: np.median(study.reduction(name, study.depths[-1])))
    figure = Figure(figsize=(12.0, 2.0 + 0.33 * len(names)), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    statistics: dict[str, Callable[[FloatArray], Any]] = {"median": np.median, "mean of the worst 5 %": tail_mean}
    for axis, (title, statistic) in zip(axes, statistics.items(), strict=True):
        for number, depth in enumerate(study.depths):
            left = [1.0 - float(statistic(study.reduction(name, depth))) for name in names]
            place = np.arange(len(names)) + 0.15 * (1.5 - number)
            axis.plot(np.maximum(left, LEAST), place, "o", ms=5, color=COLOURS[number], label=f"{depth:,.0f} m")
        axis.set_xscale("log")
        axis.set_xlim(2.0, 0.6 * LEAST)
        ticks = (1.0, 0.1, 0.03, 0.01, 0.001, LEAST)
        axis.set_xticks(ticks, [f"{100 * (1 - tick):.4g}%" for tick in ticks])
        axis.minorticks_off()
        axis.set_yticks(range(len(names)), names, fontsize=9)
        axis.grid(alpha=0.3)
        axis.set_xlabel("heave reduction 1 − RMS / RMS(drum still)")
        axis.set_title(title, fontsize=11)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, title="depth")
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))


def draw_map(path: Path, study: Study) -> None:
    """Draw the drum still, the best ratio, and what is left between the nodes."""
    figure = Figure(figsize=(13.0, 8.4), layout="constrained")
    axes = figure.subplots(2, 2).ravel()
    masses = sorted({node.mass for node, _ in study.nodes})
    amplitudes = sorted({node.amplitude for node, _ in study.nodes})
    depths = sorted({node.length for node, _ in study.nodes})
    for axis, mass in zip(axes[:2], (masses[0], masses[-1]), strict=True):
        for number, depth in enumerate(depths):
            for amplitude, style in ((amplitudes[0], "o--"), (amplitudes[-1], "o-")):
                line = [
                    (node.period, found.still / rms_of_heave(node))
                    for node, found in study.nodes
                    if (node.mass, node.length, node.amplitude) == (mass, depth, amplitude)
                ]
                label = f"{depth:,.0f} m, {amplitude:g} m of heave"
                axis.plot(*np.array(line).T, style, ms=4, color=COLOURS[number], label=label)
        axis.axhline(1.0, color="#888888", lw=0.8)
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axis.yaxis.set_minor_formatter(StrMethodFormatter("{x:g}"))
        axis.set(xlabel="period, s", ylabel="load over pulley, RMS", title=f"Drum still, {mass / 1e3:g} t")
    axes[1].legend(fontsize=8, ncols=1, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for number, mass in enumerate(masses):
        some = [(node, found) for node, found in study.nodes if node.mass == mass]
        rows = [(node.length, abs(found.ratio)) for node, found in some]
        axes[2].plot(*np.array(rows).T, "o", ms=6, alpha=0.4, color=COLOURS[number], label=f"{mass / 1e3:g} t, best")
        closed = closed_forms([node for node, _ in some]).tolist()
        line = sorted({(node.length, value) for (node, _), value in zip(some, closed, strict=True)})
        axes[2].plot(*np.array(line).T, color=COLOURS[number], label="1/(1 + strain at rest)")
    axes[2].set(
        xlabel="depth below the pulley, m",
        ylabel="rope paid out over heave",
        title="Best drive: all periods and amplitudes",
    )
    axes[2].legend(fontsize=8)
    periods = np.array([each.node.period for each, _ in study.middles])
    share = 1e3 / np.array([rms_of_heave(each.node) for each, _ in study.middles])
    checked = [each for _, each in study.middles]
    for number, (label, left) in enumerate(
        (
            ("drum still", [each.optimum.still for each in checked]),
            ("a hundredth too much", [each.optimum.mistuned for each in checked]),
            ("interpolated map", [each.interpolated for each in checked]),
            ("1/(1 + strain at rest)", [each.optimum.closed_form for each in checked]),
            ("best", [each.optimum.best.remaining * each.optimum.still for each in checked]),
        )
    ):
        place = periods * (0.98 + 0.01 * number)
        axes[3].semilogy(place, share * np.array(left), "o", color=COLOURS[number], label=label)
    axes[3].set(
        xlabel="period, s", ylabel="left on the load, mm for a metre of heave", title="Between the nodes, all depths"
    )
    axes[3].legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for axis in axes:
        axis.grid(alpha=0.3)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))


def draw_lowering(path: Path, study: Study) -> None:
    """Draw the running error over depth, and the period of the bobbing."""
    figure = Figure(figsize=(12.0, 7.0), layout="constrained")
    errors, bobbing = figure.subplots(2, 1, sharex=True, height_ratios=[2.2, 1.0])
    passage = study.passages[0][0]
    depths = passage.depths
    moving = (depths > passage.top) & (depths < passage.bottom)
    step = passage.duration / (len(depths) - 1)
    window = max(3, round(WINDOW / passage.speed / step))
    for number, (_, passed) in enumerate(study.passages):
        label = "drum only lowering" if passed.name == "drum still" else passed.name
        error = running(passed.error, window)
        errors.semilogy(depths[moving], 1e3 * error[moving], color=COLOURS[number], lw=1.6, label=label)
    errors.set(ylabel=f"RMS depth error over {WINDOW:g} m, mm")
    errors.set_title(
        f"100 t lowered at {passage.speed:g} m/s, Hs {passage.hs:g} m, Tp {passage.tp:g} s; policies on sensors",
        fontsize=11,
    )
    period = bobbing_periods(passage, depths[moving])
    bobbing.plot(depths[moving], period, color="black", label="bobbing of the load")
    bobbing.axhline(passage.tp, color="#888888", ls="--", label="peak period of the sea")
    bobbing.set(xlabel="depth below the pulley, m", ylabel="period, s")
    bobbing.legend(loc="lower right", fontsize=9)
    for axis in (errors, bobbing):
        axis.grid(alpha=0.3)
    figure.legend(*errors.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))
