"""Kalman filters that estimate the load's place and predict the pulley's path from the sensors.

Dead reckoning by the heave rate drifts by centimetres, and the depth sensor is too coarse and too slow to hold it. But
a ship in waves moves within a band of frequencies: ``WaveFilter`` holds its heave as a bank of oscillators of that
band (after Küchler, Mahl, Neupert, Schneider, Sawodny, IEEE/ASME Transactions on Mechatronics, 2011, with fixed bands
in place of modes that are identified on line), which also tell the motion to come. How much of the motion lies in which
band depends on the sea: there is a filter for each kind of sea, and their estimates count by how well each has foretold
the readings so far (Magill, IEEE Transactions on Automatic Control 10, 1965). ``RopeFilter`` follows the load as it
bobs on its rope.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import prange

from aframe_env.dynamics.compiling import kernel, parallel_kernel, scalar
from aframe_env.scenario.motion_unit import MotionUnit
from aframe_env.scenario.sensors import Sensors
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.rope import RopeModel

LEAST_RATE_NOISE: Final = 0.001
"""Least standard deviation of a reading of the heave rate that is reckoned with, m/s."""
LEAST_DEPTH_NOISE: Final = 0.001
"""And of the depth, m."""

UNIT_NOISE: Final = 0.1
"""Standard deviation of the heave rate's errors that a motion reference unit adds to its noise, m/s: what is not known
of its heave filter, lever arm and drift. Chosen on validation scenarios of the task MRU."""

LEAST_MISFIT: Final = 1e-12
"""Least mean square of the readings' deviations that is reckoned with, as a share of their variance."""

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
    unit: MotionUnit | None = None
    """Motion reference unit whose heave filter the readings have passed; None: they are the pulley's heave rate."""

    @property
    def finds(self) -> bool:
        """Whether the readings at the start count, for ``WaveFilter.find``: of a unit on a ship that moves already."""
        return self.unit is not None and not self.waves.build_up

    @classmethod
    def of(cls, waves: ExpectedWaves, sensors: Sensors | None) -> WaveBank:
        """Bank for readings of these sensors; None for an exact heave rate alone, with which no depth is read."""
        if sensors is None:
            return cls(waves=waves, rate_noise=LEAST_RATE_NOISE, depth_noise=math.inf)
        rate, depth, unit = sensors.heave_rate, sensors.depth_error, sensors.motion_unit
        rate_noise = math.hypot(rate.noise, rate.resolution / math.sqrt(12.0))
        return cls(
            waves=waves,
            rate_noise=max(LEAST_RATE_NOISE, rate_noise if unit is None else math.hypot(rate_noise, UNIT_NOISE)),
            depth_noise=max(LEAST_DEPTH_NOISE, math.hypot(depth.noise, depth.resolution / math.sqrt(12.0))),
            unit=unit,
        )


