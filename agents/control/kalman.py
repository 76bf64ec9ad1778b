"""Kalman filters that estimate the load's place and predict the pulley's path from the sensors.

Dead reckoning by the heave rate drifts by centimetres, and the depth sensor is too coarse and too slow to hold it. But
a ship in waves moves within a band of frequencies: ``WaveFilter`` holds its heave as a bank of oscillators of that
band (after Küchler, Mahl, Neupert, Schneider, Sawodny, IEEE/ASME Transactions on Mechatronics, 2011, with fixed bands
in place of modes that are identified on line), which also tell the motion to come. ``RopeFilter`` follows the load as
it bobs on its rope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.scenario.sensors import Sensors
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.rope import RopeModel

LEAST_RATE_NOISE: Final = 0.001
"""Least standard deviation of a reading of the heave rate that is reckoned with, m/s."""
LEAST_DEPTH_NOISE: Final = 0.001
"""And of the depth, m."""

ComplexArray = npt.NDArray[np.complex128]


@dataclass(frozen=True, kw_only=True)
class WaveBank:
    """Oscillators of the filter, and its noise model."""

    waves: ExpectedWaves
    """What the pulley's motion is expected to be: the oscillators' frequencies, their shares of it, its build-up."""
    rate_noise: float
    """Standard deviation of a reading of the heave rate, m/s."""
    depth_noise: float
    """Standard deviation of a reading of the depth, m; infinite where the depth is never read."""
    damping: float = 0.002
    """Rate at which an oscillator forgets, 1/s."""
    offset_drift: float = 1e-7
    """Variance by which the offset between heave and depth grows, m²/s."""

    @classmethod
    def of(cls, waves: ExpectedWaves, sensors: Sensors | None) -> WaveBank:
        """Bank for readings of these sensors; None for an exact heave rate alone, with which no depth is read."""
        if sensors is None:
            return cls(waves=waves, rate_noise=LEAST_RATE_NOISE, depth_noise=math.inf)
        rate, depth = sensors.heave_rate, sensors.depth_error
        return cls(
            waves=waves,
            rate_noise=max(LEAST_RATE_NOISE, math.hypot(rate.noise, rate.resolution / math.sqrt(12.0))),
            depth_noise=max(LEAST_DEPTH_NOISE, math.hypot(depth.noise, depth.resolution / math.sqrt(12.0))),
        )


@dataclass(frozen=True)
class Schedule:
    """Gains of K control steps; those of the last period of the depth sensor repeat from then on."""

    rate: ComplexArray
    """(K, bands + 1) gains of a reading of the heave rate, on the oscillators and on the offset."""
    depth: ComplexArray
    """(K, bands + 1) gains of a reading of the depth; zero where there is none."""
    hold: int
    """Control steps between two readings of the depth."""

    def index(self, step: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Index of the gains at these steps since the start of a lift."""
        beyond = len(self.rate) - self.hold
        return np.where(step < beyond, step, beyond + (step - beyond) % self.hold)


@cache
def schedule(bank: WaveBank, period: float, hold: int) -> Schedule:
    """Gains of the Kalman filter by the recursion of its covariance over 60 s."""
    steps = hold * round(60.0 / period / hold) + hold
    exponent = exponents(bank)
    bands, build_up = len(exponent), bank.waves.build_up
    transition = np.append(np.exp(exponent * period), 1.0)[:, None]
    rate = np.append(np.tile([1.0, 0.0], bands), 0.0)
    inverse = 1.0 / exponent
    depth = np.append(np.stack([inverse.real, -inverse.imag], axis=1).ravel(), 1.0)
    moving = np.arange(0, 2 * bands, 2)  # it is the rates that are stirred: a displacement does not jump
    variance = np.array(bank.waves.variance)
    # A ship that moves already has all of it, in both parts of every oscillator.
    covariance = np.diag(np.append(np.zeros(2 * bands) if build_up else np.repeat(variance, 2), 1e-6))
    gains = np.zeros((2, steps, 2 * bands + 1))
    for step in range(1, steps):
        covariance = _propagated(transition, _propagated(transition, covariance).T)
        rising = step * period < build_up
        grow = 2.0 * period / build_up if rising else -np.expm1(-2.0 * bank.damping * period)
        covariance[moving, moving] += 2.0 * variance * grow
        covariance[-1, -1] += bank.offset_drift * period
        for kind, row, noise in ((0, rate, bank.rate_noise), (1, depth, bank.depth_noise)):
            if kind == 0 or step % hold == 0:
                cross_covariance = (covariance * row).sum(axis=1)
                gains[kind, step] = cross_covariance / ((row * cross_covariance).sum() + noise**2)
                covariance -= np.outer(gains[kind, step], cross_covariance)
    paired = gains[..., :-1:2] + 1j * gains[..., 1::2]
    both = np.concatenate([paired, gains[..., -1:]], axis=-1)
    return Schedule(both[0], both[1], hold)


def _propagated(transition: ComplexArray, columns: FloatArray) -> FloatArray:
    """Columns (2 bands + 1, n) of oscillators, real and imaginary parts in turn, a control step later.

    No matrix product: the last digit of such a one depends on the threads that happen to share it.
    """
    pairs = np.concatenate([columns, np.zeros_like(columns[:1])])
    later = transition * (pairs[::2] + 1j * pairs[1::2])
    return np.stack([later.real, later.imag], axis=1).reshape(pairs.shape)[:-1]


