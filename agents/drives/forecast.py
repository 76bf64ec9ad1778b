"""Heave of the crane's tip (the pulley S) as harmonics, for which a drive map gives a drive.

Two ways to know them: from the waves themselves, which is to know the whole future, and from a record of the heave
made before the start, which is what an operator has.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from aframe_env.scenario import Scenario
from aframe_env.scenario.motion import Components, Coordinate, has_components
from aframe_env.validation import InvalidValue, require_integer, require_number, shown
from agents.control.expected_waves import pulley_heave
from agents.policy import FloatArray

SAMPLING: Final = 0.5
"""Interval of a record's samples, s."""
_BAND: Final = (2.0, 30.0)  # s: periods in which harmonics of a ship's motion are looked for


@dataclass(frozen=True)
class Harmonics:
    """z(t) = Σ_i amplitude_i sin(frequency_i t + phase_i), t = 0 at the start."""

    amplitude: FloatArray
    """(n,) m, not negative."""
    frequency: FloatArray
    """(n,) rad/s."""
    phase: FloatArray
    """(n,) rad."""

    def at(self, times: FloatArray) -> FloatArray:
        """z (T,) m at ``times`` (T,) s."""
        return np.asarray(np.sin(times[:, None] * self.frequency + self.phase) @ self.amplitude)

    def scaled(self, factor: float) -> Harmonics:
        """Scale all amplitudes by a factor."""
        return Harmonics(factor * self.amplitude, self.frequency, self.phase)


def _components(scenario: Scenario) -> Components:
    if scenario.luffing is not None:
        raise InvalidValue(
            f"luffing = {shown(scenario.luffing)}: the forecast is for a pulley that rests on the deck: must be None"
        )
    if not has_components(scenario.motion):
        raise InvalidValue(f"motion = {scenario.motion}: a recorded motion is not known before the start")
    return scenario.motion.components()


def tip_heave(scenario: Scenario, times: FloatArray) -> FloatArray:
    """Height of the pulley S above its place at rest, (T,) m at ``times`` s, without the ramp; times may be < 0."""
    x, y, z = scenario.crane.pulley_position
    q = _components(scenario).at(times)[0]
    roll, pitch = q[:, Coordinate.ROLL], q[:, Coordinate.PITCH]
    turned = -np.sin(pitch) * x + np.cos(pitch) * (np.sin(roll) * y + np.cos(roll) * z)
    return np.asarray(q[:, Coordinate.HEAVE] + turned - z)


def known_harmonics(scenario: Scenario) -> Harmonics:
    """Tip heave of every component of the ship's motion, linear in the deck's angles: the whole future."""
    components = _components(scenario)
    # Re(c exp(iωt)) = |c| sin(ωt + arg c + π/2)
    heave = pulley_heave(components.response, scenario.crane)
    return Harmonics(np.abs(heave), components.frequency, np.angle(heave) + 0.5 * math.pi)


def fit_harmonics(times: FloatArray, signal: FloatArray, count: int) -> Harmonics:
    """The ``count`` harmonics that, with a mean, come closest to a signal (T,) at even ``times`` (T,) s.

    Taken one by one from the residual's spectrum; the frequencies of all are fitted anew after each.
    """
    if count < 1 or not np.any(signal):
        return Harmonics(np.zeros(0), np.zeros(0), np.zeros(0))
    size = 8 * len(times)
    grid = 2.0 * np.pi * np.fft.rfftfreq(size, times[1] - times[0])
    inside = (grid >= 2.0 * np.pi / _BAND[1]) & (grid <= 2.0 * np.pi / _BAND[0])
    middle = times.mean()

    def basis(frequency: FloatArray) -> FloatArray:
        turned = np.outer(times - middle, frequency)
        return np.concatenate([np.sin(turned), np.cos(turned), np.ones((len(times), 1))], axis=1)

    def residual(frequency: FloatArray) -> FloatArray:
        matrix = basis(frequency)
        return np.asarray(matrix @ np.linalg.lstsq(matrix, signal, rcond=1e-9)[0] - signal)

    frequency = np.empty(0)
    for _ in range(count):
        spectrum = np.abs(np.fft.rfft(residual(frequency) * np.hanning(len(times)), size))
        frequency = np.append(frequency, grid[int(np.argmax(np.where(inside, spectrum, -1.0)))])
        frequency = least_squares(residual, frequency, x_scale=0.1 * grid[inside][0], max_nfev=30).x
    sine, cosine = np.linalg.lstsq(basis(frequency), signal, rcond=1e-9)[0][:-1].reshape(2, -1)
    return Harmonics(np.hypot(sine, cosine), frequency, np.arctan2(cosine, sine) - frequency * middle)


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A record of the tip's heave before the start, and the forecast from it.

    As many harmonics are taken as have best forecast later parts of the same record from earlier ones, and as much of
    them as the worst of those forecasts was worth: all of a regular wave, nothing of a sea in which nothing lasts.
    """

    record: float = 240.0
    """Length of the record up to the start, s."""
    window: float = 120.0
    """Length of the part that harmonics are fitted to, s."""
    horizon: float = 60.0
    """Time ahead over which the forecasts are judged, s."""
    trials: int = 3
    """Forecasts within the record that the number of harmonics is chosen by."""
    most: int = 3
    """Greatest number of harmonics."""

    def __post_init__(self) -> None:
        require_number("window", self.window, "s", low=10.0, high=3600.0)
        require_number("horizon", self.horizon, "s", low=1.0, high=3600.0)
        require_number("record", self.record, "s", low=self.window + self.horizon, high=1e5)
        require_integer("trials", self.trials, low=1, high=100)
        require_integer("most", self.most, low=1, high=32)

    def forecast(self, scenario: Scenario) -> Harmonics:
        """Harmonics that the tip's heave after the start is expected to have."""
        times: FloatArray = SAMPLING * np.arange(-round(self.record / SAMPLING), 1, dtype=np.float64)
        heave = tip_heave(scenario, times)
        length, ahead = round(self.window / SAMPLING), round(self.horizon / SAMPLING)
        ends = np.linspace(length, len(times) - 1 - ahead, self.trials).astype(int).tolist()
        best, share, count = 0.0, 0.0, 0
        for n in range(1, self.most + 1):
            cross, square = np.empty(self.trials), np.empty(self.trials)
            for i, end in enumerate(ends):
                fitted, judged = slice(end - length, end + 1), slice(end + 1, end + 1 + ahead)
                expected = fit_harmonics(times[fitted], heave[fitted], n).at(times[judged])
                cross[i] = expected @ (heave[judged] - heave[fitted].mean())
                square[i] = max(float(expected @ expected), 1e-300)
            worth = float(np.clip(cross / square, 0.0, 1.0).min())
            gain = float(np.sum(2.0 * worth * cross - worth**2 * square))
            if gain > 1.001 * best:
                best, share, count = gain, worth, n
        return fit_harmonics(times[-length - 1 :], heave[-length - 1 :], count).scaled(share)
