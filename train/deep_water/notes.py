"""Tables and text of the study."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from agents.policy import FloatArray
from train.deep_water.harmonics import Between, Checked, Found, WetNode, closed_forms, rms_of_heave
from train.deep_water.passage import Passage, Passed, bobbing_periods
from train.deep_water.zero_shot import Left, Trial
from train.evaluate.statistics import tail_mean
from train.shared.markdown import table

BANDS = 5
"""Stretches of the way down in the table of the lowering."""

TEXT = """\
# Deep water and heavy ropes: what they do to control
Made by `{command}`. What it says in words: [deep-water.md](../../docs/deep-water.md).

## Policies as they are
{count} held-out lifts of 60 s at each depth below the pulley: 70 mm of six-strand rope, loads of 30 to 100 t with 0.8
of their mass added, seas of 1 to 4 m. Heave reduction 1 − RMS / RMS(drum still): median / mean / mean of the worst 5 %
({tail} lifts).

{reductions}
RMS depth error, mm: median, and the worst of the lifts.

{errors}
On sensors with the load's depth told by a transponder, late and seldom, in place of a depth sensor once a second:

{late}
![Policies by depth](zero_shot.png)

## The drive map made anew
{nodes} nodes of heave amplitude, period, mass and depth. The best harmonic drive pays out {low:.4f} to {high:.4f} of
the heave; from 1/(1 + strain at the pulley at rest) it differs by {off_median:.1e} in the median and {off_worst:.1e} at
most, its lead is {lead:.3f}° at most. From amplitude to amplitude it changes by {by_amplitude:.1e} at most. Load over
pulley, RMS, with the drum still; and what a hundredth too much leaves, mm for a metre of heave:

{still}
At {middles} middles of cells the interpolated drive is off by {ratio_error:.1e} at most. It leaves {interpolated:.2f}
mm in the median and {interpolated_worst:.2f} mm at most ({share_worst:.3%} of the heave); the middles' own best drives
leave {optimum_worst:.2f} mm at most, the closed form {closed_worst:.2f} mm, a hundredth too much {mistuned_worst:.0f}
mm.

![The drive map in deep water](drive_map.png)

## Lowering through the resonance
100 t with 80 t of added mass, from {top:g} to {bottom:g} m at {speed:g} m/s, Hs {hs:g} m and Tp {tp:g} s. RMS depth
error on the way, mm; in brackets the greatest:

