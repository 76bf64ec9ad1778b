"""Starting guesses of the search for a drive, that need no luck: the inverse of the model's vertical motion.

That is the rope that a load held at h would need while the pulley moves, in the least-squares sense of a family of
drives. Under the winch's limits what a drive asks beyond them has its price in that sense.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from agents.drives.functions import (
    harmonic_jacobian,
    harmonic_samples,
    spline_matrices,
    start_of_harmonics,
    uniform_harmonic_samples,
)
from agents.drives.objectives import Objective

FloatArray = npt.NDArray[np.float64]

PRICE: Final = 10.0
"""Price of an excess of 1 m/s² of rope, or of 1 m/s, in metres of rope that are missing for as long."""
MARGIN: Final = 0.98
"""Share of the winch's limits that a drive may ask for at no price: a drum that follows needs room to catch up."""
_FITS = 60  # Gauss-Newton steps after each harmonic
_FITS_WITHIN_LIMITS = 10  # a rough fit does where it is fitted anew within the limits
_LEAST_SCALE = 0.02  # m of rope: a harmonic smaller than this is scaled as if it were this large


def required_angle(objective: Objective) -> FloatArray:
    """Drum angle [rad] at the objective's times that would hold the load at h right below where the ship rests.

    The rope's law solved for the unstretched length at a tension equal to the weight: what remains to be found by
    optimisation is the pendulum's share, the start's transient, and the part that the family of drives cannot follow.
    """
    scenario = objective.scenario
    crane = scenario.crane
    load = np.array([*crane.pulley_position[:2], scenario.target_level])
    if scenario.luffing is not None:
        load = scenario.luffing.at(crane.frame, objective.times).pulley
        load[:, 2] = scenario.target_level
    distance = np.linalg.norm(objective.path[:, :3] - load, axis=1)
    length = (distance + objective.path[:, 9]) / (1.0 + scenario.pulley_strain)
    return np.asarray((length - length[0]) / crane.winch.drum_radius)


@dataclass(frozen=True)
class Guess:
    """Starting point of a search, and the family of drives."""

    x: FloatArray
    """Decision variables."""
    scale: FloatArray
    """Change of each variable that moves about one metre of rope."""
    sample: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    """Angle and speed (S,) of a drive at the objective's samples, from its variables (n,)."""
    jacobian: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    """Jacobians (S, n) of angle and speed by the variables."""


