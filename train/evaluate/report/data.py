"""The report's data as plain figures: the page draws, it does not compute."""

from __future__ import annotations

import math
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import welch

from aframe_env.config import TaskConfig
from agents.policy import FloatArray, Knowledge
from agents.rollout import Episodes
from train.evaluate.episode_table import Traits
from train.evaluate.report.remarks import Field, intact, remarks
from train.evaluate.run import Comparison
from train.evaluate.statistics import Entry, Interval, Row, compare, compare_families, families, reductions
from train.shared.cli import program

Numbers = list[float]

MOST_POINTS: Final = 400
"""Most points of a curve or a cloud; more are thinned out evenly."""
BINS: Final = 8
MOST_PLACES: Final = 15
"""After the decimal point."""
QUANTILES: Final = {
    0.5: "median",
    0.0: "best",
    0.1: "10\u00a0% quantile",
    0.25: "25\u00a0% quantile",
    0.75: "75\u00a0% quantile",
    0.9: "90\u00a0% quantile",
    1.0: "worst in which every policy ran",
}
"""Quantiles of what the reference leaves: the scenarios to look at."""
WORST: Final = ("worst of all", "second worst", "third worst", "fourth worst")
WORST_SHARE: Final = 0.01
FEWEST_WORST, MOST_WORST = 2, 10
REMOVES_NOTHING: Final = 0.95
"""Share that is left by a policy that does next to nothing."""
SPECTRUM_SAMPLES: Final = 512
"""Samples in a segment of a spectrum: 51.2 s, so a resolution of 0.02 Hz."""
TRAITS: Final = {
    "hs": ("significant wave height Hs, m", 1.0),
    "tp": ("peak period Tp, s", 1.0),
    "load_mass": ("load mass, t", 1e-3),
    "rope_length": ("rope length, m", 1.0),
}
"""Traits of a scenario that reduction is shown against: label, and factor from SI."""


@dataclass(frozen=True)
class PolicyCard:
    """A policy, or agents that differ in their seed alone: who, what it knows, in how many of the scenarios it ran."""

    name: str
    knows: str
    privileged: bool
    scenarios: int
    family: int
    """Place of the agents that it is one seed of; of all others, their own."""
    seeds: list[int]
    """Places of its seeds; of a single policy, its own."""
    replay: str
    """Command that records an episode of it, but for the scenario's number; empty where it cannot be recorded so."""


@dataclass(frozen=True)
class Curve:
    """Points of a curve."""

    x: Numbers
    y: Numbers


@dataclass(frozen=True)
class Subset:
    """Every policy's figures over its own scenarios, or over those alone in which all of them ran."""

    label: str
    figures: list[Row]
    profiles: list[Curve]
    """x: 1 - heave reduction; y: share of scenarios that have no more of it."""
    spectra: list[Curve]
    """x: Hz; y: median spectral density of the depth error, m²/Hz."""


@dataclass(frozen=True)
class Pair:
    """A policy beside a reference on the scenarios that both ran in."""

    scenarios: int
    difference: Interval
    """Difference of the heave reductions, policy minus reference."""
    ratio: Interval
    """RMS of the policy over RMS of the reference."""
    spread: tuple[float, float]
    """The ratio's 5 % and 95 % quantiles over the scenarios."""
    better: float
    """Share of scenarios in which the policy's RMS is the smaller one."""


@dataclass(frozen=True)
class Cloud:
    """One policy's remainders in the scenarios, point by point."""

    scenarios: list[int]
    left: Numbers
    """1 - heave reduction."""


@dataclass(frozen=True)
class Dependence:
    """One trait of every scenario, and what each policy leaves over bins of equally many scenarios."""

    label: str
    x: Numbers
    median: list[Curve]


@dataclass(frozen=True)
class History:
    """One policy's histories in one scenario, one value each control period until the rope parts, if it does."""

    policy: int
    """Place in the list of policies."""
    error: Numbers
    """m."""
    rope_speed: Numbers
    """m/s, positive pays out."""
    tension: Numbers
    """kN."""
    reduction: float


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
class _Unit:
    """What has a place in the report: a policy, or several agents that differ in their seed alone."""

    name: str
    members: tuple[Entry, ...]

    @property
    def episodes(self) -> tuple[Episodes, ...]:
        return tuple(member.episodes for member in self.members)

    def left(self, still: Episodes) -> FloatArray:
        """Share of the heave that is left in each scenario (seeds, N)."""
        return np.stack([1.0 - reductions(member, still) for member in self.members])


