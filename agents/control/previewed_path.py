"""The pulley's way to come where a wave radar foretells it: a filter's up to the first lead, then the radar's."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from aframe_env.scenario.preview import Preview
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED
from aframe_env.validation import InvalidValue
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.regulator import Observation
from agents.control.wave_filter import WaveFilter

FIRST: Final = len(SENSED)
"""Column of the observation that the preview begins at."""


class PreviewedPath:
    """Rises of the pulleys of N rows, from the latest preview and a wave filter.

    A preview is the truer the shorter its lead, and the filter the truer still up to the first one: it tells how far
    the pulley rises until then, and how fast it moves now. Of the preview the rises beyond that lead count, so that it
    does not matter how high the pulley is thought to be. A spline goes through them.
    """

    def __init__(self, preview: Preview, rows: int, period: float, delay: float) -> None:
        """``period``: control step, s; ``delay``: age of the filter's readings, s, in whole control steps."""
        self._preview, self._period, self._delay = preview, period, delay
        self._told = np.zeros((rows, len(preview.leads)))

    @classmethod
    def of(cls, sensors: Sensors | None, rows: int, period: float) -> PreviewedPath | None:
        """For rows with these sensors; None where they have no preview."""
        if sensors is None or sensors.preview is None:
            return None
        return cls(sensors.preview, rows, period, round(sensors.delay / period) * period)

    def take(self, observation: Observation, rows: Rows = ALL) -> None:
        """Take the previews in observations (n, K) of these rows."""
        told = observation[:, FIRST:]
        if told.shape[1] != self._told.shape[1]:
            raise InvalidValue(
                f"observation: {observation.shape[1]} quantities, the policy reads {FIRST + self._told.shape[1]}: "
                f"the readings, and a preview of {self._told.shape[1]} values"
            )
        self._told[rows] = told

    def rises_at_leads(self, waves: WaveFilter) -> FloatArray:
        """Rises (leads, N) m from now to each lead."""
        now, first = waves.path(self._delay + np.array([0.0, self._preview.leads[0]]))
        return np.asarray((first - now) + (self._told - self._told[:, :1]).T)

    def rises(self, waves: WaveFilter, steps: int) -> FloatArray:
        """Rises (n, N) m during each of the coming control steps: ``steps`` of them, or as many as the leads cover."""
        known = np.concatenate([waves.rate(np.array([self._delay])), self.rises_at_leads(waves)])
        weights = _weights(self._preview, self._period)[:steps]
        # Row by row in the same order, whatever the batch: a sum, not a matrix product.
        return np.asarray((weights[:, :, None] * known[None]).sum(axis=1))


@lru_cache(maxsize=8)
def _weights(preview: Preview, period: float) -> FloatArray:
    """Weights (steps, 1 + leads) of the speed now and of the rises at the leads in those during the control steps."""
    leads = np.array((0.0, *preview.leads))
    ends = np.arange(int(preview.horizon / period + 1e-9) + 1) * period
    speed = np.eye(1, len(leads))[0]
    rises = np.diag(1.0 - speed)
    through = CubicSpline(leads, rises, bc_type=((1, speed), (2, np.zeros(len(leads)))))
    return np.asarray(np.diff(through(ends), axis=0))