def excess(objective: Objective, speed: FloatArray, jacobian: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Excess of a drive over the winch's limits as residuals (2 S,), and their Jacobian (2 S, n).

    Of the sampled ``speed`` (S,) rad/s, whose Jacobian (S, n) is given, and of its change over a control step, from
    rest; in metres and metres a second of rope, times the square root of the control period.
    """
    period, winch = objective.control_period or 0.0, objective.scenario.crane.winch
    change = np.diff(speed, prepend=0.0) / period
    rows = np.concatenate([np.diff(jacobian, axis=0, prepend=0.0) / period, jacobian])
    value = np.concatenate([change, speed])
    most = MARGIN * np.repeat([winch.max_acceleration, winch.max_speed], len(speed))
    scale = winch.drum_radius * math.sqrt(period)
    over = abs(value) - most
    return scale * np.maximum(over, 0.0), scale * np.where(over > 0.0, np.sign(value), 0.0)[:, None] * rows


def within_limits(objective: Objective, guess: Guess) -> Guess:
    """Fit the family to the required angle anew, at a price of what the drives ask beyond the winch's limits."""
    needed, weight = _needed(objective), math.sqrt(objective.control_period or 0.0)
    weight *= objective.scenario.crane.winch.drum_radius

    def both(y: FloatArray) -> tuple[FloatArray, FloatArray]:
        v = guess.x + guess.scale * y
        angle, speed = guess.sample(v)
        angle_rows, speed_rows = guess.jacobian(v)
        over, over_rows = excess(objective, speed, speed_rows)
        residual = np.concatenate([weight * (angle - needed), PRICE * over])
        return residual, np.concatenate([weight * angle_rows, PRICE * over_rows]) * guess.scale

    def residual(y: FloatArray) -> FloatArray:
        return both(y)[0]

    def jacobian(y: FloatArray) -> FloatArray:
        return both(y)[1]

    found = least_squares(residual, np.zeros(len(guess.x)), jac=jacobian, ftol=1e-4, xtol=1e-8, max_nfev=60)
    return replace(guess, x=guess.x + guess.scale * found.x)


def _needed(objective: Objective) -> FloatArray:
    """Required drum angle [rad] at the objective's samples."""
    return np.asarray(np.interp(objective.samples, objective.times, required_angle(objective)))


def spline_guess(objective: Objective, intervals: int, given: FloatArray | None, free_start: bool) -> Guess:
    """Guess of a spline of so many intervals; from ``given`` decision variables, if there are any."""
    angle, speed = spline_matrices(objective.duration, intervals, objective.samples, free_start)
    # Least squares, not mere interpolation: with few intervals the knots share the error.
    x = np.linalg.lstsq(angle, _needed(objective), rcond=None)[0] if given is None else given
    scale = np.full(len(x), 1.0 / objective.scenario.crane.winch.drum_radius)
    return Guess(
        x=np.asarray(x, dtype=np.float64),
        scale=scale,
        sample=lambda v: (angle @ v, speed @ v),
        jacobian=lambda v: (angle, speed),
    )


def harmonic_guess(objective: Objective, harmonics: int, given: FloatArray | None, free_start: bool) -> Guess:
    """Guess of a pseudo-harmonic drive of so many harmonics; from ``given`` decision variables, if there are any."""
    times, skip = objective.samples, int(free_start)
    if given is None:
        fits = _FITS if objective.control_period is None else _FITS_WITHIN_LIMITS
        fitted = _fitted_harmonics(times, _needed(objective), harmonics, fits)
        x = np.array([-start_of_harmonics(fitted), *fitted]) if free_start else fitted
    else:
        x = given
    radius = objective.scenario.crane.winch.drum_radius
    size = np.maximum(np.abs(x[skip::3]), _LEAST_SCALE / radius)
    # A change of one unit of each scaled variable moves about one metre of rope.
    scale = np.full(len(x), 1.0 / radius)
    scale[skip + 1 :: 3] = 2.0 / (size * radius * objective.duration)
    scale[skip + 2 :: 3] = 1.0 / (size * radius)
    step, count = float(times[1]), len(times)

    def sample(v: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle, speed = uniform_harmonic_samples(v[skip:], step, count)
        return (angle + (v[0] + start_of_harmonics(v[1:])), speed) if free_start else (angle, speed)

    def jacobian(v: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle, speed = harmonic_jacobian(v[skip:], times)
        if not free_start:
            return angle, speed
        a, p = v[1::3], v[3::3]
        angle[:, 0::3] += np.sin(p)
        angle[:, 2::3] += a * np.cos(p)
        return np.insert(angle, 0, 1.0, axis=1), np.insert(speed, 0, 0.0, axis=1)

    return Guess(x=x, scale=scale, sample=sample, jacobian=jacobian)


def _fitted_harmonics(times: FloatArray, needed: FloatArray, harmonics: int, fits: int) -> FloatArray:
    """Harmonics taken one by one from the residual's spectrum, all fitted anew after each, in so many steps."""
    taken = slice(None, None, max(1, len(times) // 600))  # enough for waves; the fit stays quick
    t, y = times[taken], needed[taken]

    def residual(v: FloatArray) -> FloatArray:
        return harmonic_samples(v, t)[0] - y

    def jacobian(v: FloatArray) -> FloatArray:
        return harmonic_jacobian(v, t)[0]

    x = np.empty(0)
    for _ in range(harmonics):
        guess = _strongest(t, -residual(x))
        x = least_squares(
            residual,
            np.concatenate([x, guess]),
            jac=jacobian,
            x_scale=np.tile([1.0, 0.1, 1.0], len(x) // 3 + 1),
            max_nfev=fits,
        ).x
    return x


def _strongest(t: FloatArray, signal: FloatArray) -> FloatArray:
    """Amplitude, frequency and phase of the strongest harmonic in a signal, from its zero-padded spectrum."""
    centred = (signal - signal.mean()) * np.hanning(len(t))
    size = 8 * len(t)
    spectrum = np.abs(np.fft.rfft(centred, size))
    frequencies = 2.0 * np.pi * np.fft.rfftfreq(size, t[1] - t[0])
    frequency = float(frequencies[1 + int(np.argmax(spectrum[1:]))])
    basis = np.stack([np.sin(frequency * t), np.cos(frequency * t), np.ones(len(t))], axis=1)
    s, c, _ = np.linalg.lstsq(basis, signal, rcond=None)[0].tolist()
    return np.array([np.hypot(s, c), frequency, np.arctan2(c, s)])