def exponents(bank: WaveBank) -> ComplexArray:
    """Exponents λ (bands,) 1/s of the oscillators: each one goes with exp(λ t)."""
    return np.asarray(-bank.damping + 1j * np.array(bank.waves.frequency), dtype=np.complex128)


class WaveFilter:
    """Estimate and prediction of the pulley's heave, for N rows."""

    def __init__(self, rows: int, control_period: float, hold: int, bank: WaveBank) -> None:
        """``hold``: control steps between two readings of the depth."""
        self._schedule = schedule(bank, control_period, hold)
        self._exponent = exponents(bank)
        self._transition = np.append(np.exp(self._exponent * control_period), 1.0)
        self._state = np.zeros((rows, len(self._exponent) + 1), dtype=np.complex128)
        """The heave rate is the sum of the real parts of all but the last, m/s; the last is the offset, m."""
        self._step = np.zeros(rows, dtype=np.int64)
        self.innovation = np.zeros(rows)
        """Latest reading of the heave rate less what was foretold of it, (N,) m/s."""

    def start(self, rows: Rows = ALL) -> None:
        """Begin in these rows with a ship at rest."""
        self._state[rows] = 0.0
        self._step[rows] = 0
        self.innovation[rows] = 0.0

    def advance(self, heave_rate: FloatArray) -> None:
        """Take a reading (N,) m/s of the pulley's heave rate, a control step later."""
        self._step += 1
        self._state *= self._transition
        self.innovation = heave_rate - self._state[:, :-1].real.sum(axis=1)
        self._state += self.innovation[:, None] * self._schedule.rate[self._schedule.index(self._step)]

    def correct(self, innovation: FloatArray) -> None:
        """Take the innovation (N,) m of the depth; it counts in the steps that have a reading."""
        self._state += innovation[:, None] * self._schedule.depth[self._schedule.index(self._step)]

    def heave(self) -> FloatArray:
        """Rise (N,) m of the pulley since the start, and the offset."""
        return np.asarray(self.phasors().real.sum(axis=1) + self._state[:, -1].real)

    @property
    def exponents(self) -> ComplexArray:
        """Exponents λ (bands,) 1/s of the oscillators: each one's phasor goes with exp(λ t)."""
        return self._exponent

    def phasors(self) -> ComplexArray:
        """Phasors z (N, bands) m of the oscillators' heave at the latest reading's moment of measurement.

        Σ Re(z exp(λ t)) is the heave ``t`` s after it, about the mean of the waves.
        """
        return np.asarray(self._state[:, :-1] / self._exponent)

    def rate(self, times: FloatArray) -> FloatArray:
        """Velocity (T, N) m/s of the pulley, ``times`` (T,) s after the latest reading's moment of measurement."""
        return self._sum(np.exp(np.outer(times, self._exponent)))

    def acceleration(self, times: FloatArray) -> FloatArray:
        """Acceleration (T, N) m/s² of the pulley at these times."""
        return self._sum(np.exp(np.outer(times, self._exponent)) * self._exponent)

    def path(self, times: FloatArray) -> FloatArray:
        """Rise (T, N) m of the pulley since that moment."""
        return self._sum(np.expm1(np.outer(times, self._exponent)) / self._exponent)

    def _sum(self, factors: ComplexArray) -> FloatArray:
        # Row by row in the same order, whatever the batch: a sum, not a matrix product.
        return np.asarray((factors[:, None, :] * self._state[None, :, :-1]).real.sum(axis=2))


ACCELERATION_NOISE = 0.02
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

    def start(self, model: RopeModel, period: float, stretch_noise: FloatArray, rows: Rows = ALL) -> None:
        """Begin in these rows with loads at rest; ``stretch_noise`` (n,) of a reading of the stretch, m."""
        a, b = np.zeros((len(stretch_noise), 4, 4)), np.zeros((len(stretch_noise), 4))
        a[:, :3, :3], a[:, 3, 3] = model.a[:, :3, :3], 1.0
        b[:, :3] = model.b[:, :3]
        process_noise = self._rate_noise**2 * b[:, :, None] * b[:, None, :]
        process_noise[:, 1, 1] += (ACCELERATION_NOISE * period) ** 2
        self._a[rows], self._b[rows], self._process_noise[rows] = a, b, process_noise
        covariance = np.tile(np.diag([1e-4, 1e-4, 1e-4, 0.0]), (len(stretch_noise), 1, 1))
        covariance[:, 3, 3] = stretch_noise**2
        self._covariance[rows] = covariance
        self._noise[rows] = stretch_noise**2
        self._x[rows] = 0.0

    def advance(self, speed: FloatArray, stretch: FloatArray) -> None:
        """Take the mean speed (N,) m/s of the rope's end over a control step, and the stretch (N,) m at its end."""
        a = self._a
        x = (a @ self._x[:, :, None])[:, :, 0] + self._b * speed[:, None]
        p = a @ self._covariance @ a.transpose(0, 2, 1) + self._process_noise
        cross_covariance = p[:, :, 2] - p[:, :, 0] + p[:, :, 3]
        seen = cross_covariance[:, 2] - cross_covariance[:, 0] + cross_covariance[:, 3]
        gain = cross_covariance / (seen + self._noise)[:, None]
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
