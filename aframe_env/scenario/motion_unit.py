"""A motion reference unit: what it makes of the pulley's heave before noise and delay come on top.

Such a unit integrates the vertical acceleration twice. What is slow in it, its own errors above all, would grow beyond
all bounds, and a high-pass filter of second order takes it out: ÿ + 2 ζ ω ẏ + ω² y = z̈ for the heave z. At the waves'
periods, some of which are not far from the filter's, the heave y and its rate come out too early, and too large or too
small. Manuals leave period and damping to the user: 20 s and 0.707 to begin with (Applanix, POS MV V5 installation and
operation guide, 2017, appendix B), by the waves' period or by itself (Kongsberg, Seapath 320 installation manual,
section 4.4.4.3; Godhavn, Adaptive tuning of heave filter in motion sensor, OCEANS '98).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import kernel
from aframe_env.dynamics.random import draw_seed, normal, uniform
from aframe_env.scenario.interval import Range, require_range, within
from aframe_env.scenario.motion import Coordinate, has_components, point_heave
from aframe_env.scenario.scenario import Scenario
from aframe_env.validation import require_number

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

STATE: Final = 9
"""Numbers that the rest of a row's readings depends on."""
_LOW_REAL, _LOW_IMAG, _FORCE, _DRIFT, _ROLL, _ROLL_BEFORE, _PITCH, _PITCH_BEFORE, _OUT = range(STATE)
# The heave's slow part, which the filter takes out, as ``_sense_kernel`` has it; what drives it; the accelerometer's
# error; the deck's angles a step ago and two; 1 in a dropout.
_FAR: Final = 2**60
"""Index of a row's own draws, beyond all that the channels' noise draws with the same seed."""
READ: Final = 4
"""Channels that the unit reads, the first ones: heave, heave rate, roll, pitch."""


@dataclass(frozen=True, kw_only=True)
class MotionUnit:
    """A motion reference unit with the errors of real ones; noise and delay are those of its channels.

    What is drawn is drawn for each episode by the seed of the sensors' noise, and nobody is told it.
    """

    heave_period: Range = 20.0
    """Cut-off period 2π/ω of the heave filter, s. An interval: drawn from it; known is its middle."""
    heave_damping: float = 0.707
    """Its damping ζ, share of critical."""
    lever_arm_error: float = 0.0
    """Standard deviation of x and of y of the lever arm from unit to pulley that the unit was told, m. Roll and pitch
    leak into the heave by it."""
    acceleration_drift: float = 0.0
    """Standard deviation of the accelerometer's error (first-order Gauss-Markov process), m/s². Heave drifts by it over
    ω²: 0.1 m for 0.01 m/s² and 20 s."""
    drift_time: float = 60.0
    """Time constant of that error, s."""
    angle_bias: float = 0.0
    """Standard deviation of the constant errors of roll and pitch, rad."""
    dropouts: float = 0.0
    """How often the unit's readings stop, per minute of those in which they do not; the last ones stay."""
    dropout_time: float = 1.0
    """Mean length of a dropout (exponentially distributed), s."""

    def __post_init__(self) -> None:
        require_range("heave_period", self.heave_period, "s", 1.0, 1e3)
        require_number("heave_damping", self.heave_damping, "of critical", low=0.1, high=0.99)
        require_number("lever_arm_error", self.lever_arm_error, "m", low=0.0, high=100.0)
        require_number("acceleration_drift", self.acceleration_drift, "m/s²", low=0.0, high=10.0)
        require_number("drift_time", self.drift_time, "s", low=1e-3, high=1e6)
        require_number("angle_bias", self.angle_bias, "rad", low=0.0, high=0.5)
        require_number("dropouts", self.dropouts, "per minute", low=0.0, high=600.0)
        require_number("dropout_time", self.dropout_time, "s", low=1e-3, high=600.0)

    def passed(self, exponent: ComplexArray) -> ComplexArray:
        """Complex share of a heave that goes with exp(s t) which the filter lets pass, as far as it is known.

        ``exponent`` s in 1/s; iω for a steady wave.
        """
        return 1.0 - _slow_share(exponent, self._frequency, self.heave_damping)

    @property
    def exponent(self) -> complex:
        """λ in 1/s: what is left of a change goes with Re(c exp(λ t)), as far as the filter is known."""
        return self._frequency * complex(-self.heave_damping, math.sqrt(1.0 - self.heave_damping**2))

    @property
    def _frequency(self) -> float:
        return 2.0 * math.pi / within(self.heave_period, 0.5)


def _slow_share(exponent: ComplexArray, frequency: float, damping: float) -> ComplexArray:
    """Share of a heave that goes with exp(s t) which a filter takes out."""
    slow = 2.0 * damping * frequency * exponent + frequency**2
    return np.asarray(slow / (exponent**2 + slow))


