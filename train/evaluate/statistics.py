"""Figures of policies over the same scenarios, with bootstrap intervals."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from agents.policy import FloatArray, Knowledge
from agents.rollout import Episodes

Mask = npt.NDArray[np.bool_]

CONFIDENCE: Final = 0.95
RESAMPLES: Final = 4000
TAIL: Final = 0.05
"""Share of the scenarios, the worst ones, whose mean is the tail."""

Statistic = Callable[..., Any]
"""Of values (..., N) along the last axis, or along ``axis``."""


def tail_mean(values: FloatArray, axis: int = -1) -> FloatArray:
    """Mean of the worst (least) ``TAIL`` of the values along an axis; of one of them at least."""
    count = max(1, math.ceil(TAIL * values.shape[axis] - 1e-9))
    return np.asarray(np.take(np.partition(values, count - 1, axis=axis), range(count), axis=axis).mean(axis=axis))


@dataclass(frozen=True)
class Interval:
    """A figure with its bootstrap interval of 95 %."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, values: FloatArray, statistic: Statistic = np.median) -> Interval:
        """Figure of the values (N,) over scenarios, or (seeds, N) of agents that differ in their seed alone.

        The latter is the mean over the seeds, and its interval resamples seeds and scenarios. The resampling is seeded.
        """
        if values.ndim == 2:
            return cls._of_seeds(values, statistic)
        if len(values) < 2 or np.ptp(values) == 0.0:
            middle = float(statistic(values))
            return cls(middle, middle, middle)
        from scipy.stats import bootstrap  # a second to import, which every training would wait

        interval = bootstrap(
            (values,),
            statistic,
            confidence_level=CONFIDENCE,
            n_resamples=RESAMPLES,
            method="percentile",
            rng=np.random.default_rng(0),
        ).confidence_interval
        return cls(float(statistic(values)), float(interval.low), float(interval.high))

    @classmethod
    def _of_seeds(cls, values: FloatArray, statistic: Statistic) -> Interval:
        seeds, count = values.shape
        rng = np.random.default_rng(0)
        drawn = np.empty(RESAMPLES)
        for i in range(RESAMPLES):
            some = values[rng.integers(seeds, size=seeds)][:, rng.integers(count, size=count)]
            drawn[i] = np.mean(statistic(some, axis=-1))
        low, high = np.quantile(drawn, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
        return cls(float(np.mean(statistic(values, axis=-1))), float(low), float(high))


@dataclass(frozen=True)
class Row:
    """One policy's figures over its scenarios."""

    policy: str
    knows: str
    scenarios: int
    seeds: int
    """Agents that the row stands for; the counts below are means over them."""
    reduction: Interval
    """Median heave reduction 1 - RMS/RMS(drum still)."""
    mean: Interval
    """Mean heave reduction."""
    tail: Interval
    """Mean heave reduction in the worst 5 % of the scenarios."""
    share: Interval | None
    """Mean share of the achievable: heave reduction over the winch-limited optimum's; None without that in the run."""
    share_median: Interval | None
    """Median share."""
    share_tail: Interval | None
    """Mean share in the 5 % of the scenarios where it is least."""
    share_saturating: Interval | None
    """Mean share where holding the load still asks more of the winch than it has; None also where it never does."""
    rms: Interval
    """m."""
    omega1: Interval
    """m² s."""
    omega2: Interval
    """m."""
    worst_reduction: float
    worse_than_still: float
    """Scenarios in which the policy is worse than the drum still."""
    parted: float
    """Scenarios in which the rope parted."""
    slack: float
    """Scenarios in which the rope went slack."""
    slack_events: float
    """Over all scenarios."""
    peak_tension: Interval
    """N."""
    drum_travel: Interval
    """m of rope, reeled in and out."""
    peak_power: Interval
    """W."""
    time_outside: Interval
    """Share of the time with a depth error beyond ±5 cm."""


@dataclass(frozen=True)
class Entry:
    """A policy's episodes, in the order of the scenarios; it may have run only the first few of them."""

    policy: str
    knows: Knowledge
    episodes: Episodes
    text: str = ""
    """What the policy was chosen by, if it can be chosen again."""


def reductions(entry: Entry, still: Episodes) -> FloatArray:
    """Heave reduction in each scenario: 1 - RMS/RMS(drum still)."""
    rms = entry.episodes.rms
    return 1.0 - rms / still.rms[: len(rms)]


def compare(
    entries: Sequence[Entry], still: Episodes, optimum: FloatArray | None = None, saturating: Mask | None = None
) -> list[Row]:
    """Figures of every policy, agents that differ in their seed alone one by one.

    ``optimum`` (N,): RMS error of the winch-limited optimum, m; ``saturating`` (N,): where the winch saturates.
    """
    return [_row(entry.policy, [entry], still, optimum, saturating) for entry in entries]


def compare_families(
    entries: Sequence[Entry], still: Episodes, optimum: FloatArray | None = None, saturating: Mask | None = None
) -> list[Row]:
    """Figures of every policy as of ``compare``, agents that differ in their seed alone together."""
    return [_row(name, members, still, optimum, saturating) for name, members in families(entries)]


def families(entries: Sequence[Entry]) -> list[tuple[str, tuple[Entry, ...]]]:
    """Policies with their names, agents that differ in their seed alone together."""
    found: dict[str, list[Entry]] = {}
    for entry in entries:
        found.setdefault(family(entry.policy), []).append(entry)
    return [
        (f"{name}, {len(members)} seeds" if len(members) > 1 else members[0].policy, tuple(members))
        for name, members in found.items()
    ]


def family(policy: str) -> str:
    """Name of a policy, or of a row of several, without its seeds."""
    return re.sub(r", (?:seed \d+|\d+ seeds)$", "", policy)


def _row(
    name: str, members: Sequence[Entry], still: Episodes, optimum: FloatArray | None, saturating: Mask | None
) -> Row:
    def each(values: Callable[[Episodes], FloatArray]) -> FloatArray:
        found = np.stack([values(member.episodes) for member in members])
        return found if len(members) > 1 else found[0]

    def mean_count(values: Callable[[Episodes], npt.NDArray[Any]]) -> float:
        return float(np.mean([np.sum(values(member.episodes)) for member in members]))

    reduction = np.stack([reductions(member, still) for member in members])
    count = reduction.shape[1]
    share = share_median = share_tail = share_saturating = None
    if optimum is not None:
        shares = _squeezed(reduction / (1.0 - optimum[:count] / still.rms[:count]))
        share, share_median, share_tail = (Interval.of(shares, each) for each in (np.mean, np.median, tail_mean))
        if saturating is not None and saturating[:count].any():
            share_saturating = Interval.of(shares[..., saturating[:count]], np.mean)
    reduction = _squeezed(reduction)
    return Row(
        policy=name,
        knows=members[0].knows.value,
        scenarios=count,
        seeds=len(members),
        reduction=Interval.of(reduction),
        mean=Interval.of(reduction, np.mean),
        tail=Interval.of(reduction, tail_mean),
        share=share,
        share_median=share_median,
        share_tail=share_tail,
        share_saturating=share_saturating,
        rms=Interval.of(each(lambda e: e.rms)),
        omega1=Interval.of(each(lambda e: e.omega1)),
        omega2=Interval.of(each(lambda e: e.omega2)),
        worst_reduction=float(reduction.min()),
        worse_than_still=float((reduction < 0.0).sum() / len(members)),
        parted=mean_count(lambda e: e.parted),
        slack=mean_count(lambda e: e.slack),
        slack_events=mean_count(lambda e: e.slack_events),
        peak_tension=Interval.of(each(lambda e: e.peak_tension)),
        drum_travel=Interval.of(each(lambda e: e.drum_travel)),
        peak_power=Interval.of(each(lambda e: e.peak_power)),
        time_outside=Interval.of(each(lambda e: e.time_outside / e.duration)),
    )


def _squeezed(values: FloatArray) -> FloatArray:
    """Values (seeds, N), or (N,) where there is one seed only."""
    return values if len(values) > 1 else values[0]