@dataclass(frozen=True)
class Schedule:
    """Gains of K control steps for M kinds of sea; those of the last period of the depth sensor repeat from then on."""

    rate: ComplexArray
    """(K, M, parts + 1) gains of a reading of the heave rate, on what ``parts_of`` has and on the offset."""
    depth: ComplexArray
    """(K, M, parts + 1) gains of a reading of the depth; zero where there is none."""
    spread: FloatArray
    """(K, M) variance of a reading of the heave rate about what is foretold of it, m²/s²."""
    hold: int
    """Control steps between two readings of the depth."""

    def index(self, step: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Index of the gains at these steps since the start of a lift."""
        beyond = len(self.rate) - self.hold
        return np.where(step < beyond, step, beyond + (step - beyond) % self.hold)


@cache
def schedule(bank: WaveBank, period: float, hold: int) -> Schedule:
    """Gains of the Kalman filters by the recursion of their covariances over 60 s."""
    steps = hold * round(60.0 / period / hold) + hold
    variances = np.array(bank.waves.variances)
    (kinds, bands), build_up = variances.shape, bank.waves.build_up
    exponent, weight, inverse = parts_of(bank)
    transition, parts = np.exp(exponent * period), 2 * len(exponent) + 1
    rate = np.append(np.stack([weight.real, -weight.imag], axis=1).ravel(), 0.0)
    depth = np.append(np.stack([inverse.real, -inverse.imag], axis=1).ravel(), 1.0)
    # It is the rates that are stirred: a displacement does not jump.
    rising = period * np.arange(steps) < build_up
    grow = np.where(rising, 2.0 * period / build_up if build_up else 0.0, -np.expm1(-2.0 * bank.damping * period))
    # A ship that moves already has all of it, in both parts of every oscillator.
    start = np.zeros((kinds, parts))
    start[:, : 2 * bands] = 0.0 if build_up else np.repeat(variances, 2, axis=1)
    start[:, -1] = 1e-6
    gains, spread = np.zeros((2, kinds, steps, parts)), np.ones((kinds, steps))
    for kind in range(kinds):
        _kernels().recurse(
            start[kind],
            transition,
            2.0 * variances[kind],
            stirred(bank),
            grow,
            bank.offset_drift * period,
            np.stack([rate, depth]),
            (bank.rate_noise**2, bank.depth_noise**2),
            hold,
            0 if bank.finds else 1,
            gains[:, kind],
            spread[kind],
        )
    paired = gains[..., :-1:2] + 1j * gains[..., 1::2]
    both = np.ascontiguousarray(np.concatenate([paired, gains[..., -1:]], axis=-1).swapaxes(1, 2))
    return Schedule(both[0], both[1], np.ascontiguousarray(spread.T), hold)


def exponents(bank: WaveBank) -> ComplexArray:
    """Exponents λ (bands,) 1/s of the oscillators: each one goes with exp(λ t)."""
    return np.asarray(-bank.damping + 1j * np.array(bank.waves.frequency), dtype=np.complex128)


def parts_of(bank: WaveBank) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Exponents of what a bank follows, and by what it is multiplied to be read as heave rate, and as heave.

    The oscillators; and with a motion reference unit what its heave filter has left of their changes, which is read
    beside their shares that it lets pass, and is no heave.
    """
    exponent = exponents(bank)
    if bank.unit is None:
        return exponent, np.ones_like(exponent), 1.0 / exponent
    left = np.array([bank.unit.exponent])
    weight = np.append(bank.unit.passed(exponent), 1.0)
    return np.append(exponent, left), weight, np.append(1.0 / exponent, 0.0)


def stirred(bank: WaveBank) -> FloatArray:
    """What a jump of an oscillator's rate leaves in the unit's heave filter, for each, as real and imaginary part.

    (bands, 2); (0, 2) without a unit. What the filter takes out, z - y of a heave z, jumps no more than its rate does.
    """
    if bank.unit is None:
        return np.zeros((0, 2))
    exponent, left = exponents(bank), bank.unit.exponent
    slow = 1.0 - bank.unit.passed(exponent)
    rate, place = slow.real, (slow / exponent).real
    return np.stack([rate, (place * abs(left) ** 2 - rate * left.real) / left.imag], axis=1)


class WaveFilter:
    """Estimate and prediction of the pulley's heave, for N rows."""

    def __init__(self, rows: int, control_period: float, hold: int, bank: WaveBank) -> None:
        """``hold``: control steps between two readings of the depth."""
        self._schedule = schedule(bank, control_period, hold)
        self._exponent = exponents(bank)
        followed, self._weight, self._inverse = parts_of(bank)
        self._transition = np.append(np.exp(followed * control_period), 1.0)
        self.finds = bank.finds
        """Whether ``find`` is to follow on ``start``."""
        kinds, parts = self._schedule.rate.shape[1:]
        self._of_kinds = np.zeros((rows, kinds, parts), dtype=np.complex128)
        """For each kind of sea the heave rate is the sum of the real parts of all but the last, m/s; the last is the
        offset, m."""
        self._state = np.zeros((rows, parts), dtype=np.complex128)
        """The kinds' mean by their probabilities."""
        self._misfit = np.zeros((rows, kinds))
        """Sum of the readings' squared deviations from what each kind foretold, as shares of their variance."""
        self._log_spread = np.zeros((rows, kinds))
        """Sum of the logarithms of these variances."""
        self.probability = np.full((rows, kinds), 1.0 / kinds)
        """(N, M) of each kind of sea, by the readings so far."""
        self._step, self._heard = np.zeros((2, rows), dtype=np.int64)
        self.missed = np.zeros(rows)
        """(N,) what the latest reading of the depth was above what had been foretold, m."""

    def start(self, rows: Rows = ALL) -> None:
        """Begin in these rows with a ship at rest."""
        self._of_kinds[rows] = 0.0
        self._state[rows] = 0.0
        self._misfit[rows] = 0.0
        self._log_spread[rows] = 0.0
        self.probability[rows] = 1.0 / self.probability.shape[1]
        self._step[rows] = 0
        self._heard[rows] = 0
        self.missed[rows] = 0.0

    def find(self, heave_rate: FloatArray, depth: FloatArray, rows: Rows = ALL) -> None:
        """Take the readings (n,) of heave rate [m/s] and heave by the depth [m] at the start of these rows."""
        first, state = self._schedule, self._of_kinds[rows]
        state += heave_rate[:, None, None] * first.rate[0]
        heave = (state[..., :-1] * self._inverse).real.sum(axis=2) + state[..., -1].real
        state += (depth[:, None] - heave)[..., None] * first.depth[0]
        self._of_kinds[rows], self._state[rows] = state, state.mean(axis=1)

    def advance(self, heave_rate: FloatArray, heard: npt.NDArray[np.bool_] | None = None) -> None:
        """Take a reading (N,) m/s of the pulley's heave rate, a control step later; where it is ``heard`` (N,)."""
        heard = np.ones(len(heave_rate), dtype=np.bool_) if heard is None else heard
        self._step += 1
        self._heard += heard
        _kernels().advance(
            self._of_kinds,
            self._transition,
            self._weight,
            heave_rate,
            heard,
            self._schedule.rate,
            self._schedule.spread,
            self._schedule.index(self._step),
            self._heard,
            self._misfit,
            self._log_spread,
            self.probability,
            self._state,
        )

    def correct(self, innovation: FloatArray) -> None:
        """Take the innovation (N,) m of the depth; it counts in the steps that have a reading."""
        self.missed = np.where(self._step % self._schedule.hold == 0, innovation, self.missed)
        _kernels().correct(
            self._of_kinds,
            self._inverse,
            innovation,
            self._schedule.depth,
            self._schedule.index(self._step),
            self.probability,
            self._state,
        )

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
        return np.asarray(self._waves / self._exponent)

    @property
    def _waves(self) -> ComplexArray:
        return self._state[:, : len(self._exponent)]

    def rate(self, times: FloatArray) -> FloatArray:
        """Velocity (T, N) m/s of the pulley, ``times`` s after the latest reading's moment of measurement.

        Here and below (T,), the same for all rows, or (T, N).
        """
        return self._sum(np.exp(self._turns(times)))

    def acceleration(self, times: FloatArray) -> FloatArray:
        """Acceleration (T, N) m/s² of the pulley at these times."""
        return self._sum(np.exp(self._turns(times)) * self._exponent)

    def path(self, times: FloatArray) -> FloatArray:
        """Rise (T, N) m of the pulley since that moment."""
        return self._sum(np.expm1(self._turns(times)) / self._exponent)

    def _turns(self, times: FloatArray) -> ComplexArray:
        """Exponents λ t, (T, 1 or N, bands)."""
        return np.asarray((times if times.ndim == 2 else times[:, None])[:, :, None] * self._exponent)

    def _sum(self, factors: ComplexArray) -> FloatArray:
        # Row by row in the same order, whatever the batch: a sum, not a matrix product.
        return np.asarray((factors * self._waves[None]).real.sum(axis=2))


class _Kernels(NamedTuple):
    recurse: Callable[..., None]
    advance: Callable[..., None]
    correct: Callable[..., None]


@scalar
def _mix(of_kinds: ComplexArray, probability: FloatArray, state: ComplexArray) -> None:
    """Put the kinds' mean (parts,) into ``state``."""
    for part in range(state.shape[0]):
        mean = 0.0j
        for kind in range(of_kinds.shape[0]):
            mean += probability[kind] * of_kinds[kind, part]
        state[part] = mean


@scalar
def _weigh(misfit: FloatArray, log_spread: FloatArray, readings: int, probability: FloatArray) -> None:
    """Put the kinds' probabilities (M,) by their likelihood into ``probability``.

    How high the waves are is not known: it is what makes a kind's readings the likeliest.
    """
    best = -math.inf
    for kind in range(probability.shape[0]):
        height = max(misfit[kind] / readings, LEAST_MISFIT)
        probability[kind] = -0.5 * (readings * math.log(height) + log_spread[kind])
        best = max(best, probability[kind])
    total = 0.0
    for kind in range(probability.shape[0]):
        probability[kind] = math.exp(probability[kind] - best)
        total += probability[kind]
    for kind in range(probability.shape[0]):
        probability[kind] /= total


@cache
def _kernels() -> _Kernels:
    @kernel
    def recurse(  # type: ignore[no-untyped-def]
        start, transition, stir, leaves, grow, drift, rows, noise, hold, first, gains, spread
    ):
        parts, bands = start.shape[0], transition.shape[0]
        left = parts - 3  # of the unit's heave filter, where there is one
        covariance = np.diag(start)
        cross = np.empty(parts)
        for step in range(first, spread.shape[0]):
            # A turn of each oscillator, on the rows and then on the columns.
            for i in range(bands):
                c, s = transition[i].real, transition[i].imag
                for j in range(parts):
                    x, y = covariance[2 * i, j], covariance[2 * i + 1, j]
                    covariance[2 * i, j], covariance[2 * i + 1, j] = c * x - s * y, s * x + c * y
            for j in range(parts):
                for i in range(bands):
                    c, s = transition[i].real, transition[i].imag
                    x, y = covariance[j, 2 * i], covariance[j, 2 * i + 1]
                    covariance[j, 2 * i], covariance[j, 2 * i + 1] = c * x - s * y, s * x + c * y
            for i in range(stir.shape[0]):
                covariance[2 * i, 2 * i] += stir[i] * grow[step]
            for i in range(leaves.shape[0]):
                for j in range(2):
                    covariance[2 * i, left + j] += leaves[i, j] * stir[i] * grow[step]
                    covariance[left + j, 2 * i] += leaves[i, j] * stir[i] * grow[step]
                    for k in range(2):
                        covariance[left + j, left + k] += leaves[i, j] * leaves[i, k] * stir[i] * grow[step]
            covariance[-1, -1] += drift
            for sensor in range(2):
                if sensor == 1 and step % hold != 0:
                    continue
                seen = noise[sensor]
                for j in range(parts):
                    cross[j] = 0.0
                    for k in range(parts):
                        cross[j] += covariance[j, k] * rows[sensor, k]
                    seen += cross[j] * rows[sensor, j]
                if sensor == 0:
                    spread[step] = seen
                for j in range(parts):
                    gains[sensor, step, j] = cross[j] / seen
                    for k in range(parts):
                        covariance[j, k] -= gains[sensor, step, j] * cross[k]

    @parallel_kernel
    def advance(  # type: ignore[no-untyped-def]
        of_kinds,
        transition,
        weight,
        reading,
        heard,
        gain,
        spread,
        index,
        readings,
        misfit,
        log_spread,
        probability,
        state,
    ):
        kinds, parts = of_kinds.shape[1:]
        for row in prange(of_kinds.shape[0]):
            at = index[row]
            for kind in range(kinds):
                deviation = reading[row]
                for part in range(parts):
                    of_kinds[row, kind, part] *= transition[part]
                    if part < parts - 1:
                        deviation -= (weight[part] * of_kinds[row, kind, part]).real
                if not heard[row]:
                    continue
                for part in range(parts):
                    of_kinds[row, kind, part] += deviation * gain[at, kind, part]
                misfit[row, kind] += deviation * deviation / spread[at, kind]
                log_spread[row, kind] += math.log(spread[at, kind])
            if heard[row]:
                _weigh(misfit[row], log_spread[row], readings[row], probability[row])
            _mix(of_kinds[row], probability[row], state[row])

    @parallel_kernel
    def correct(of_kinds, inverse, innovation, gain, index, probability, state):  # type: ignore[no-untyped-def]
        kinds, parts = of_kinds.shape[1:]
        for row in prange(of_kinds.shape[0]):
            at = index[row]
            # The innovation is of the mean; each kind has its own.
            reading = innovation[row] + state[row, parts - 1].real
            for part in range(parts - 1):
                reading += (state[row, part] * inverse[part]).real
            for kind in range(kinds):
                deviation = reading - of_kinds[row, kind, parts - 1].real
                for part in range(parts - 1):
                    deviation -= (of_kinds[row, kind, part] * inverse[part]).real
                for part in range(parts):
                    of_kinds[row, kind, part] += deviation * gain[at, kind, part]
            _mix(of_kinds[row], probability[row], state[row])

    return _Kernels(recurse, advance, correct)


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
