"""Filters over a short memory of the sensors' readings, for many rows at once.

Well-known tools, and no model of the sea: a fading-memory polynomial filter (Morrison, Introduction to Sequential
Smoothing and Prediction, 1969) for the pulley's velocity and its rates; a complementary filter for the rope, whose
upper end is dead-reckoned from heave rate and drum angle and corrected slowly by the depth sensor; and an alpha-beta
filter for the load, which is carried by the acceleration that the tension tells and drawn to the end of the rope.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64] | slice
ALL: Final = slice(None)

HEAVE_MEMORY = 0.7
"""Share that a reading of the heave rate keeps of its weight after a control step."""
DEPTH_GAIN = 0.06
"""Share of its deviation from the estimate that a new depth reading corrects."""
LOAD_GAINS = (0.22, 0.26)
"""Shares of its deviation that correct the load's position, and its velocity (1/s), at each control step."""
DRUM_RADIUS = 0.75
"""Drum radius of the reference crane, m."""


@dataclass(frozen=True)
class Readings:
    """Readings of N rows at one control step."""

    heave_rate: FloatArray
    """(N,) vertical velocity of the pulley, m/s."""
    drum_angle: FloatArray
    """(N,) rad."""
    stretch: FloatArray
    """(N,) stretch of the rope beyond that under the load's weight, m."""
    load_acceleration: FloatArray
    """(N,) vertical, m/s²."""
    depth_error: FloatArray
    """(N,) x_L3 - h, m."""


@dataclass(frozen=True)
class Estimate:
    """Estimates from the readings, as of the moment of measurement."""

    depth_error: FloatArray
    """(N,) m."""
    pulley_velocity: FloatArray
    """(N,) vertical, m/s."""
    pulley_acceleration: FloatArray
    """(N,) m/s²."""
    pulley_jerk: FloatArray
    """(N,) m/s³."""
    load_velocity: FloatArray
    """(N,) vertical, m/s."""
    stretch: FloatArray
    """(N,) stretch of the rope beyond that under the load's weight, m."""


class FadingPolynomial:
    """Parabola through a signal's past, by least squares with weights that fade by ``memory`` each control step."""

    def __init__(self, rows: int, memory: float, period: float) -> None:
        self._gains = (1.0 - memory**3, 1.5 * (1.0 - memory) ** 2 * (1.0 + memory), 0.5 * (1.0 - memory) ** 3)
        self._period = period
        self._terms = np.zeros((3, rows))
        """Value, first difference, half the second difference."""

    def start(self, signal: FloatArray, rows: Rows) -> None:
        """Begin with a signal that has been constant."""
        self._terms[:, rows] = 0.0
        self._terms[0, rows] = signal

    def advance(self, signal: FloatArray) -> None:
        """Take the signal (N,) a control step later."""
        value, slope, quadratic = self._terms
        value, slope = value + slope + quadratic, slope + 2.0 * quadratic
        innovation = signal - value
        a, b, c = self._gains
        self._terms = np.stack([value + a * innovation, slope + b * innovation, quadratic + c * innovation])

    def value(self, rows: Rows) -> FloatArray:
        """The signal, smoothed."""
        return np.asarray(self._terms[0, rows])

    def rate(self, rows: Rows) -> FloatArray:
        """First derivative of the signal, 1/s."""
        return np.asarray(self._terms[1, rows] / self._period)

    def second_derivative(self, rows: Rows) -> FloatArray:
        """Second derivative of the signal, 1/s²."""
        return np.asarray(2.0 * self._terms[2, rows] / self._period**2)


class Estimator:
    """Estimates of N rows, control step by control step."""

    def __init__(self, rows: int, control_period: float) -> None:
        self._period = control_period
        self._heave = FadingPolynomial(rows, HEAVE_MEMORY, control_period)
        self._rope_end = np.zeros(rows)
        """Depth error if the rope had the stretch of the load's weight alone, m."""
        self._position = np.zeros(rows)
        """Depth error of the load, m."""
        self._velocity = np.zeros(rows)
        """Velocity of the load, m/s."""
        self._last_heave_rate = np.zeros(rows)
        self._last_drum_angle = np.zeros(rows)
        self._last_depth = np.zeros(rows)

    def start(self, readings: Readings, rows: Rows) -> None:
        """Forget the past of these rows: a lift begins with the load at rest at its level."""
        self._heave.start(readings.heave_rate, rows)
        for estimate in (self._rope_end, self._position, self._velocity):
            estimate[rows] = 0.0
        self._last_heave_rate[rows] = readings.heave_rate
        self._last_drum_angle[rows] = readings.drum_angle
        self._last_depth[rows] = readings.depth_error

    def advance(self, readings: Readings) -> None:
        """Take the readings of all rows, a control step later."""
        dt = self._period
        self._heave.advance(readings.heave_rate)
        self._rope_end += 0.5 * dt * (readings.heave_rate + self._last_heave_rate)
        self._rope_end -= DRUM_RADIUS * (readings.drum_angle - self._last_drum_angle)
        self._position += dt * (self._velocity + 0.5 * dt * readings.load_acceleration)
        self._velocity += dt * readings.load_acceleration
        innovation = self._rope_end - readings.stretch - self._position
        self._position += LOAD_GAINS[0] * innovation
        self._velocity += LOAD_GAINS[1] * innovation
        # The depth sensor holds its reading between samples: one that has not changed says nothing new.
        fresh = readings.depth_error != self._last_depth
        correction = np.where(fresh, DEPTH_GAIN * (readings.depth_error - self._position), 0.0)
        self._rope_end += correction
        self._position += correction
        self._last_heave_rate = readings.heave_rate
        self._last_drum_angle = readings.drum_angle
        self._last_depth = readings.depth_error

    def estimate(self, rows: Rows) -> Estimate:
        """Estimates of these rows."""
        return Estimate(
            depth_error=self._position[rows],
            pulley_velocity=self._heave.value(rows),
            pulley_acceleration=self._heave.rate(rows),
            pulley_jerk=self._heave.second_derivative(rows),
            load_velocity=self._velocity[rows],
            stretch=self._rope_end[rows] - self._position[rows],
        )