def _units(entries: Sequence[Entry]) -> tuple[list[_Unit], list[int]]:
    """Agents of several seeds, each before its seeds, and all other policies; the place of each one's family."""
    units: list[_Unit] = []
    family: list[int] = []
    for name, members in families(entries):
        place = len(units)
        units.append(_Unit(name, members))
        if len(members) > 1:
            units += [_Unit(member.policy, (member,)) for member in members]
        family += [place] * (len(units) - place)
    return units, family


@dataclass(frozen=True)
class Content:
    """All that the page shows."""

    control_period: float
    """s."""
    policies: list[PolicyCard]
    """Agents of several seeds are there together, each before its seeds one by one."""
    reference: int
    """The policy that the page looks at first: the best of those that do not know the future."""
    featured: list[int]
    """Drawn first where all would be too many: the drum still, the policy named first, the best of each knowledge."""
    subsets: list[Subset]
    pairs: list[list[Pair | None]]
    """Pairs of each policy (second index) beside each reference (first index); None beside itself or a perfect one."""
    clouds: list[Cloud]
    dependences: list[Dependence]
    examples: list[Example]
    worst: list[list[Episode]]
    """Each policy's, the worst first; none for the drum still, which is the measure."""


def content(comparison: Comparison) -> Content:
    """Gather what the report shows."""
    units, family = _units(comparison.entries)
    left = [unit.left(comparison.still) for unit in units]
    means = [values.mean(axis=0) for values in left]
    top = sorted(set(family))
    reference = _reference(units, means, top)
    field = Field.of(comparison)
    return Content(
        control_period=comparison.still.control_period,
        policies=[
            PolicyCard(
                name=unit.name,
                knows=unit.members[0].knows.value,
                privileged=unit.members[0].knows is Knowledge.FUTURE,
                scenarios=len(means[place]),
                family=family[place],
                seeds=[place] if len(unit.members) == 1 else list(range(place + 1, place + 1 + len(unit.members))),
                replay=_replay(unit.members[0], comparison.config),
            )
            for place, unit in enumerate(units)
        ],
        reference=reference,
        featured=_featured(units, means, top),
        subsets=_subsets(comparison, units),
        pairs=_pairs(units),
        clouds=[_cloud(values) for values in means],
        dependences=_dependences(field.traits, means),
        examples=[
            _example(comparison, units, field, index, label)
            for index, label in choose_examples(means, reference).items()
        ],
        worst=[
            [_episode(comparison, field, unit.members[0], index) for index in worst(values)]
            if len(unit.members) == 1 and place
            else []
            for place, (unit, values) in enumerate(zip(units, means, strict=True))
        ],
    )


def _replay(entry: Entry, config: TaskConfig) -> str:
    usual = TaskConfig()
    own_task = config.replaced(scenario=None, observation=usual.observation) != usual or config.source != usual.source
    if own_task or not entry.text:
        return ""
    observation = "state" if config.sensors is None else "sensors"
    return (
        f"{program('train.demo')} --record replay.html --policy {shlex.quote(entry.text)} --observation {observation} "
        f"--start 0 --seconds {config.duration:g} --scenario"
    )


def _reference(units: Sequence[_Unit], left: list[FloatArray], places: Sequence[int]) -> int:
    fair = [i for i in places if units[i].members[0].knows is not Knowledge.FUTURE]
    return min(fair, key=lambda i: float(np.median(left[i])))


def _featured(units: Sequence[_Unit], left: list[FloatArray], places: Sequence[int]) -> list[int]:
    medians, most = [float(np.median(values)) for values in left], len(left[0])
    best: dict[Knowledge, int] = {}
    for i in sorted(places, key=lambda i: (len(left[i]) < most, medians[i])):
        # One that removes next to nothing would only hide the drum still.
        if medians[i] < REMOVES_NOTHING:
            best.setdefault(units[i].members[0].knows, i)
    return sorted({0, min(1, len(units) - 1), *best.values()})


