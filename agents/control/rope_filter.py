"""A Kalman filter that follows the load as it bobs on its rope, from the tension and the motion of the rope's end."""

from __future__ import annotations

from typing import Final

import numpy as np

from agents.control.filters import ALL, FloatArray, Rows
from agents.control.rope import RopeModel

ACCELERATION_NOISE: Final = 0.02
"""Process noise of the load's acceleration beside its bobbing, m/s²."""


class RopeFilter:
    """The load on its rope, x = (e, v, q, b) of N rows: depth error, its rate, where the rope's end would hold it.

    Only e - q and v are of use: q is dead-reckoned and drifts. The bias b is that of a reading of the stretch: the
    load's weight is what the first reading of the tension said, noise and all.
    """

    def __init__(self, rows: int, rate_noise: float) -> None:
        """``rate_noise``: standard deviation of a reading of the heave rate, m/s."""
        self._rate_noise = rate_noise
        self._a, self._b = np.zeros((rows, 4, 4)), np.zeros((rows, 4))
        self._process_noise, self._covariance = np.zeros((rows, 4, 4)), np.zeros((rows, 4, 4))
        self._noise = np.ones(rows)
        self._x = np.zeros((rows, 4))
        self.gain = np.zeros((rows, 4))
        """(N, 4) of the latest reading of the stretch."""

    def start(self, model: RopeModel, period: float, stretch_noise: FloatArray, rows: Rows = ALL) -> None:
        """Begin in these rows with loads at rest; ``stretch_noise`` (n,) of a reading of the stretch, m."""
        self._tune(model, period, stretch_noise, rows)
        covariance = np.tile(np.diag([1e-4, 1e-4, 1e-4, 0.0]), (len(stretch_noise), 1, 1))
        covariance[:, 3, 3] = stretch_noise**2
        self._covariance[rows] = covariance
        self._x[rows] = 0.0

    def retune(self, model: RopeModel, period: float, stretch_noise: FloatArray, longer: FloatArray) -> None:
        """Go on with other ropes, ``longer`` (N,) by that factor: the error of the weight stretches them by as much."""
        self._tune(model, period, stretch_noise, ALL)
        self._x[:, 3] *= longer
        self._covariance[:, 3, :] *= longer[:, None]
        self._covariance[:, :, 3] *= longer[:, None]

    def _tune(self, model: RopeModel, period: float, stretch_noise: FloatArray, rows: Rows) -> None:
        a, b = np.zeros((len(stretch_noise), 4, 4)), np.zeros((len(stretch_noise), 4))
        a[:, :3, :3], a[:, 3, 3] = model.a[:, :3, :3], 1.0
        b[:, :3] = model.b[:, :3]
        process_noise = self._rate_noise**2 * b[:, :, None] * b[:, None, :]
        process_noise[:, 1, 1] += (ACCELERATION_NOISE * period) ** 2
        self._a[rows], self._b[rows], self._process_noise[rows] = a, b, process_noise
        self._noise[rows] = stretch_noise**2

    def advance(self, speed: FloatArray, stretch: FloatArray) -> None:
        """Take the mean speed (N,) m/s of the rope's end over a control step, and the stretch (N,) m at its end."""
        a = self._a
        x = (a @ self._x[:, :, None])[:, :, 0] + self._b * speed[:, None]
        p = a @ self._covariance @ a.transpose(0, 2, 1) + self._process_noise
        cross_covariance = p[:, :, 2] - p[:, :, 0] + p[:, :, 3]
        seen = cross_covariance[:, 2] - cross_covariance[:, 0] + cross_covariance[:, 3]
        self.gain = gain = cross_covariance / (seen + self._noise)[:, None]
        self._x = x + gain * (stretch - (x[:, 2] - x[:, 0] + x[:, 3]))[:, None]
        self._covariance = p - gain[:, :, None] * cross_covariance[:, None, :]

    @property
    def stretch(self) -> FloatArray:
        """Stretch of the rope beyond that under the load's weight, (N,) m."""
        return np.asarray(self._x[:, 2] - self._x[:, 0])

    @property
    def load_velocity(self) -> FloatArray:
        """Vertical velocity of the load, (N,) m/s."""
        return np.asarray(self._x[:, 1])
