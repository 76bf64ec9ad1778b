"""Series of scenarios: a seed and a number name each one for ever."""

from __future__ import annotations

import numpy as np

from aframe_env.scenario.distribution import ScenarioSource
from aframe_env.scenario.scenario import Scenario


def drawn_scenarios(source: ScenarioSource, seed: int, count: int) -> list[Scenario]:
    """Return the first ``count`` scenarios of a series; the same ones, whatever the count.

    A single scenario is its own series.
    """
    if isinstance(source, Scenario):
        return [source] * count
    return [source.draw(np.random.default_rng([seed, i])) for i in range(count)]