@dataclass(frozen=True)
class Past:
    """Motion before an episode that begins on a moving ship, as a sum of waves with phases as at its start."""

    frequency: FloatArray
    """(K,) rad/s."""
    heave: ComplexArray
    """(K,) of the pulley, m."""
    roll: ComplexArray
    """(K,) rad."""
    pitch: ComplexArray
    """(K,) rad."""

    @classmethod
    def of(cls, scenario: Scenario) -> Past | None:
        """Past of a scenario; None where the ship was at rest, or where nobody knows it: that of a record."""
        if scenario.ramp > 0.0 or not has_components(scenario.motion):
            return None
        waves = scenario.motion.components()
        heave = point_heave(waves.response, scenario.crane.pulley_position)
        return cls(waves.frequency, heave, waves.response[:, Coordinate.ROLL], waves.response[:, Coordinate.PITCH])

    @property
    def exponent(self) -> ComplexArray:
        """(K,) iω: each wave goes with exp(iω t), 1/s."""
        return np.asarray(1j * self.frequency, dtype=np.complex128)

    def change(self, amplitude: ComplexArray, period: float, steps: int) -> FloatArray:
        """What a sum of waves of this ``amplitude`` (K,) was beyond what it is at the start, (steps,).

        A ``period`` [s] before the start, two of them, and so on.
        """
        times = -period * np.arange(1.0, steps + 1.0)
        return np.asarray((np.expm1(np.outer(times, self.exponent)) @ amplitude).real)


class MotionUnitBank:
    """The units of many rows, control step by control step."""

    def __init__(self, unit: MotionUnit, rows: int, control_period: float) -> None:
        self._unit, self._period = unit, control_period
        self._arm, self._bias = np.zeros((2, rows, 2))
        """(rows, 2) errors of the lever arm, x and y [m], and of roll and pitch [rad]."""
        self._own = np.zeros((rows, 2), dtype=np.uint64)
        """Seeds of drift and dropouts."""
        self._pole, self._turn, self._earlier, self._later = np.ones((4, rows), dtype=np.complex128)
        """λ of the filters, exp(λ h), and the weights of what drives them at both ends of a control step."""
        self._keep = math.exp(-control_period / unit.drift_time)
        self._chances = (
            -math.expm1(-unit.dropouts * control_period / 60.0),
            -math.expm1(-control_period / unit.dropout_time),
        )

    def draw(self, index: int, seed: int) -> None:
        """Draw what stays through a row's episode by the ``seed`` of its noise."""
        unit, own = self._unit, [draw_seed(seed, _FAR + i) for i in range(3)]
        self._own[index] = own[:2]
        self._arm[index] = [unit.lever_arm_error * normal(own[2], i) for i in (0, 1)]
        self._bias[index] = [unit.angle_bias * normal(own[2], i) for i in (2, 3)]
        frequency = 2.0 * math.pi / within(unit.heave_period, uniform(own[2], 8))
        damping, period = unit.heave_damping, self._period
        pole = frequency * complex(-damping, math.sqrt(1.0 - damping**2))
        turn = cmath.exp(pole * period)
        # exp(λ s) folded with what drives the filter, which goes straight from one end of a step to the other.
        later = (turn - 1.0 - pole * period) / (pole * pole * period)
        self._pole[index], self._turn[index] = pole, turn
        self._earlier[index], self._later[index] = (turn - 1.0) / pole - later, later

    def start(self, index: int, state: FloatArray, truth: FloatArray, past: Past | None) -> None:
        """Start a row that has been drawn at ``truth`` (channels,), which becomes what the unit makes of it.

        The unit has been running for long. ``state`` (STATE,) is filled.
        """
        heave, rate, roll, pitch = truth[:READ].tolist()
        angle_rates = np.zeros(2)
        slow, slow_rate = heave + self._leak(index, roll, pitch), 0.0
        if past is not None:
            turning = past.exponent
            angle_rates = np.array([(turning * past.roll).real.sum(), (turning * past.pitch).real.sum()])
            pole = self._pole[index]
            reported = past.heave + self._leak(index, past.roll, past.pitch)
            taken = reported * _slow_share(turning, abs(pole), -pole.real / abs(pole))
            # Where the ship is about, which the sum of waves has at 0, is taken out altogether.
            slow += float((taken - reported).real.sum())
            slow_rate = float((turning * taken).real.sum())
        pole = self._pole[index]
        state[_DRIFT] = self._unit.acceleration_drift * normal(self._own[index, 0], 0)
        slow -= state[_DRIFT] / abs(pole) ** 2
        state[_LOW_REAL], state[_LOW_IMAG] = slow_rate - pole.real * slow, pole.imag * slow
        rate += self._leak(index, *angle_rates)
        state[_FORCE] = (
            abs(pole) ** 2 * (heave + self._leak(index, roll, pitch)) - 2.0 * pole.real * rate - state[_DRIFT]
        )
        # The steps before from the rates: the first difference in three points then gives these again.
        for name, before, angle, angle_rate in (
            (_ROLL, _ROLL_BEFORE, roll, angle_rates[0]),
            (_PITCH, _PITCH_BEFORE, pitch, angle_rates[1]),
        ):
            state[name], state[before] = angle, angle - self._period * angle_rate
        state[_OUT] = 0.0
        truth[0] += self._leak(index, roll, pitch) - slow
        truth[1] = rate - slow_rate
        truth[2:READ] += self._bias[index]

    def _leak(self, index: int, roll: Any, pitch: Any) -> Any:
        """Heave (or its rate) that roll and pitch (or theirs) make of the lever arm's error."""
        x, y = self._arm[index]
        return y * roll - x * pitch

    def before(self, index: int, past: Past, steps: int) -> FloatArray:
        """What the unit told in each of so many control steps before a row's start, beyond what it tells then."""
        turning, pole = past.exponent, self._pole[index]
        reported = past.heave + self._leak(index, past.roll, past.pitch)
        told = reported * (1.0 - _slow_share(turning, abs(pole), -pole.real / abs(pole)))
        sums = told, turning * told, past.roll, past.pitch
        return np.stack([past.change(each, self._period, steps) for each in sums], axis=1)

    def sense(self, truth: FloatArray, state: FloatArray, count: npt.NDArray[np.int64]) -> FloatArray:
        """What the units make of ``truth`` (rows, channels), a control step later.

        ``state`` (rows, STATE) goes on by that step, the ``count`` (rows,)-th.
        """
        told = truth.copy()
        drift = self._unit.acceleration_drift
        _sense_kernel()(
            told,
            state,
            self._arm,
            self._bias,
            self._pole,
            self._turn,
            self._earlier,
            self._later,
            (self._period, self._keep, drift * math.sqrt(1.0 - self._keep**2)),
            self._chances,
            self._own,
            count,
        )
        return told

    @staticmethod
    def out(state: FloatArray) -> npt.NDArray[np.bool_]:
        """(rows,) true in a dropout, by ``state`` (rows, STATE)."""
        return np.asarray(state[:, _OUT] > 0.0)


