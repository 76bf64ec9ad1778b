"""notes.md of a drive map: its contents, its performance and its limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aframe_env.scenario import Crane
from agents.drives.map import DriveMap, Node, NodeDrive, ideal_ratio
from agents.policy import FloatArray
from train.drive_map.between_nodes import HeldOut
from train.drive_map.seas import InSea
from train.evaluate.tables import HEADINGS, cells, markdown_table
from train.shared.markdown import table

TEXT = """\
# Map of basic drives
Made by `{command}`.

{nodes:,} nodes ({shape}: heave amplitudes, periods, load masses, rope lengths), each one harmonic optimised for Ω1 by
Gauss-Newton: {evaluations:.0f} evaluations a node in the mean. {speed}

## What it says
For a tip that only heaves the best drive pays out 1/(1 + m g/(E_R F_R)) of the heave, in phase with it, whatever its
period, its amplitude and the rope's length: that keeps the tension at the load's weight, and the load feels no motion.
The optimiser is not told so: it starts with half of the heave, and late. Over all nodes its ratio differs from that
closed form by {closed_median:.1e} in the median and {closed_worst:.1e} at most; it leaves {remaining:.1e} of the motion
(RMS, worst node). The map is nearly flat ({ratio_low:.4f} to {ratio_high:.4f}): mass is the only axis that matters, and
one formula could replace it.

## Between the nodes
{count} regular heaves that no node has, optimised afresh: the interpolated ratio is off by {error_median:.1e} of the
heave in the median, {error_worst:.1e} at most. The map's drive leaves {left_median:.1e} of the motion (RMS; worst
{left_worst:.1e}), the optimum, free to shift its frequency too, {best_median:.1e} (worst {best_worst:.1e}).

## In seas
In the environment, with the winch's limits, over 60 s, {scenarios} held-out scenarios of each kind. "In real time" a
filter of the motion unit's heave rate tells the waves of the moment, and the map gives the drives for them; it acts on
the sensors, with their noise and delay, and has no feedback of the load. "By the clock" the crane tip's heave is
measured for some minutes before the start, harmonics are fitted to it, and then the time alone counts. With "every wave
known" it is told every component with its phase, which in a linear sea is the whole future: what the map itself is
worth, as far as superposition holds. The last column knows the future too. Heave reduction 1 − RMS / RMS(drum still),
median and 95 % bootstrap interval:

{summary}
Where even a drive that knows the future falls short, the sea asks more of the winch than it has (Hs above 3 m), or
there is next to nothing to remove (a regular wave shorter than 3 s moves the tip by millimetres). With every wave known
the map is behind a fresh optimisation by what is not linear in the waves: the tip also sinks with the squares of the
ship's roll and pitch, and the load's swing hoists it. Where the ship only heaves the difference goes.

So the map is right, and what fails by the clock in a random sea is the forecast: phases measured at the start are worth
about one wave there, and a drive that runs by the clock for a minute is soon out of step. Measuring notices this (it
takes from the harmonics only what they have forecast of the record itself) and leaves the drum nearly still. In real
time, with the heave measured all along, the map becomes feed-forward of that heave with the gain above.

{tables}"""


def summary(seas: Sequence[InSea]) -> str:
    """Heave reduction of every policy in every kind of sea, as Markdown."""
    policies, column = [row.policy for row in seas[0].rows[1:]], HEADINGS.index("median")
    return table(["sea", *policies], ([sea.kind, *(cells(row)[column] for row in sea.rows[1:])] for sea in seas))


def closed_form(drive_map: DriveMap, crane: Crane) -> FloatArray:
    """(M,) the ideal ratio at the map's masses."""
    a, p, length = drive_map.amplitude[0], drive_map.period[0], drive_map.length[0]
    nodes = [Node(amplitude=a, period=p, mass=m, length=length, crane=crane) for m in drive_map.mass.tolist()]
    return np.array([ideal_ratio(node.scenario) for node in nodes])


def notes(
    command: str,
    drive_map: DriveMap,
    crane: Crane,
    found: Sequence[NodeDrive],
    held_out: Sequence[HeldOut],
    seas: Sequence[InSea],
    fresh: int,
    rate: float,
) -> str:
    """Text of notes.md; ``fresh`` nodes were optimised in this run, at ``rate`` a second."""
    ratio = np.abs(drive_map.ratio)
    off = np.abs(drive_map.ratio - closed_form(drive_map, crane)[:, None])
    error = np.array([each.ratio_error for each in held_out])
    left = np.array([each.remaining for each in held_out])
    best = np.array([each.optimum.remaining for each in held_out])
    return TEXT.format(
        command=command,
        nodes=drive_map.ratio.size,
        shape=" × ".join(map(str, drive_map.shape)),
        evaluations=float(np.mean([each.evaluations for each in found])),
        speed=f"This run optimised {fresh:,} of them, {rate:.0f} a second." if fresh else "All came from the store.",
        closed_median=float(np.median(off)),
        closed_worst=float(off.max()),
        remaining=float(drive_map.remaining.max()),
        ratio_low=float(ratio.min()),
        ratio_high=float(ratio.max()),
        count=len(held_out),
        error_median=float(np.median(error)),
        error_worst=float(error.max()),
        left_median=float(np.median(left)),
        left_worst=float(left.max()),
        best_median=float(np.median(best)),
        best_worst=float(best.max()),
        scenarios=seas[0].rows[0].scenarios,
        summary=summary(seas),
        tables="\n".join(f"### {sea.kind.capitalize()}\n{markdown_table(sea.rows)}" for sea in seas),
    )