{lowering}
![Depth error on the way down](lowering.png)
"""


@dataclass(frozen=True, kw_only=True)
class Study:
    """What was computed."""

    trials: Sequence[tuple[Trial, Left]]
    nodes: Sequence[tuple[WetNode, Found]]
    middles: Sequence[tuple[Between, Checked]]
    passages: Sequence[tuple[Passage, Passed]]

    @property
    def depths(self) -> list[float]:
        """Depths of the trials, m."""
        return list(dict.fromkeys(trial.depth for trial, _ in self.trials))

    def policies(self, transponder: bool = False) -> list[str]:
        """Names of the policies beside the drum still."""
        names = [left.name for trial, left in self.trials if trial.transponder == transponder]
        return [name for name in dict.fromkeys(names) if name != "drum still"]

    def left(self, name: str, depth: float, transponder: bool = False) -> Left:
        """What a policy left at a depth."""
        return next(
            left
            for trial, left in self.trials
            if (left.name, trial.depth, trial.transponder) == (name, depth, transponder)
        )

    def reduction(self, name: str, depth: float, transponder: bool = False) -> FloatArray:
        """Heave reductions (N,) of a policy at a depth."""
        return np.asarray(1.0 - self.left(name, depth, transponder).rms / self.left("drum still", depth).rms)


def _csv(heading: str, rows: Iterable[Sequence[object]]) -> str:
    lines = [",".join(f"{cell:.7g}" if isinstance(cell, float) else str(cell) for cell in row) for row in rows]
    return "\n".join([heading, *lines]) + "\n"


def zero_shot_csv(study: Study) -> str:
    """Every lift of every policy."""
    return _csv(
        "policy,knows,transponder,depth_m,lift,rms_m,greatest_m",
        (
            (left.name, left.knows, int(trial.transponder), trial.depth, i, float(rms), float(left.greatest[i]))
            for trial, left in study.trials
            for i, rms in enumerate(left.rms)
        ),
    )


def map_csv(study: Study) -> str:
    """Every node of the map."""
    closed = closed_forms([node for node, _ in study.nodes]).tolist()
    return _csv(
        "amplitude_m,period_s,mass_kg,depth_m,ratio_real,ratio_imaginary,closed_form,best_rms_m,still_rms_m,"
        "a_hundredth_more_rms_m",
        (
            (
                *(n.amplitude, n.period, n.mass, n.length),
                *(f"{value:.9f}" for value in (f.best.real, f.best.imaginary, c)),
                *(f.best.remaining * f.still, f.still, f.mistuned),
            )
            for (n, f), c in zip(study.nodes, closed, strict=True)
        ),
    )


def between_csv(study: Study) -> str:
    """Every middle of a cell of the map."""
    return _csv(
        "amplitude_m,period_s,mass_kg,depth_m,ratio_error,map_rms_m,best_rms_m,closed_form_rms_m,still_rms_m",
        (
            (
                *(b.node.amplitude, b.node.period, b.node.mass, b.node.length, c.ratio_error, c.interpolated),
                *(c.optimum.best.remaining * c.optimum.still, c.optimum.closed_form, c.optimum.still),
            )
            for b, c in study.middles
        ),
    )


def lowering_csv(study: Study) -> str:
    """Depth errors on the way down, once a second."""
    names = [passed.name.replace(" ", "_") + "_m" for _, passed in study.passages]
    depths = study.passages[0][0].depths
    errors = np.stack([passed.error for _, passed in study.passages], axis=1)
    rows = np.concatenate([depths[:, None], errors], axis=1)[::5]
    return _csv(
        "time_s,depth_m," + ",".join(names),
        ((i, *(f"{each:.4f}" for each in row)) for i, row in enumerate(rows.tolist())),
    )


def _percent(value: float) -> str:
    return f"{value:.2%}" if value > 0.995 else f"{value:.1%}"


def _reductions(study: Study, transponder: bool = False) -> str:
    rows = []
    for name in study.policies(transponder):
        cells = []
        for depth in study.depths:
            values = study.reduction(name, depth, transponder)
            tail = float(tail_mean(values))
            cells.append(" / ".join(map(_percent, (float(np.median(values)), float(values.mean()), tail))))
        knows = study.left(name, study.depths[0], transponder).knows
        rows.append([name, knows.split(" (")[0], *cells])
    return table(["policy", "knows", *(f"{depth:,.0f} m" for depth in study.depths)], rows)


def _errors(study: Study) -> str:
    def cells(values: FloatArray) -> str:
        return f"{1e3 * float(np.median(values)):,.3g} ({1e3 * float(values.max()):,.3g})"

    names = ["drum still", *study.policies()]
    rows = [[name, *(cells(study.left(name, depth).rms) for depth in study.depths)] for name in names]
    return table(["policy", *(f"{depth:,.0f} m" for depth in study.depths)], rows)


def _still(study: Study) -> str:
    by_place = {(n.amplitude, n.period, n.mass, n.length): (n, f) for n, f in study.nodes}
    amplitudes, periods, masses, depths = (list(dict.fromkeys(axis)) for axis in zip(*by_place, strict=True))
    rows = []
    for mass in masses:
        for depth in depths:
            for amplitude in amplitudes:
                cells = []
                for period in periods:
                    node, found = by_place[amplitude, period, mass, depth]
                    heave = rms_of_heave(node)
                    cells.append(f"{found.still / heave:.2f}, {1e3 * found.mistuned / heave:.0f}")
                rows.append([f"{mass / 1e3:g} t", f"{depth:,.0f} m", f"{amplitude:g} m", *cells])
    return table(["load", "depth", "amplitude", *(f"{period:g} s" for period in periods)], rows)


def _lowering(study: Study) -> str:
    passage, _ = study.passages[0]
    edges = np.linspace(passage.top, passage.bottom, BANDS + 1)
    depths = passage.depths
    headings = ["", *(f"{a:,.0f} to {b:,.0f} m" for a, b in itertools.pairwise(edges)), "all"]
    bands = [(depths > a) & (depths <= b) for a, b in itertools.pairwise(edges)]
    bobbing = bobbing_periods(passage, edges)
    rows = [["period of the bobbing, s", *(f"{a:.1f} to {b:.1f}" for a, b in itertools.pairwise(bobbing)), ""]]
    for _, passed in study.passages:
        name = "drum only lowering" if passed.name == "drum still" else passed.name
        parts = [passed.error[band] for band in (*bands, slice(None))]
        rows.append([name, *(f"{1e3 * np.sqrt(np.mean(e**2)):,.3g} ({1e3 * abs(e).max():,.3g})" for e in parts)])
    return table(headings, rows)


def readme(command: str, study: Study) -> str:
    """README.md of the study."""
    ratio = np.array([found.ratio for _, found in study.nodes])
    off = abs(ratio - closed_forms([node for node, _ in study.nodes]))
    amplitudes = len({node.amplitude for node, _ in study.nodes})
    by_amplitude = abs(np.ptp(abs(ratio).reshape(amplitudes, -1), axis=0))
    checked = [each for _, each in study.middles]
    interpolated = np.array([each.interpolated for each in checked])
    heave = np.array([rms_of_heave(each.node) for each, _ in study.middles])
    passage = study.passages[0][0]
    count = study.trials[0][0].count
    return TEXT.format(
        command=command,
        count=count,
        tail=max(1, int(np.ceil(0.05 * count - 1e-9))),
        reductions=_reductions(study),
        errors=_errors(study),
        late=_reductions(study, transponder=True),
        nodes=len(ratio),
        low=abs(ratio).min(),
        high=abs(ratio).max(),
        off_median=np.median(off),
        off_worst=off.max(),
        lead=abs(np.degrees(np.angle(ratio))).max(),
        by_amplitude=by_amplitude.max(),
        still=_still(study),
        middles=len(checked),
        ratio_error=max(each.ratio_error for each in checked),
        interpolated=1e3 * np.median(interpolated),
        interpolated_worst=1e3 * interpolated.max(),
        share_worst=(interpolated / heave).max(),
        optimum_worst=1e3 * max(each.optimum.best.remaining * each.optimum.still for each in checked),
        closed_worst=1e3 * max(each.optimum.closed_form for each in checked),
        mistuned_worst=1e3 * max(each.optimum.mistuned for each in checked),
        top=passage.top,
        bottom=passage.bottom,
        speed=passage.speed,
        hs=passage.hs,
        tp=passage.tp,
        lowering=_lowering(study),
    )