def numbers(values: npt.ArrayLike, digits: int = 4) -> Numbers:
    """Values rounded to so many digits of the largest one; the page needs no more, and stays small."""
    array = np.asarray(values, dtype=np.float64)
    top = float(np.max(np.abs(array), initial=0.0))
    places = min(MOST_PLACES, digits - 1 - math.floor(math.log10(top))) if top > 0.0 else 0
    return [float(v) for v in np.round(array, places)]


def significant(values: npt.ArrayLike, digits: int = 4) -> Numbers:
    """Values rounded to so many significant digits each."""
    return [float(f"{v:.{digits}g}") for v in np.asarray(values, dtype=np.float64).tolist()]


def _thinned(count: int) -> npt.NDArray[np.int64]:
    return np.unique(np.linspace(0, count - 1, min(count, MOST_POINTS)).round().astype(np.int64))


def _subsets(comparison: Comparison, units: Sequence[_Unit]) -> list[Subset]:
    counts = {len(entry.episodes.omega1) for entry in comparison.entries}
    most, fewest = max(counts), min(counts)
    if most == fewest:
        return [_subset(f"all {most}", units, comparison.still, comparison.families, comparison.rows)]
    entries = [replace(entry, episodes=_first(entry.episodes, fewest)) for entry in comparison.entries]
    still = entries[0].episodes
    return [
        _subset(
            f"each policy's own, {fewest} to {most}", units, comparison.still, comparison.families, comparison.rows
        ),
        _subset(
            f"the first {fewest}, in which every policy ran",
            _units(entries)[0],
            still,
            compare_families(entries, still),
            compare(entries, still),
        ),
    ]


def _subset(
    label: str, units: Sequence[_Unit], still: Episodes, together: Sequence[Row], each: Sequence[Row]
) -> Subset:
    figures = {row.policy: row for row in (*each, *together)}
    return Subset(
        label=label,
        figures=[figures[unit.name] for unit in units],
        profiles=[_profile(unit.left(still).ravel()) for unit in units],
        spectra=[_spectrum(np.concatenate([e.error for e in unit.episodes]), still.control_period) for unit in units],
    )


def _first(episodes: Episodes, count: int) -> Episodes:
    arrays = {f.name: getattr(episodes, f.name)[:count] for f in fields(episodes) if f.name != "duration"}
    return replace(episodes, **arrays)


def _profile(left: FloatArray) -> Curve:
    kept = _thinned(len(left))
    return Curve(significant(np.sort(left)[kept]), significant((kept + 1) / len(left)))


def _spectrum(error: npt.NDArray[np.float32], control_period: float) -> Curve:
    samples = min(SPECTRUM_SAMPLES, error.shape[1])
    frequency, density = welch(error.astype(np.float64), fs=1.0 / control_period, nperseg=samples, axis=1)
    return Curve(significant(frequency[1:]), significant(np.median(density, axis=0)[1:]))


def _pairs(units: Sequence[_Unit]) -> list[list[Pair | None]]:
    count = len(units)
    pairs: list[list[Pair | None]] = [[None] * count for _ in range(count)]
    rms = [np.stack([episodes.rms for episodes in unit.episodes]) for unit in units]
    for a in range(count):
        for b in range(a + 1, count):
            pairs[a][b], pairs[b][a] = _pair(rms[0][0], rms[a], rms[b])
    return pairs


def _pair(still: FloatArray, first: FloatArray, second: FloatArray) -> tuple[Pair, Pair] | tuple[None, None]:
    """The second beside the first, and the first beside the second, which is its mirror image: RMS (seeds, N).

    Of several seeds the mean counts, in each scenario; for the ratio the geometric one.
    """
    n = min(first.shape[1], second.shape[1])
    theirs, ours = first[:, :n], second[:, :n]
    if not (ours > 0.0).all() or not (theirs > 0.0).all():
        return None, None
    difference = Interval.of((theirs.mean(axis=0) - ours.mean(axis=0)) / still[:n])
    logarithm = np.log(ours).mean(axis=0) - np.log(theirs).mean(axis=0)
    ratio, (low, high) = Interval.of(logarithm), np.quantile(logarithm, (0.05, 0.95))
    better, worse = float(np.mean(logarithm < 0.0)), float(np.mean(logarithm > 0.0))
    return (
        Pair(n, difference, _exp(ratio), (math.exp(low), math.exp(high)), better),
        Pair(n, _minus(difference), _exp(_minus(ratio)), (math.exp(-high), math.exp(-low)), worse),
    )


