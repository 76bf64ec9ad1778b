"""From late and noisy readings to the present: the rope's state now, and where the pulley goes next."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from agents.control.regulator import Columns, Lifts
from agents.estimation import ALL, DRUM_RADIUS, Estimate, Estimator, FloatArray, Readings, Rows


class Predictor(Protocol):
    """Foretells the pulley's vertical motion from the readings of its velocity."""

    def start(self, heave_rate: FloatArray, estimate: Estimate, rows: Rows) -> None:
        """Begin in these rows with a first reading (n,) m/s; ``estimate`` is that of all rows."""
        ...

    def advance(self, heave_rate: FloatArray, estimate: Estimate) -> None:
        """Take a reading (N,) m/s, and what the estimator makes of all readings, a control step later."""
        ...

    def path(self, times: FloatArray) -> FloatArray:
        """Rise (T, N) m of the pulley since the moment that the reading speaks of, ``times`` (T,) s after it."""
        ...

    def rate(self, times: FloatArray) -> FloatArray:
        """Its velocity (T, N) m/s."""
        ...


class PolynomialPredictor:
    """Carries on with the velocity, acceleration and jerk that the estimator finds: good for a fraction of a wave."""

    _estimate: Estimate

    def start(self, heave_rate: FloatArray, estimate: Estimate, rows: Rows) -> None:
        """Take the estimate."""
        self._estimate = estimate

    def advance(self, heave_rate: FloatArray, estimate: Estimate) -> None:
        """Take the estimate."""
        self._estimate = estimate

    def path(self, times: FloatArray) -> FloatArray:
        """Rise (T, N) m of the pulley since the moment of the reading."""
        t, now = times[:, None], self._estimate
        return t * (now.pulley_velocity + t * (now.pulley_acceleration / 2.0 + t * now.pulley_jerk / 6.0))

    def rate(self, times: FloatArray) -> FloatArray:
        """Velocity (T, N) m/s."""
        t, now = times[:, None], self._estimate
        return now.pulley_velocity + t * (now.pulley_acceleration + t * now.pulley_jerk / 2.0)


class Observer:
    """The present of N rows, whose readings are late by whole control steps.

    The rope's model carries the estimates over the delay, with what the drums did meanwhile and what the predictor
    makes of the pulleys' motion.
    """

    def __init__(self, lifts: Lifts, damping_ratio: float, delay: float, predictor: Predictor) -> None:
        """``damping_ratio`` of the loads' bobbing, share of critical; ``delay`` in s, rounded to control steps."""
        self._lifts = lifts
        self._damping_ratio = damping_ratio
        self._predictor = predictor
        rows = len(lifts.frequency)
        self.model = lifts.model(damping_ratio)
        self._estimator = Estimator(rows, lifts.period)
        self._turns = np.zeros((round(delay / lifts.period), rows))
        """(steps of delay, N) how far the drums have turned since the moment that the readings speak of, rad."""

    def start(self, o: Columns, rows: Rows = ALL) -> None:
        """Begin lifts, as ``lifts`` has, in these rows with the first readings (n,)."""
        self.model.replace(rows, self._lifts.model(self._damping_ratio, rows))
        self._estimator.start(self._readings(o, rows), rows)
        self._turns[:, rows] = 0.0
        self.estimate = self._estimator.estimate(ALL)
        self._predictor.start(o["pulley_velocity_z"], self.estimate, rows)

    def advance(self, turned: FloatArray, o: Columns) -> None:
        """Take the readings a control step later, during which the drums turned by ``turned`` (N,) rad."""
        self._turns = np.concatenate([self._turns, turned[None]])[1:] if len(self._turns) else self._turns
        self._estimator.advance(self._readings(o, ALL))
        self.estimate = self._estimator.estimate(ALL)
        self._predictor.advance(o["pulley_velocity_z"], self.estimate)

    def state(self) -> FloatArray:
        """State z (N, 4) of the rope's model, now."""
        estimate, period, radius = self.estimate, self._lifts.period, self._lifts.winch.radius
        late = len(self._turns)
        rises = np.diff(self._predictor.path(period * np.arange(late + 1.0)), axis=0)
        still = np.zeros(len(radius))
        z = np.stack([estimate.depth_error, estimate.load_velocity, estimate.depth_error + estimate.stretch, still], 1)
        for rise, turn in zip(rises, self._turns, strict=True):
            z[:, 3] = 0.0
            z = self.model.advance(z, (rise - radius * turn) / period)
        z[:, 3] = self._predictor.rate(np.array([period * late]))[0] - radius * self._lifts.winch.speed
        return z

    def rises(self, steps: int) -> FloatArray:
        """How far the pulley will rise during each of the coming control steps, (steps, N) m."""
        times = self._lifts.period * np.arange(len(self._turns), len(self._turns) + steps + 1.0)
        return np.diff(self._predictor.path(times), axis=0)

    def _readings(self, o: Columns, rows: Rows) -> Readings:
        return Readings(
            heave_rate=o["pulley_velocity_z"],
            drum_angle=o["drum_angle"] * self._lifts.winch.radius[rows] / DRUM_RADIUS,
            stretch=self._lifts.stretch(o, rows),
            load_acceleration=self._lifts.load_acceleration(o, rows),
            depth_error=o["depth_error"],
        )
