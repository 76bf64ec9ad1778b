"""Pictures of heavy ropes and loads in water, each figure beside its reference."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from train.verify.pictures import HERE, REFERENCE, save
from train.verify.rope_checks import BARS, TITLES, histories, responses, table
from train.verify.water_checks import Episode, landing, splash


def draw_ropes(folder: Path) -> list[Path]:
    """Draw the pictures into a folder; return their files."""
    pictures = {"reference_cases": _cases(), "load_over_pulley": _responses(), "surface_and_bed": _ways()}
    paths = []
    for name, figure in pictures.items():
        paths.append(folder / f"{name}.png")
        save(figure, paths[-1])
    return paths


def _cases() -> Figure:
    """Load and tension of the reference cases over time, and how far the load is off."""
    figure = Figure(figsize=(13, 3.1 * len(BARS)), layout="constrained")
    axes = figure.subplots(len(BARS), 3, sharex=False)
    for line, name in zip(axes, BARS, strict=True):
        here, there = histories(name)
        time = there["t_s"]
        line[0].plot(time, there["z_load_m"], color=REFERENCE, linewidth=3, alpha=0.4, label="reference")
        line[0].plot(time, here["z_load_m"], color=HERE, linewidth=1, label="here")
        line[0].set_ylabel("load z, m")
        line[0].ticklabel_format(useOffset=False)
        line[0].set_title(f"{name}: {TITLES[name]}", loc="left", fontsize=10)
        line[1].plot(time, 1e3 * (here["z_load_m"] - there["z_load_m"]), color=HERE, linewidth=1)
        line[1].set_ylabel("here − reference, mm")
        line[1].set_title(f"bar {1e3 * BARS[name]:g} mm", loc="left", fontsize=10)
        for column, color in (("T_top_N", "#9467bd"), ("T_load_N", "#2ca02c")):
            line[2].plot(time, there[column] / 1e3, color=color, linewidth=3, alpha=0.35)
            label = "at S" if column == "T_top_N" else "at the load"
            line[2].plot(time, here[column] / 1e3, color=color, linewidth=1, label=label)
        line[2].set_ylabel("tension, kN")
    axes[0][0].legend(loc="upper right", fontsize=8)
    axes[0][2].legend(loc="upper right", fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("time, s")
    for axis in axes.flat:
        axis.grid(alpha=0.3)
    return figure


def _responses() -> Figure:
    """How many times as much the load moves as the pulley, by period and depth; with the massless rope's beside it."""
    found, expected = responses()
    lines = table("transfer")
    depths = (300.0, 1000.0, 2000.0, 3000.0)
    figure = Figure(figsize=(13, 6.4), layout="constrained")
    axes = figure.subplots(2, len(depths), sharex=True, sharey=True)
    for row, (added, title) in enumerate(((0.0, "50 t"), (0.8, "50 t and 40 t of added mass"))):
        for axis, depth in zip(axes[row], depths, strict=True):
            for drag, style in ((0.0, "-"), (1.0, "--")):
                chosen = [
                    k
                    for k, line in enumerate(lines)
                    if (line["L_m"], line["m_kg"], line["drag"]) == (depth, 5e4, drag)
                    and math.isclose(line["m_a_kg"], added * 5e4)
                ]
                periods = [lines[k]["T_s"] for k in chosen]
                axis.plot(periods, np.abs(expected[chosen]), style, color=REFERENCE, linewidth=3, alpha=0.4)
                axis.plot(periods, np.abs(found[chosen]), "o", color=HERE, markersize=3.5, alpha=1.0 - 0.5 * drag)
            # The paper's rope in the same place: a load on a spring.
            frequency = math.sqrt(2e8 / (depth + 12.1) / (5e4 * (1.0 + added)))
            fine = np.linspace(4.0, 20.0, 400)
            massless = 1.0 / np.abs(1.0 - (2.0 * np.pi / fine / frequency) ** 2)
            axis.plot(fine, massless, color="0.6", linewidth=1, zorder=0)
            axis.set_yscale("log")
            axis.set_ylim(0.3, 100.0)
            axis.axhline(1.0, color="0.8", linewidth=0.8, zorder=0)
            axis.grid(alpha=0.3)
            axis.set_title(f"{depth:,.0f} m, {title}", loc="left", fontsize=10)
        axes[row][0].set_ylabel("load over pulley, |H|")
    for axis in axes[1]:
        axis.set_xlabel("period, s")
    axes[0][0].plot([], [], color=REFERENCE, linewidth=3, alpha=0.4, label="closed form (dashed: with drag)")
    axes[0][0].plot([], [], "o", color=HERE, markersize=3.5, label="here")
    axes[0][0].plot([], [], color="0.6", label="rope without mass, no drag")
    axes[0][0].legend(loc="upper right", fontsize=8)
    return figure


def _ways() -> Figure:
    """A load on its way through the surface, and another onto the seabed."""
    figure = Figure(figsize=(13, 6.4), layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", height_ratios=(3, 2))
    lifts = ((splash(), "manifold of 100 t through the surface"), (landing(), "60 t onto the seabed"))
    for column, (lift, title) in zip(axes.T, lifts, strict=True):
        _way(column[0], lift)
        column[0].set_title(title, loc="left", fontsize=10)
        column[1].plot(lift.times, lift.tension / 1e3, color="#2ca02c", linewidth=1)
        column[1].set_ylabel("tension at the load, kN")
        column[1].set_xlabel("time, s")
        for axis in column:
            axis.grid(alpha=0.3)
    axes[0][0].legend(loc="upper right", fontsize=8)
    return figure


def _way(axis: Any, lift: Episode) -> None:
    """Draw the load with its height, and what it goes through or comes down on."""
    axis.fill_between(
        lift.times, lift.z - 0.5 * lift.height, lift.z + 0.5 * lift.height, color=HERE, alpha=0.15, label="the load"
    )
    axis.plot(lift.times, lift.reference, color=REFERENCE, linewidth=3, alpha=0.4, label="its middle, SciPy")
    axis.plot(lift.times, lift.z, color=HERE, linewidth=1, label="its middle, here")
    low, high = lift.z.min() - lift.height, lift.z.max() + lift.height
    for level, color in ((lift.surface, "#1f77b4"), (lift.bed, "#8c564b")):
        if low < level < high:
            axis.axhspan(low, level, color=color, alpha=0.12)
            axis.axhline(level, color=color, linewidth=1)
    axis.set_ylim(low, high)
    axis.set_ylabel("z, m")
