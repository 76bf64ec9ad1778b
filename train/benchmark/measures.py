"""What is told of a policy on a task beside its score."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aframe_env.suite.definition import Measure
from agents.rollout import Episodes
from train.evaluate.statistics import Entry, family


@dataclass(frozen=True)
class MeasureOf:
    """A measure: how it is called, and how it is found from all episodes of a policy, its seeds one after another."""

    heading: str
    find: Callable[[Episodes], float]


def _slack_per_hour(episodes: Episodes) -> float:
    return float(episodes.slack_events.mean() * 3600.0 / episodes.duration)


def _peak_tension(episodes: Episodes) -> float:
    return float(np.quantile(episodes.peak_tension, 0.99))


def _landing_speed(episodes: Episodes) -> float:
    return float(np.quantile(episodes.landing_speed, 0.99))


MEASURES: Final[Mapping[Measure, MeasureOf]] = {
    "slack_per_hour": MeasureOf("slack events per hour", _slack_per_hour),
    "peak_tension": MeasureOf("99 of 100 lifts within, N", _peak_tension),
    "landing_speed": MeasureOf("99 of 100 land within, m/s", _landing_speed),
    "lift_offs": MeasureOf("lift-offs per lift", lambda episodes: float(episodes.lift_offs.mean())),
}


def measures_of(entries: Sequence[Entry], measures: Sequence[Measure]) -> dict[str, dict[str, float]]:
    """These measures of every policy, by its name without a seed."""
    found: dict[str, list[Episodes]] = {}
    for entry in entries:
        found.setdefault(family(entry.policy), []).append(entry.episodes)
    return {
        name: {measure: MEASURES[measure].find(Episodes.joined(episodes)) for measure in measures}
        for name, episodes in found.items()
    }
