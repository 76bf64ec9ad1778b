"""The bank of oscillators that a ship in waves is followed with, and the gains by which readings correct it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import kernel
from aframe_env.scenario.motion_unit import MotionUnit
from aframe_env.scenario.sensors import Sensors
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import FloatArray

LEAST_RATE_NOISE: Final = 0.001
"""Least standard deviation of a reading of the heave rate that is reckoned with, m/s."""
LEAST_DEPTH_NOISE: Final = 0.001
"""And of the depth, m."""

UNIT_NOISE: Final = 0.1
"""Standard deviation of the heave rate's errors that a motion reference unit adds to its noise, m/s: what is not known
of its heave filter, lever arm and drift. Chosen on validation scenarios of the task MRU."""

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
        _recursion()(
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


@cache
def _recursion() -> Callable[..., None]:
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

    return recurse