@cache
def _sense_kernel():  # type: ignore[no-untyped-def]

    @kernel
    def sense(told, state, arm, bias, pole, turn, earlier, later, pace, chances, own, count):  # type: ignore[no-untyped-def]
        period, keep, fresh = pace
        for i in range(told.shape[0]):
            s = state[i]
            roll, pitch, x, y = told[i, 2], told[i, 3], arm[i, 0], arm[i, 1]
            # The rates by three points: late by nothing, wrong by a third of (step times frequency)².
            roll_rate = 0.5 * (3.0 * roll - 4.0 * s[_ROLL] + s[_ROLL_BEFORE]) / period
            pitch_rate = 0.5 * (3.0 * pitch - 4.0 * s[_PITCH] + s[_PITCH_BEFORE]) / period
            s[_ROLL_BEFORE], s[_ROLL], s[_PITCH_BEFORE], s[_PITCH] = s[_ROLL], roll, s[_PITCH], pitch
            heave = told[i, 0] + (y * roll - x * pitch)
            rate = told[i, 1] + (y * roll_rate - x * pitch_rate)
            s[_DRIFT] = keep * s[_DRIFT] + fresh * normal(own[i, 0], count[i])
            # y = z - Im c / Im λ and ẏ = ż - Im λ c / Im λ, where ċ = λ c + 2 ζ ω ż + ω² z less the accelerometer's
            # error.
            damping, stiffness = -2.0 * pole[i].real, pole[i].real ** 2 + pole[i].imag ** 2
            force = damping * rate + stiffness * heave - s[_DRIFT]
            low = turn[i] * complex(s[_LOW_REAL], s[_LOW_IMAG]) + (earlier[i] * s[_FORCE] + later[i] * force)
            s[_LOW_REAL], s[_LOW_IMAG], s[_FORCE] = low.real, low.imag, force
            told[i, 0] = heave - low.imag / pole[i].imag
            told[i, 1] = rate - (pole[i] * low).imag / pole[i].imag
            told[i, 2] = roll + bias[i, 0]
            told[i, 3] = pitch + bias[i, 1]
            chance = uniform(own[i, 1], count[i])
            stays = 1.0 - chances[1]
            s[_OUT] = 1.0 if chance < (chances[0] if s[_OUT] == 0.0 else stays) else 0.0

    return sense
