"""Figures of policies over the same scenarios, with bootstrap intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import bootstrap

from agents.policy import FloatArray, Knowledge
from agents.rollout import Episodes

CONFIDENCE = 0.95
RESAMPLES = 4000


@dataclass(frozen=True)
class Interval:
    """A median with its bootstrap interval of 95 %."""

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, values: FloatArray) -> Interval:
        """Median of the values (N,) over scenarios; the resampling is seeded."""
        if len(values) < 2 or np.ptp(values) == 0.0:
            middle = float(np.median(values))
            return cls(middle, middle, middle)
        interval = bootstrap(
            (values,),
            np.median,
            confidence_level=CONFIDENCE,
            n_resamples=RESAMPLES,
            method="percentile",
            rng=np.random.default_rng(0),
        ).confidence_interval
        return cls(float(np.median(values)), float(interval.low), float(interval.high))


@dataclass(frozen=True)
class Row:
    """One policy's figures over its scenarios."""

    policy: str
    knows: str
    scenarios: int
    reduction: Interval
    """Heave reduction 1 - RMS/RMS(drum still)."""
    rms: Interval
    """m."""
    omega1: Interval
    """m² s."""
    omega2: Interval
    """m."""
    worst_reduction: float
    worse_than_still: int
    """Scenarios in which the policy is worse than the drum still."""
    parted: int
    """Scenarios in which the rope parted."""
    slack: int
    """Scenarios in which the rope went slack."""
    slack_events: int
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


def reductions(entry: Entry, still: Episodes) -> FloatArray:
    """Heave reduction in each scenario: 1 - RMS/RMS(drum still)."""
    rms = entry.episodes.rms
    return 1.0 - rms / still.rms[: len(rms)]


def compare(entries: Sequence[Entry], still: Episodes) -> list[Row]:
    """Figures of every policy."""
    rows = []
    for entry in entries:
        episodes = entry.episodes
        reduction = reductions(entry, still)
        rows.append(
            Row(
                policy=entry.policy,
                knows=entry.knows.value,
                scenarios=len(reduction),
                reduction=Interval.of(reduction),
                rms=Interval.of(episodes.rms),
                omega1=Interval.of(episodes.omega1),
                omega2=Interval.of(episodes.omega2),
                worst_reduction=float(reduction.min()),
                worse_than_still=int((reduction < 0.0).sum()),
                parted=int(episodes.parted.sum()),
                slack=int(episodes.slack.sum()),
                slack_events=int(episodes.slack_events.sum()),
                peak_tension=Interval.of(episodes.peak_tension),
                drum_travel=Interval.of(episodes.drum_travel),
                peak_power=Interval.of(episodes.peak_power),
                time_outside=Interval.of(episodes.time_outside / episodes.duration),
            )
        )
    return rows
