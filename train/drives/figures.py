"""Pictures of an experiment with drives, of the kinds of the paper's figures 14-18."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from agents.policy import FloatArray
from train.drives.results import Experiment, Result
from train.shared.run_folder import write_atomically

COLOURS = {"drum still": "#8a8f98", "S-Ω1": "#d9822b", "S-Ω2": "#c8553d", "H-Ω1": "#0b6e99", "H-Ω2": "#7a5195"}


def _save(figure: Figure, path: Path) -> None:
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=130))


def draw(folder: Path, target: float, radius: float, experiment: Experiment) -> None:
    """Draw every picture into ``folder``; ``target`` is h and ``radius`` the drum's, m."""
    times = experiment.times
    still, *drives = experiment.results
    _still(folder / "load_drum_still.png", target, times, still)
    if drives:
        _drives(folder / "drum_drives.png", experiment, drives, radius)
        for family in dict.fromkeys(result.row.drive for result in drives):
            chosen = [result for result in drives if result.row.drive == family]
            _load(folder / f"load_{family}.png", family, times, chosen)
        if still.full is not None:
            _transfers(folder / "full_model.png", experiment)
        _amplitudes(folder / "amplitudes.png", experiment.results)


def _still(path: Path, target: float, times: FloatArray, still: Result) -> None:
    """Draw the load's vertical coordinate with the drum still, as in figure 14."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.add_subplot()
    axes.axhline(target, color="black", lw=0.8, ls=":")
    axes.plot(times, target + still.error, color=COLOURS["drum still"], lw=1.6)
    axes.set(
        title=f"Drum still: the load swings by {still.row.amplitude:.2f} m", xlabel="time, s", ylabel="x$_{L3}$, m"
    )
    axes.set_xlim(0.0, times[-1])
    axes.grid(alpha=0.3)
    _save(figure, path)


def _drives(path: Path, experiment: Experiment, drives: Sequence[Result], radius: float) -> None:
    """Draw the drives and their differences, as in figures 15 and 16."""
    times = experiment.times
    figure = Figure(figsize=(8.0, 7.2), layout="constrained")
    angle, speed, apart = figure.subplots(3, 1, sharex=True)
    for index, result in enumerate(drives):
        if result.drive is None:
            continue
        # Drives that nearly coincide stay visible: each narrower than the one below it.
        colour, label, width = COLOURS[result.row.label], result.row.label, 1.2 + 1.4 * (len(drives) - 1 - index)
        phi = result.drive.angle(times)
        angle.plot(times, phi, color=colour, lw=width)
        speed.plot(times, result.drive.speed(times), color=colour, lw=width)
        apart.plot(times, 1e3 * radius * (phi - experiment.needed), color=colour, lw=1.4, label=label)
    angle.set(title="Optimised drum drives (positive pays out)", ylabel="drum angle φ$_H$, rad")
    speed.set(ylabel="drum speed, rad/s")
    apart.set(xlabel="time, s", ylabel="rope beyond what a load\nwithout inertia needs, mm")
    for axes in (angle, speed, apart):
        axes.grid(alpha=0.3)
        axes.set_xlim(0.0, times[-1])
    figure.legend(ncols=4, loc="outside lower center", fontsize=9)
    _save(figure, path)


def _load(path: Path, family: str, times: FloatArray, drives: Sequence[Result]) -> None:
    """Draw the load's residual motion under one family of drives, as in figures 16 to 18."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.add_subplot()
    for result in drives:
        label = f"{result.row.label}: amplitude {1e3 * result.row.amplitude:.2f} mm"
        axes.plot(times, 1e3 * result.error, color=COLOURS[result.row.label], lw=1.4, label=label)
    axes.axhline(0.0, color="black", lw=0.8, ls=":")
    axes.set(title=f"Depth error under the {family} drives", xlabel="time, s", ylabel="x$_{L3}$ − h, mm")
    axes.set_xlim(0.0, times[-1])
    # Room for the legend above the curves.
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.2 * (high - low))
    axes.grid(alpha=0.3)
    axes.legend(ncols=2, loc="upper center", fontsize=9)
    _save(figure, path)


def _transfers(path: Path, experiment: Experiment) -> None:
    """Draw the simplified model's load beside the full one's, as in figures 14 and 16 to 18."""
    results = experiment.results
    figure = Figure(figsize=(8.0, 2.0 * len(results)), layout="constrained")
    for axes, result in zip(figure.subplots(len(results), 1, sharex=True), results, strict=True):
        if result.full is None:
            continue
        unit, scale = ("m", 1.0) if result.row.amplitude > 0.5 else ("mm", 1e3)
        axes.plot(experiment.times, scale * result.error, color="#8a8f98", lw=1.2, label="simplified")
        axes.plot(result.full.times, scale * result.full.error, color="#0b6e99", lw=1.2, label="full")
        axes.axhline(0.0, color="black", lw=0.8, ls=":")
        axes.set_ylabel(f"{result.row.label}, {unit}")
        axes.set_xlim(0.0, experiment.times[-1])
        axes.grid(alpha=0.3)
    axes.set_xlabel("time, s")
    figure.suptitle("Depth error x$_{L3}$ − h in the simplified and in the full model", fontsize=12)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9)
    _save(figure, path)


def _amplitudes(path: Path, results: Sequence[Result]) -> None:
    """Draw all amplitudes and root mean squares beside each other, on a logarithmic axis."""
    figure = Figure(figsize=(8.0, 3.6), layout="constrained")
    axes = figure.add_subplot()
    place = np.arange(len(results))
    for offset, alpha, name in ((-0.2, 1.0, "amplitude"), (0.2, 0.5, "rms")):
        heights = [1e3 * getattr(result.row, name) for result in results]
        colours = [COLOURS[result.row.label] for result in results]
        bars = axes.bar(place + offset, heights, width=0.38, color=colours, alpha=alpha)
        axes.bar_label(bars, labels=[f"{h:,.0f}" if h > 100.0 else f"{h:.3g}" for h in heights], fontsize=9, padding=2)
    axes.set_yscale("log")
    axes.set_ylim(None, 4e3 * max(result.row.amplitude for result in results))
    axes.yaxis.set_major_formatter("{x:,.6g}")
    axes.set_xticks(place, [result.row.label for result in results])
    axes.set(title="Depth error: amplitude (left) and root mean square (right, pale)", ylabel="mm")
    axes.grid(axis="y", alpha=0.3)
    _save(figure, path)
