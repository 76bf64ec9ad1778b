"""How much later than told a drum's readings answer its commands, reckoned from the readings as they come.

A winch that lags more than told turns later, and a reading that is older than told shows it later: what was reckoned of
the drum's speed u, at the moment that a reading is said to be of, and the reading y differ by -x u' to first order,
where x is the sum of both errors. By as much everything is to be begun earlier: the pulley's motion is read as late as
the drum's, and the winch takes it up as late as it answers. x is the least-squares answer to all readings so far.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from aframe_env.scenario.sensors import Sensors
from aframe_env.validation import InvalidValue
from agents.control.filters import ALL, FloatArray, Rows

SMOOTHING: Final = 0.5
"""Time constant by which both speeds are smoothed first, s: noise and the last commands' small moves tell nothing."""
DOUBT: Final = 0.02
"""Σ u'², m²/s⁴, by which the readings weigh as much as the assumption that all is as told."""
MOST: Final = 0.5
"""Most that is reckoned with, either way, s."""


def require_readings(adapts: bool, sensors: Sensors | None) -> None:
    """Raise where lateness is to be reckoned, but the full state is observed."""
    if adapts and sensors is None:
        raise InvalidValue("adapts = True: it takes sensors, and the full state is observed: must be False")


class Lateness:
    """Of N rows that run in step."""

    def __init__(self, rows: int, control_period: float, delay: int) -> None:
        """``delay`` of the readings, as told, in control steps."""
        self._period = control_period
        self._keep = float(np.exp(-control_period / SMOOTHING))
        self._past = np.zeros((delay + 1, rows))
        """Reckoned speeds at the moments of measurement still to be read, and at the latest one, m/s."""
        self._reckoned, self._read = np.zeros((2, rows))
        """Both, smoothed."""
        self._likeness, self._size = np.zeros((2, rows))
        """Sums of -(y - u) u' and of u'², m²/s⁴."""

    def start(self, rows: Rows = ALL) -> None:
        """Forget what was read in these rows."""
        self._past[:, rows] = 0.0
        for each in (self._reckoned, self._read, self._likeness, self._size):
            each[rows] = 0.0

    def advance(self, reckoned: FloatArray, read: FloatArray) -> None:
        """Take speeds (N,) m/s of the rope at the drum, a control step later: as reckoned to be now, and as read."""
        self._past = np.concatenate([self._past[1:], reckoned[None]])
        before = self._reckoned
        self._reckoned = self._past[0] + self._keep * (before - self._past[0])
        self._read = read + self._keep * (self._read - read)
        rate = (self._reckoned - before) / self._period
        self._likeness -= (self._read - self._reckoned) * rate
        self._size += rate**2

    @property
    def seconds(self) -> FloatArray:
        """(N,) s; negative where drum and readings are quicker than told."""
        return np.clip(self._likeness / (self._size + DOUBT), -MOST, MOST)
