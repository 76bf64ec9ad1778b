"""Pictures of a run: cost against the number of rows, and everybody's speed."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.bars import number
from benchmarks.catalogue import COST_ROWS, ENVPOOL
from benchmarks.results import Run
from train.shared.run_folder import write_atomically

OURS, THEIRS, LIMIT = "#0b6e99", "#8a8f98", "#d9822b"

SPEEDS: Final = (
    ("C++ limit, no sea, float32", ("limit/float@2",), LIMIT),
    ("C++ limit, no sea, float64", ("limit/double@2",), LIMIT),
    ("this package: dynamics, no sea", ("dynamics/calm@2",), OURS),
    ("this package: dynamics with sea", ("dynamics/sea@2",), OURS),
    ("this package: vector env, 4096 rows", ("env/episodes-4096@2",), OURS),
    ("this package: vector env, 64 rows", ("env/episodes-64@2",), OURS),
    ("gymnax Pendulum-v1, 4096 rows", ("gymnax/pendulum-4096@2", "gymnax/pendulum-4096-scan@2"), THEIRS),
    ("EnvPool Pendulum-v1, best setting", tuple(f"envpool/{name}@2" for name in ENVPOOL), THEIRS),
    ("EnvPool Pendulum-v1, 64 rows", tuple(f"envpool/{name}@2" for name in ENVPOOL if "-64-" in name), THEIRS),
    ("mujoco.rollout InvertedPendulum, 1024 rows", ("mujoco/rollout-1024@2",), THEIRS),
    ("Gymnasium CartPole-v1, sync, 64 rows (one core)", ("gymnasium/cartpole-vec-64@1",), THEIRS),
    ("Gymnasium Pendulum-v1, sync, 64 rows (one core)", ("gymnasium/pendulum-vec-64@1",), THEIRS),
    ("Gymnasium CartPole-v1, scalar", ("gymnasium/cartpole@1",), THEIRS),
    ("Gymnasium Pendulum-v1, scalar", ("gymnasium/pendulum@1",), THEIRS),
    ("this package: scalar env", ("env/scalar@1",), OURS),
    ("MuJoCo InvertedPendulum-v5, scalar", ("mujoco/inverted-pendulum@1",), THEIRS),
    ("scipy.solve_ivp, the same model", ("solve_ivp/episode@1",), THEIRS),
)


def draw(path: Path, run: Run) -> None:
    """Draw both beside each other, on two cores unless said."""
    figure = Figure(figsize=(13.0, 6.0), layout="constrained")
    cost, bars = figure.subplots(1, 2, width_ratios=[1.0, 1.25])
    _cost(cost, run)
    _speeds(bars, run)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=130))


def _cost(axis: Axes, run: Run) -> None:
    for prefix, label, colour in (("cost/env", "vector env's step", OURS), ("cost/engine", "Engine.step", LIMIT)):
        points = [(n, run.get(f"{prefix}-{n}@2")) for n in COST_ROWS]
        kept = [(n, n / series.median) for n, series in points if series.measured]
        if kept:
            rows, seconds = zip(*kept, strict=True)
            axis.plot(rows, seconds, marker="o", ms=4, color=colour, label=label)
            axis.plot(COST_ROWS, [seconds[-1] / rows[-1] * n for n in COST_ROWS], ":", lw=1, color="#8a8f98")
    axis.set_xscale("log", base=4)
    axis.set_xticks(COST_ROWS, [f"{n:,}" for n in COST_ROWS], rotation=45)
    axis.set_yscale("log")
    axis.set_xlabel("rows N")
    axis.set_ylabel("seconds a step of all rows")
    axis.set_title("Cost against N, two cores\n(dotted: proportional to N)", fontsize=11)
    axis.grid(alpha=0.3)
    if axis.get_legend_handles_labels()[0]:
        axis.legend()


def _speeds(axis: Axes, run: Run) -> None:
    shown = []
    for label, keys, colour in SPEEDS:
        measured = [run.get(key) for key in keys if run.get(key).measured]
        if measured:
            shown.append((label, max(measured, key=lambda series: series.median), colour))
    shown.sort(key=lambda item: item[1].median)
    for place, (_, series, colour) in enumerate(shown):
        low, high = min(series.samples), max(series.samples)
        axis.barh(place, series.median, color=colour)
        axis.plot([low, high], [place, place], color="#222222", lw=1)
        axis.text(1.15 * high, place, number(series.median), va="center", fontsize=8)
    axis.set_yticks(range(len(shown)), [label for label, _, _ in shown], fontsize=9)
    axis.set_xscale("log")
    if shown:
        axis.set_xlim(0.5 * shown[0][1].median, 8.0 * shown[-1][1].median)
    axis.set_xlabel("env steps/s (median; line: least to greatest)")
    axis.set_title(
        "Speed on two cores, scalar ones on one\n(a step: ten RK4 steps here, one Euler step in pendulums)",
        fontsize=11,
    )
    axis.grid(alpha=0.3, axis="x")
