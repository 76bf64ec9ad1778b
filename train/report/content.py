"""What the report shows, as plain figures: the page draws, it does not compute."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import welch

from agents.policy import FloatArray, Knowledge
from train.comparison import Entry, Interval, Row, reductions
from train.episode_table import Traits
from train.held_out import CONTROL_PERIOD, DURATION, Comparison
from train.report.diagnosis import Field, remarks

Numbers = list[float]

MOST_POINTS: Final = 1000
"""Of a curve or a cloud of points; more are thinned out evenly."""
BINS: Final = 8
EXAMPLES: Final = 12
WORST_SHARE: Final = 0.01
FEWEST_WORST, MOST_WORST = 2, 10
SPECTRUM_SAMPLES: Final = 256
"""Samples in a segment of a spectrum: 25.6 s, so a resolution of 0.04 Hz."""


@dataclass(frozen=True)
class PolicyCard:
    """A policy: who it is, what it knows, its figures."""

    name: str
    knows: str
    privileged: bool
    figures: Row


@dataclass(frozen=True)
class Curve:
    """Points of a curve."""

    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Pair:
    """A policy beside a reference on the scenarios that both ran in; None without such."""

    scenarios: int
    difference: Interval
    """Of the heave reduction, policy minus reference."""
    ratio: Interval
    """RMS of the policy over RMS of the reference."""
    better: float
    """Share of scenarios in which the policy's RMS is the smaller one."""


@dataclass(frozen=True)
class Dependence:
    """What each policy leaves (1 - heave reduction), against one trait of the scenario."""

    trait: str
    label: str
    x: Numbers
    """Of every scenario shown."""
    left: list[Numbers]
    """Of every policy in every scenario shown that it ran in."""
    median: list[Curve]
    """Of every policy, over bins of equally many scenarios."""


@dataclass(frozen=True)
class History:
    """One policy's histories in one scenario, from 0 s on, one value each control period."""

    policy: int
    """Place in the list of policies."""
    error: Numbers
    """m."""
    rope_speed: Numbers
    """m/s, positive pays out."""
    tension: Numbers
    """kN."""
    reduction: float
    rms: float
    """m."""


@dataclass(frozen=True)
class Example:
    """A scenario that can be picked, with the histories of every policy that ran in it."""

    scenario: int
    label: str
    traits: Traits
    histories: list[History]


@dataclass(frozen=True)
class Episode:
    """One of a policy's worst episodes."""

    scenario: int
    traits: Traits
    reduction: float
    rms: float
    """m."""
    omega2: float
    """m."""
    still_rms: float
    """m."""
    what: list[str]
    error: Numbers
    """m."""
    still_error: Numbers
    """m."""


@dataclass(frozen=True)
class Content:
    """All that the page shows."""

    control_period: float
    """s."""
    policies: list[PolicyCard]
    reference: int
    """The policy that the page looks at first: the best of those that do not know the future."""
    profiles: list[Curve]
    """x: 1 - heave reduction; y: share of scenarios that have no more of it."""
    pairs: list[list[Pair | None]]
    """Of each policy (second index) beside each reference (first index)."""
    dependences: list[Dependence]
    spectra: list[Curve]
    """x: Hz; y: median spectral density of the depth error, m²/Hz."""
    examples: list[Example]
    worst: list[list[Episode]]


def content(comparison: Comparison) -> Content:
    """Gather what the report shows."""
    entries = comparison.entries
    left = [1.0 - reductions(entry, comparison.still) for entry in entries]
    reference = _reference(entries, left)
    field = Field.of(comparison)
    return Content(
        control_period=CONTROL_PERIOD,
        policies=[
            PolicyCard(entry.policy, entry.knows.value, entry.knows is Knowledge.FUTURE, row)
            for entry, row in zip(entries, comparison.rows, strict=True)
        ],
        reference=reference,
        profiles=[_profile(values) for values in left],
        pairs=_pairs(entries, left),
        dependences=_dependences(field.traits, left),
        spectra=[_spectrum(entry.episodes.error) for entry in entries],
        examples=[
            _example(comparison, field, index, label) for index, label in choose_examples(left, reference).items()
        ],
        worst=[[_episode(comparison, field, entry, i) for i in worst(values)] for entry, values in _with(entries, left)],
    )


def _with(entries: tuple[Entry, ...], left: list[FloatArray]) -> list[tuple[Entry, FloatArray]]:
    """Each policy with what it leaves; nothing to look at in the yardstick's own."""
    return [(e, values if i else values[:0]) for i, (e, values) in enumerate(zip(entries, left, strict=True))]


def _reference(entries: tuple[Entry, ...], left: list[FloatArray]) -> int:
    fair = [i for i, entry in enumerate(entries) if entry.knows is not Knowledge.FUTURE]
    return min(fair, key=lambda i: float(np.median(left[i])))


def numbers(values: npt.ArrayLike, digits: int = 4) -> Numbers:
    """Values rounded to so many digits of the largest one; the page needs no more, and stays small."""
    array = np.asarray(values, dtype=np.float64)
    top = float(np.max(np.abs(array), initial=0.0))
    places = digits - 1 - math.floor(math.log10(top)) if top > 0.0 else 0
    return [float(v) for v in np.round(array, places)]