def _minus(interval: Interval) -> Interval:
    return Interval(-interval.value, -interval.high, -interval.low)


def _exp(interval: Interval) -> Interval:
    return Interval(math.exp(interval.value), math.exp(interval.low), math.exp(interval.high))


def _cloud(left: FloatArray) -> Cloud:
    kept = _thinned(len(left))
    return Cloud(kept.tolist(), significant(left[kept]))


def _dependences(traits: Sequence[Traits], left: list[FloatArray]) -> list[Dependence]:
    found = []
    for trait, (label, scale) in TRAITS.items():
        x = scale * np.array([getattr(t, trait) for t in traits])
        # A motion that is no sea has neither Hs nor Tp.
        if np.isfinite(x).all():
            found.append(Dependence(label, significant(x), [_binned(x[: len(values)], values) for values in left]))
    return found


def _binned(x: FloatArray, left: FloatArray) -> Curve:
    parts = np.array_split(np.argsort(x, kind="stable"), min(BINS, max(1, len(x) // 4)))
    return Curve(
        significant([float(np.median(x[part])) for part in parts]),
        significant([float(np.median(left[part])) for part in parts]),
    )


def worst(left: FloatArray) -> list[int]:
    """The scenarios in which most is left, the worst first: 1 % of them, but a few at least."""
    count = min(len(left), MOST_WORST, max(FEWEST_WORST, math.ceil(WORST_SHARE * len(left))))
    return [int(i) for i in np.argsort(-left, kind="stable")[:count]]


def choose_examples(left: list[FloatArray], reference: int) -> dict[int, str]:
    """Scenarios to look at, with what they are: quantiles of what the reference leaves, and its worst ones.

    The quantiles are taken where every policy ran, so that the privileged ones are there too.
    """
    shared = left[reference][: min(len(values) for values in left)]
    order = np.argsort(shared, kind="stable")
    chosen: dict[int, str] = {}
    for share, label in QUANTILES.items():
        chosen.setdefault(int(order[round(share * (len(order) - 1))]), label)
    for index, label in zip(worst(left[reference]), WORST, strict=False):
        chosen.setdefault(index, label)
    return chosen


def _example(comparison: Comparison, units: Sequence[_Unit], field: Field, index: int, label: str) -> Example:
    """A scenario with the histories of single policies; agents of several seeds are in it seed by seed."""
    radius = comparison.scenarios[index].crane.winch.drum_radius
    histories = []
    for place, unit in enumerate(units):
        entry, episodes = unit.members[0], unit.members[0].episodes
        if len(unit.members) == 1 and index < len(episodes.omega1):
            end = intact(episodes, index)
            histories.append(
                History(
                    policy=place,
                    error=numbers(episodes.error[index, :end]),
                    rope_speed=numbers(radius * episodes.drum_speed[index, :end], 3),
                    tension=numbers(1e-3 * episodes.tension[index, :end]),
                    reduction=float(reductions(entry, comparison.still)[index]),
                )
            )
    return Example(index, label, field.traits[index], histories)


def _episode(comparison: Comparison, field: Field, entry: Entry, index: int) -> Episode:
    episodes, still = entry.episodes, comparison.still
    return Episode(
        scenario=index,
        traits=field.traits[index],
        reduction=float(reductions(entry, still)[index]),
        rms=float(episodes.rms[index]),
        omega2=float(episodes.omega2[index]),
        still_rms=float(still.rms[index]),
        what=remarks(comparison, field, episodes, index),
        error=numbers(episodes.error[index, : intact(episodes, index)], 3),
        still_error=numbers(still.error[index, : intact(still, index)], 3),
    )
