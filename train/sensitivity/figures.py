"""Pictures of a sensitivity study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from train.evaluate.figure import COLOURS
from train.sensitivity.analysis import Sensitivity
from train.sensitivity.factors import FACTORS
from train.shared.run_folder import write_atomically


def _colour(number: int) -> str:
    return COLOURS[number % len(COLOURS)]


def draw_curves(path: Path, studies: Sequence[Sensitivity]) -> None:
    """Draw one panel for each factor, one line for each policy: the median over the assumed scenarios."""
    figure = Figure(figsize=(12.0, 7.4), layout="constrained")
    axes = figure.subplots(2, 3, sharey=True).ravel()
    for axis, factor in zip(axes, FACTORS, strict=True):
        for number, study in enumerate(studies):
            curve = next(c for c in study.curves if c.factor == factor.name)
            left = np.median(np.array(curve.left), axis=1)
            # Policies that are nearly alike stay visible beside each other.
            axis.plot(
                curve.values,
                left,
                "o-",
                ms=3,
                lw=1.6,
                color=_colour(number),
                alpha=0.85,
                label=study.policy,
                zorder=-number,
            )
        axis.axvline(factor.assumed, color="#888888", lw=0.8, ls=":")
        axis.set_yscale("log")
        axis.set_xlabel(factor.label)
        axis.grid(alpha=0.3)
    for axis in axes[::3]:
        axis.set_ylabel("RMS error / RMS, drum still, as assumed")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9)
    figure.suptitle("One thing is not what the policy was told (median over the assumed scenarios)", fontsize=11)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))


def draw_indices(path: Path, studies: Sequence[Sensitivity]) -> None:
    """Draw first-order (filled) and total (outlined) indices of each factor, policy by policy."""
    figure = Figure(figsize=(12.0, 4.8), layout="constrained")
    axis = figure.subplots()
    width = 0.8 / len(studies)
    for number, study in enumerate(studies):
        place = np.arange(len(FACTORS)) + (number - 0.5 * (len(studies) - 1)) * width
        total = np.array([index.total for index in study.indices])
        interval = np.array([index.total_interval for index in study.indices])
        first = np.maximum(0.0, [index.first for index in study.indices])
        axis.bar(place, total, width, fill=False, edgecolor=_colour(number), yerr=interval, ecolor="#777777")
        axis.bar(place, first, 0.7 * width, color=_colour(number), alpha=0.8, label=study.policy)
    axis.set_xticks(np.arange(len(FACTORS)), [factor.label.split(",")[0] for factor in FACTORS])
    axis.set_ylabel("share of the variance of log RMS")
    axis.set_ylim(bottom=0.0)
    axis.set_title("Sobol indices: first order (filled), total with 95 % interval (outlined)", fontsize=11)
    figure.legend(loc="outside lower center", ncols=7, fontsize=9)
    axis.grid(alpha=0.3, axis="y")
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))