def significant(values: npt.ArrayLike, digits: int = 4) -> Numbers:
    """Values rounded to so many significant digits each."""
    return [float(f"{v:.{digits}g}") for v in np.asarray(values, dtype=np.float64).tolist()]


def _thinned(count: int) -> npt.NDArray[np.int64]:
    return np.unique(np.linspace(0, count - 1, min(count, MOST_POINTS)).round().astype(np.int64))


def _profile(left: FloatArray) -> Curve:
    kept = _thinned(len(left))
    return Curve(significant(np.sort(left)[kept]), significant((kept + 1) / len(left)))


def _pairs(entries: tuple[Entry, ...], left: list[FloatArray]) -> list[list[Pair | None]]:
    # The two directions of a pair are each other's mirror image, but the bootstrap is quick enough to do both.
    return [[None if a == b else _pair(entries, left, a, b) for b in range(len(entries))] for a in range(len(entries))]


def _pair(entries: tuple[Entry, ...], left: list[FloatArray], reference: int, policy: int) -> Pair | None:
    n = min(len(left[reference]), len(left[policy]))
    ours, theirs = entries[policy].episodes.rms[:n], entries[reference].episodes.rms[:n]
    if not (ours > 0.0).all() or not (theirs > 0.0).all():
        return None
    return Pair(
        scenarios=n,
        difference=Interval.of(left[reference][:n] - left[policy][:n]),
        ratio=Interval.of(ours / theirs),
        better=float(np.mean(ours < theirs)),
    )


def _dependences(traits: tuple[Traits, ...], left: list[FloatArray]) -> list[Dependence]:
    axes = {
        "hs": ("significant wave height Hs, m", 1.0),
        "tp": ("peak period Tp, s", 1.0),
        "load_mass": ("load mass, t", 1e-3),
        "rope_length": ("rope length, m", 1.0),
    }
    found = []
    for trait, (label, scale) in axes.items():
        x = scale * np.array([getattr(t, trait) for t in traits])
        kept = _thinned(len(x))
        found.append(
            Dependence(
                trait,
                label,
                significant(x[kept]),
                [significant(values[kept[kept < len(values)]]) for values in left],
                [_binned(x[: len(values)], values) for values in left],
            )
        )
    return found


def _binned(x: FloatArray, left: FloatArray) -> Curve:
    parts = np.array_split(np.argsort(x, kind="stable"), min(BINS, max(1, len(x) // 4)))
    return Curve(
        significant([float(np.median(x[part])) for part in parts]),
        significant([float(np.median(left[part])) for part in parts]),
    )


def _spectrum(error: npt.NDArray[np.float32]) -> Curve:
    samples = min(SPECTRUM_SAMPLES, error.shape[1])
    frequency, density = welch(error.astype(np.float64), fs=1.0 / CONTROL_PERIOD, nperseg=samples, axis=1)
    return Curve(significant(frequency[1:]), significant(np.median(density, axis=0)[1:]))


def worst(left: FloatArray) -> list[int]:
    """The scenarios in which most is left, the worst first: 1 % of them, but a few at least."""
    count = min(len(left), MOST_WORST, max(FEWEST_WORST, math.ceil(WORST_SHARE * len(left))))
    return [int(i) for i in np.argsort(-left, kind="stable")[:count]]


def choose_examples(left: list[FloatArray], reference: int) -> dict[int, str]:
    """Scenarios to look at, with what they are: the reference's worst ones, and quantiles of what it leaves.

    The quantiles are taken where every policy ran, so that the privileged ones are there too.
    """
    values = left[reference]
    chosen = {i: f"worst {rank}" for rank, i in enumerate(worst(values)[:4], 1)}
    shared = values[: min(len(v) for v in left)]
    order = [int(i) for i in np.argsort(shared, kind="stable")]
    count = EXAMPLES - len(chosen)
    for step in range(count):
        share = step / (count - 1)
        index = order[round(share * (len(order) - 1))]
        label = {0: "best", count - 1: "worst of those with every policy"}.get(step, f"{share:.0%} quantile")
        chosen.setdefault(index, label)
    return chosen


def _example(comparison: Comparison, field: Field, index: int, label: str) -> Example:
    radius = comparison.scenarios[index].crane.winch.drum_radius
    histories = []
    for place, entry in enumerate(comparison.entries):
        episodes = entry.episodes
        if index < len(episodes.omega1):
            histories.append(
                History(
                    policy=place,
                    error=numbers(episodes.error[index]),
                    rope_speed=numbers(radius * episodes.drum_speed[index], 3),
                    tension=numbers(1e-3 * episodes.tension[index]),
                    reduction=float(reductions(entry, comparison.still)[index]),
                    rms=float(episodes.rms[index]),
                )
            )
    return Example(index, label, field.traits[index], histories)


def _episode(comparison: Comparison, field: Field, entry: Entry, index: int) -> Episode:
    episodes = entry.episodes
    return Episode(
        scenario=index,
        traits=field.traits[index],
        reduction=float(reductions(entry, comparison.still)[index]),
        rms=float(episodes.rms[index]),
        omega2=float(episodes.omega2[index]),
        still_rms=float(comparison.still.rms[index]),
        what=remarks(comparison, field, episodes, index),
        error=numbers(episodes.error[index], 3),
        still_error=numbers(comparison.still.error[index], 3),
    )


__all__ = ["DURATION", "Content", "content"]
