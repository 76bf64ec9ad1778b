"""Observers from late and noisy readings: the rope's state now, and the pulley's path to come."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np

from aframe_env.scenario.crane import GRAVITY
from aframe_env.scenario.sensors import Sensors
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, DRUM_RADIUS, Estimator, FloatArray, Readings, Rows
from agents.control.kalman import RopeFilter, WaveBank, WaveFilter
from agents.control.regulator import Columns, HoistBatch


class Observer(ABC):
    """Present state of N rows, whose readings are late by whole control steps.

    The rope's model carries the estimates over the delay, with the drums' turns meanwhile and the predicted motion of
    the pulleys.
    """

    def __init__(self, hoists: HoistBatch, damping_ratio: float, delay: float) -> None:
        """``damping_ratio`` of the loads' bobbing, share of critical; ``delay`` in s, rounded to control steps."""
        self._hoists = hoists
        self._damping_ratio = damping_ratio
        self.model = hoists.model(damping_ratio)
        self._turns = np.zeros((round(delay / hoists.period), len(hoists.frequency)))
        """(steps of delay, N) turns of the drums since the moment of measurement, rad."""

    def start(self, o: Columns, rows: Rows = ALL) -> None:
        """Begin hoists, as ``hoists`` has, in these rows with the first readings (n,)."""
        self.model.replace(rows, self._hoists.model(self._damping_ratio, rows))
        self._turns[:, rows] = 0.0
        self._start(o, rows)

    def advance(self, turned: FloatArray, o: Columns) -> None:
        """Take the readings a control step later, during which the drums turned by ``turned`` (N,) rad."""
        if len(self._turns):
            self._turns = np.concatenate([self._turns, turned[None]])[1:]
        self._advance(o)

    def state(self) -> FloatArray:
        """State z (N, 4) of the rope's model, now."""
        hoists, still = self._hoists, np.zeros(len(self._hoists.frequency))
        rises = np.diff(self._path(hoists.period * np.arange(len(self._turns) + 1.0)), axis=0)
        depth_error, load_velocity, stretch = self._load()
        z = np.stack([depth_error, load_velocity, depth_error + stretch, still], axis=1)
        for rise, turn in zip(rises, self._turns, strict=True):
            z[:, 3] = 0.0
            z = self.model.advance(z, (rise - hoists.winch.radius * turn) / hoists.period)
        z[:, 3] = self.pulley_velocity(1)[0] - hoists.winch.radius * hoists.winch.speed
        return z

    def rises(self, steps: int) -> FloatArray:
        """Rise of the pulley during each of the coming control steps, (steps, N) m."""
        return np.diff(self._path(self._times(steps + 1)), axis=0)

    def pulley_velocity(self, steps: int) -> FloatArray:
        """Velocity (steps, N) m/s of the pulley now and at the ends of the coming control steps but one."""
        return self._rate(self._times(steps))

    def _times(self, count: int) -> FloatArray:
        """Now and the ends of the coming control steps, s after the moment of measurement."""
        return self._hoists.period * np.arange(len(self._turns), len(self._turns) + count, dtype=np.float64)

    @abstractmethod
    def _start(self, o: Columns, rows: Rows) -> None:
        """Forget the past of these rows."""

    @abstractmethod
    def _advance(self, o: Columns) -> None:
        """Take the readings of all rows."""

    @abstractmethod
    def _load(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Depth error [m], load's velocity [m/s] and stretch beyond that under its weight [m] (N,) at the readings."""

    @abstractmethod
    def _path(self, times: FloatArray) -> FloatArray:
        """Rise (T, N) m of the pulley ``times`` (T,) s after the moment of measurement."""

    @abstractmethod
    def _rate(self, times: FloatArray) -> FloatArray:
        """Velocity (T, N) m/s of the pulley at these times."""


class PolynomialObserver(Observer):
    """Extrapolation of the pulley's velocity, acceleration and jerk, as ``Estimator`` finds them.

    It has no model of the sea: good for a fraction of a wave.
    """

    def __init__(self, hoists: HoistBatch, damping_ratio: float, delay: float) -> None:
        super().__init__(hoists, damping_ratio, delay)
        self._estimator = Estimator(len(hoists.frequency), hoists.period)

    def _start(self, o: Columns, rows: Rows) -> None:
        self._estimator.start(self._readings(o, rows), rows)
        self._estimate = self._estimator.estimate(ALL)

    def _advance(self, o: Columns) -> None:
        self._estimator.advance(self._readings(o, ALL))
        self._estimate = self._estimator.estimate(ALL)

    def _load(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        now = self._estimate
        return now.depth_error, now.load_velocity, now.stretch

    def _path(self, times: FloatArray) -> FloatArray:
        t, now = times[:, None], self._estimate
        return t * (now.pulley_velocity + t * (now.pulley_acceleration / 2.0 + t * now.pulley_jerk / 6.0))

    def _rate(self, times: FloatArray) -> FloatArray:
        t, now = times[:, None], self._estimate
        return now.pulley_velocity + t * (now.pulley_acceleration + t * now.pulley_jerk / 2.0)

    def _readings(self, o: Columns, rows: Rows) -> Readings:
        return Readings(
            heave_rate=o["pulley_velocity_z"],
            drum_angle=o["drum_angle"] * self._hoists.winch.radius[rows] / DRUM_RADIUS,
            stretch=self._hoists.stretch(o, rows),
            load_acceleration=self._hoists.load_acceleration(o, rows),
            depth_error=o["depth_error"],
        )


class KalmanObserver(Observer):
    """Kalman filters of the pulley, as a bank of waves, and of the load, bobbing on its rope."""

    def __init__(self, hoists: HoistBatch, damping_ratio: float, sensors: Sensors, waves: ExpectedWaves) -> None:
        """``sensors`` and ``waves``: delay, noise and motion that the filters are designed for."""
        super().__init__(hoists, damping_ratio, sensors.delay)
        rows, hold = len(hoists.frequency), max(1, round(sensors.depth_error.period / hoists.period))
        bank = WaveBank.of(waves, sensors)
        self._tension = sensors.tension
        self.waves = WaveFilter(rows, hoists.period, hold, bank)
        self._rope = RopeFilter(rows, bank.rate_noise)
        self._heave_rate, self._drum_angle, self._first_angle, self._depth_error = np.zeros((4, rows))

    def _start(self, o: Columns, rows: Rows) -> None:
        hoists, tension = self._hoists, self._tension
        noise = np.maximum(tension.noise, tension.relative_noise * hoists.mass[rows] * GRAVITY)
        model = hoists.model(self._damping_ratio, rows)
        self._rope.start(model, hoists.period, hoists.stretch_under(noise, o, rows), rows)
        self.waves.start(rows)
        self._heave_rate[rows], self._drum_angle[rows] = o["pulley_velocity_z"], o["drum_angle"]
        self._first_angle[rows], self._depth_error[rows] = o["drum_angle"], 0.0

    def _advance(self, o: Columns) -> None:
        radius, heave_rate, drum_angle = self._hoists.winch.radius, o["pulley_velocity_z"], o["drum_angle"]
        paid_out = radius * (drum_angle - self._drum_angle)
        speed = 0.5 * (heave_rate + self._heave_rate) - paid_out / self._hoists.period
        self._heave_rate, self._drum_angle = heave_rate, drum_angle
        self.waves.advance(heave_rate)
        self._rope.advance(speed, self._hoists.stretch(o))
        below = radius * (drum_angle - self._first_angle) + self._rope.stretch
        self.waves.correct(o["depth_error"] - self.waves.heave() + below)
        self._depth_error = self.waves.heave() - below

    def _load(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        return self._depth_error, self._rope.load_velocity, self._rope.stretch

    def _path(self, times: FloatArray) -> FloatArray:
        return self.waves.path(times)

    def _rate(self, times: FloatArray) -> FloatArray:
        return self.waves.rate(times)
