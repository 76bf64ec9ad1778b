"""A Kalman filter that estimates and predicts the pulley's path from the sensors.

Dead reckoning by the heave rate drifts by centimetres, and the depth sensor is too coarse and too slow to hold it. But
a ship in waves moves within a band of frequencies: ``WaveFilter`` holds its heave as a bank of oscillators of that
band (after Küchler, Mahl, Neupert, Schneider, Sawodny, IEEE/ASME Transactions on Mechatronics, 2011, with fixed bands
in place of modes that are identified on line), which also tell the motion to come. How much of the motion lies in which
band depends on the sea: there is a filter for each kind of sea, and their estimates count by how well each has foretold
the readings so far (Magill, IEEE Transactions on Automatic Control 10, 1965).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import prange

from aframe_env.dynamics.compiling import parallel_kernel, scalar
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.wave_bank import ComplexArray, WaveBank, exponents, parts_of, schedule

LEAST_MISFIT: Final = 1e-12
"""Least mean square of the readings' deviations that is reckoned with, as a share of their variance."""


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
        """For each kind of sea what ``parts_of`` has, the oscillators first, whose real parts add up to the heave rate,
        m/s; the last is the offset, m."""
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

    return _Kernels(advance, correct)
