"""Picture of a drive map."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from aframe_env.scenario import Crane
from agents.drives.map import DriveMap
from train.drive_map.between_nodes import HeldOut
from train.drive_map.notes import closed_form
from train.drive_map.seas import InSea
from train.evaluate.figure import COLOURS
from train.evaluate.statistics import reductions
from train.shared.run_folder import write_atomically


def draw(path: Path, drive_map: DriveMap, crane: Crane, held_out: Sequence[HeldOut], seas: Sequence[InSea]) -> None:
    """Draw the map against the closed form, the approximation's error, and the reduction in each kind of sea."""
    figure = Figure(figsize=(12.0, 7.6), layout="constrained")
    ratio, lead, error, reduction = figure.subplot_mosaic([["r", "l", "e"], ["s", "s", "s"]]).values()
    tonnes = drive_map.mass / 1e3
    every = np.moveaxis(drive_map.ratio, 2, 0).reshape(len(tonnes), -1)
    ratio.plot(tonnes, closed_form(drive_map, crane), color=COLOURS[1], lw=2, label="1/(1 + m g / (E_R F_R))")
    spread = np.repeat(tonnes, every.shape[1])
    ratio.plot(spread, np.abs(every).ravel(), "o", color=COLOURS[2], ms=4, alpha=0.4, label="optimised, every node")
    ratio.set(xlabel="load mass, t", ylabel="rope paid out / heave", title="Ratio at the nodes")
    ratio.legend(fontsize=8)
    by_length = np.moveaxis(np.degrees(np.angle(drive_map.ratio)), 3, 0).reshape(len(drive_map.length), -1)
    lead.semilogx(drive_map.length, by_length, "o", color=COLOURS[2], ms=4, alpha=0.3)
    lead.set(xlabel="rope length, m", ylabel="lead of the drive, °", title="Lead at the nodes")
    pairs = np.array([(each.optimum.remaining, each.remaining) for each in held_out])
    error.loglog(*np.maximum(pairs, 1e-8).T, "o", color=COLOURS[3], ms=4, alpha=0.6)
    error.set(
        xlabel="RMS left by the optimum, share of still",
        ylabel="RMS left by the map",
        title="Regular heaves between the nodes",
    )
    place, labels = 0, []
    for sea in seas:
        still = sea.entries[0].episodes
        for number, entry in enumerate(sea.entries[1:], start=1):
            # What is left, on a logarithmic axis: from 0 to 90 % is as far as from 90 to 99 %.
            reduction.boxplot(
                np.maximum(1.0 - reductions(entry, still), 1e-4),
                positions=[place],
                widths=0.7,
                whis=(5, 95),
                showfliers=False,
                patch_artist=True,
                boxprops={"facecolor": COLOURS[number], "alpha": 0.6},
                medianprops={"color": "black"},
            )
            labels.append((place, f"{sea.kind}\n{entry.policy.replace(', ', ',' + chr(10))}"))
            place += 1
        place += 1
    reduction.set_xticks(*zip(*labels, strict=True), fontsize=8)
    reduction.set_yscale("log")
    reduction.set_ylim(5.0, 1e-4)
    ticks = [1.0, 0.1, 0.01, 0.001]
    reduction.set_yticks(ticks, [f"{1.0 - tick:.1%}".replace(".0%", "%") for tick in ticks])
    reduction.set(ylabel="heave reduction", title="Held-out scenarios: quartiles, and 5 to 95 %")
    reduction.axhline(1.0, color="#888888", lw=0.8)
    for axis in (ratio, lead, error, reduction):
        axis.grid(alpha=0.3)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))
