"""notes.md: the table, the assumptions, and the differences from the paper's experiment with their reasons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from aframe_env.scenario.crane import Winch
from agents.policy import FloatArray
from train.drives.results import HEADINGS, Experiment, Result, demand
from train.shared.markdown import table


@dataclass(frozen=True)
class Variant:
    """The paper's case with another start or rope damping, which the paper does not state."""

    initial: str
    damping_ratio: float
    free_start: bool
    """Whether φ_H⁰ and A_0 are decision variables."""
    results: Sequence[Result]


PAPER = """\
## Where this differs from the paper, and why
- The paper's drawing of the crane has no figures left; the reference crane is a plausible 100 t A-frame of our own.
  Amplitudes are therefore compared in order of magnitude: about 2 m and more with the drum still, near zero after
  optimisation, and for Ω1 the harmonic drive several times better than the spline (the paper: about 8 times).
- Start and rope damping are not stated there. Here the load starts at rest under the rope that holds it at h, with
  {ratio:.0%} of critical damping; the table of variants below shows what else they could be. With an undamped rope
  the 18-interval spline excites the load's bobbing (2.4 s, near the 2 s between its knots), which never dies. A load
  that starts with the deck's velocity, 1.05 m/s, bobs by 0.4 m at once, and no drive of these families stops that.
- In the paper the spline's value at the start, φ_H⁰ in (35), and the harmonic's constant, A_0 in (36), are decision
  variables. A drum that starts elsewhere than at 0 has moved the load before the start, which no episode of the
  environment knows: the drives here start at φ_H(0) = 0, and have one variable less, unless `--free-start` is given.
  The load then hangs lower or higher at the start; the variant with a free start shows what that is worth: little.
  The spline ends with no second derivative.
- Nelder-Mead (unless the command names another optimiser) starts from the inverse of the geometry and is restarted
  until a round gains less than 0.2 %, where the paper says only that it was used; Ω2 starts from the optimum of Ω1.
- The simplified model (rigid frame) is optimised on; the drum follows the drive exactly, as in the paper, from a
  running start: dφ/dt at 0 is not zero.

## Variants of start and damping: amplitude, mm
"""


def _comparison(results: Sequence[Result]) -> str:
    """Compare the families."""
    amplitude = {r.row.label: r.row.amplitude for r in results}
    text = ""
    for index in "12":
        spline, harmonic = amplitude.get(f"S-Ω{index}"), amplitude.get(f"H-Ω{index}")
        if spline is not None and harmonic is not None:
            text += f"- Ω{index}: the spline's amplitude is {spline / harmonic:.1f} times the harmonic's.\n"
    return f"\n{text}" if text else ""


def _demands(results: Sequence[Result], times: FloatArray, winch: Winch) -> str:
    """Table of the drives' demands on the winch."""
    r = winch.drum_radius
    rows = []
    for result in results:
        if result.drive is not None:
            d = demand(result.drive, times)
            kept = d.speed <= winch.max_speed and d.acceleration <= winch.max_acceleration
            cells = (f"{r * d.start_speed:.2f}", f"{r * d.speed:.2f}", f"{r * d.acceleration:.2f}")
            rows.append((result.row.label, *cells, "yes" if kept else "no"))
    headings = ("drive", "speed at the start, m/s", "greatest speed, m/s", "acceleration, m/s²", "within the limits")
    limits = f"{winch.max_rope_speed:g} m/s, {winch.max_rope_acceleration:g} m/s²"
    return f"\n## What the drives ask of the winch (rope; limits {limits})\n" + table(headings, rows)


def _transfers(results: Sequence[Result]) -> str:
    """Table of the same drives in the full model."""
    rows = [
        (
            result.row.label,
            f"{1e3 * result.row.amplitude:.4g}",
            f"{1e3 * result.full.amplitude:.4g}",
            f"{1e3 * result.full.swing:.4g}",
        )
        for result in results
        if result.full is not None
    ]
    if not rows:
        return ""
    headings = ("drive", "amplitude, simplified, mm", "amplitude, full, mm", "swing, full, mm")
    return (
        "\n## The same drives in the full model\n"
        + table(headings, rows)
        + "\nThe frame sags under the load, which the drives do not know of: the amplitude about h includes that. The\n"
        "swing, half the distance from the lowest place to the highest, has not.\n"
    )


def notes(
    command: str,
    winch: Winch,
    experiment: Experiment,
    variants: Sequence[Variant],
    damping_ratio: float,
) -> str:
    """Text of notes.md; with ``variants`` it is the paper's case."""
    results = experiment.results
    text = f"# Optimised drum drives\nMade by `{command}`.\n\n"
    text += table(HEADINGS, [result.row.cells for result in results])
    text += _comparison(results) + _demands(results, experiment.times, winch) + _transfers(results)
    if variants:
        rows = [
            (
                variant.initial,
                "free" if variant.free_start else "0",
                f"{variant.damping_ratio:.0%}",
                *(f"{1e3 * r.row.amplitude:.4g}" for r in variant.results),
            )
            for variant in variants
        ]
        headings = ("load's start", "drum's start", "damping, of critical", *(result.row.label for result in results))
        text += "\n" + PAPER.format(ratio=damping_ratio) + table(headings, rows)
    return text
