"""Features of rows whose target or frame moves, as an agent has them that is made to follow them and to set down."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.lowering import Ways, at_rest
from agents.control.regulator import Observation
from agents.control.set_down import SetDown, told_of
from agents.learned.feature_sets import features_for
from agents.learned.features import FeatureConfig

Float32Array = npt.NDArray[np.float32]


class FollowingFeatures:
    """Features of N rows that start one by one, with what ``Following`` and ``SettingDown`` do for a policy."""

    def __init__(self, rows: int, config: FeatureConfig) -> None:
        self._features = features_for(rows, config)
        self.names: tuple[str, ...] = self._features.names
        self._ways = Ways(rows, config.control_period, config.sensors)
        self._set_down = SetDown(rows, config.control_period, config.sensors)
        self._period = config.control_period
        self._steps = np.zeros(rows)
        """(N,) control steps since each row's start."""

    def start(self, observation: Observation, scenarios: Sequence[Scenario], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, whose past is forgotten."""
        self._steps[rows] = 0
        told = list(map(told_of, scenarios))
        seen = self._ways.start(told, self._set_down.start(scenarios, observation, rows), rows)
        return self._features.start(seen, list(map(at_rest, told)), rows)

    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        self._steps += 1
        time = self._period * self._steps
        seen = self._ways.seen(self._set_down.seen(observation, time), time)
        self._ways.retune(self._features)
        return self._features.advance(seen)

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), in [-1, 1]."""
        return self._set_down.command(self._ways.command(self._features.command(output)))
