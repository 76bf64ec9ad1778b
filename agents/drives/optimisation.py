"""Optimised drives: Nelder-Mead on the decision variables (35), (36), from a starting guess that needs no luck.

The guess is the inverse of the model's vertical motion: the rope that a load held at h would need while the pulley
moves. Restarts around the best vertex, with a fresh simplex, take Nelder-Mead out of the stalls it is known for.

Beside it, for Ω1: Gauss-Newton on the depth error at the inner steps. The drive enters the error nearly linearly, so
a few steps do; a Jacobian is the run of one neighbour of the drive for each variable, all side by side.

Under the winch's limits (``control_period``) what is optimised is what is played: a drive is judged by the motion of the
drum that follows it. The guess is then fitted to what the winch makes of the inverse, which it can follow.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, minimize

from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue, require_choice, require_integer, require_number
from agents.drives.functions import (
    Drive,
    HarmonicDrive,
    SplineDrive,
    harmonic_jacobian,
    harmonic_samples,
    spline_matrices,
    start_of_harmonics,
    uniform_harmonic_samples,
)
from agents.drives.objectives import FINE_STEP, Objective, Outcome, coarse_step

FloatArray = npt.NDArray[np.float64]
Family = Literal["spline", "harmonic"]
ObjectiveName = Literal["omega1", "omega2"]
Optimiser = Literal["nelder-mead", "gauss-newton"]
FAMILIES: Final[tuple[Family, ...]] = ("spline", "harmonic")
OBJECTIVES: Final[tuple[ObjectiveName, ...]] = ("omega1", "omega2")
OPTIMISERS: Final[tuple[Optimiser, ...]] = ("nelder-mead", "gauss-newton")
Progress = Callable[[int, float], object]
"""Called with the number of evaluations so far and the best value of the objective."""

_IMPROVEMENT = 2e-3  # a round of Nelder-Mead that gains less than this share ends the search
_NEIGHBOUR = 1e-4  # m of rope between a drive and the neighbours that give its Jacobian
_TOLERANCE = 1e-6  # a Gauss-Newton step that gains less than this share of Ω1 is the last one
_UNUSABLE = 1e6  # m: stands for an error that is not a number
_LEAST_SCALE = 0.02  # m of rope: a harmonic smaller than this is scaled as if it were this large


@dataclass(frozen=True, kw_only=True)
class OptimisedDrive:
    """A drive, its objective, and its result on its scenario (as it was optimised: under the winch's limits, or not)."""

    drive: Drive
    family: str
    """"spline" or "harmonic"."""
    objective: str
    """"omega1" or "omega2"."""
    omega1: float
    """Ω1, m² s."""
    omega2: float
    """Ω2, m."""
    rms: float
    """m."""
    amplitude: float
    """Greatest distance of the load from its required level, m (equal to Ω2 by its definition)."""
    evaluations: int
    """Number of evaluations of an objective while searching, a start from the Ω1 optimum included."""
    seconds: float
    """Wall-clock time of the search."""


def required_angle(objective: Objective) -> FloatArray:
    """Drum angle [rad] at the objective's times that would hold the load at h right below where the ship rests.

    The rope's law solved for the unstretched length at a tension equal to the weight: what remains to be found by
    optimisation is the pendulum's share, the start's transient, and the part that the family of drives cannot follow.
    """
    scenario = objective.scenario
    crane = scenario.crane
    load = np.array([*crane.pulley_position[:2], scenario.target_level])
    distance = np.linalg.norm(objective.path[:, :3] - load, axis=1)
    length = (distance + crane.drum_to_pulley) / (1.0 + scenario.weight / crane.rope.axial_stiffness)
    return np.asarray((length - length[0]) / crane.winch.drum_radius)


def optimise(
    family: Family,
    scenario: Scenario,
    objective: ObjectiveName = "omega1",
    duration: float = 60.0,
    intervals: int = 48,
    harmonics: int = 8,
    seed: int = 0,
    max_evaluations: int = 6_000,
    progress: Progress | None = None,
    *,
    optimiser: Optimiser = "nelder-mead",
    start: npt.ArrayLike | None = None,
    control_period: float | None = None,
    free_start: bool = False,
) -> OptimisedDrive:
    """Find the drive of a family that makes an objective least on a scenario whose future is known.

    ``duration`` is t_k [s]; ``intervals`` (of a spline) is in [3, 500], ``harmonics`` in [1, 64]. The same
    arguments give the same drive; ``seed`` turns the simplexes of the restarts. The search for Ω2 starts from the
    optimum of Ω1, which ``optimiser`` finds; it is itself always Nelder-Mead's, for Ω2 is no sum of squares.
    ``start`` gives decision variables to start from, such as those of a like scenario's drive; their number is then
    ``intervals``, or 3 ``harmonics``. With a ``control_period`` [s] drives are optimised under the winch's limits, as
    ``DrivePolicy`` plays them at that control step; without, the drum follows them exactly, as in the paper.

    ``free_start`` makes φ_H⁰ and A_0 decision variables, as in the paper's (35) and (36); there is one more, the first.
    A drum that starts elsewhere than at 0 has lowered or raised the load before the start. No episode of the environment
    begins so: it goes without ``control_period``. Raises InvalidValue for arguments out of range.
    """
    require_choice("family", family, FAMILIES)
    require_choice("objective", objective, OBJECTIVES)
    require_number("duration", duration, "s", low=0.1, high=3600.0)
    require_integer("intervals", intervals, low=3, high=500)
    require_integer("harmonics", harmonics, low=1, high=64)
    require_integer("seed", seed, low=0, high=2**32 - 1)
    require_integer("max_evaluations", max_evaluations, low=1, high=10**9)
    require_choice("optimiser", optimiser, OPTIMISERS)
    if free_start and control_period is not None:
        raise InvalidValue("free_start, control_period: give one of the two: an episode begins with the drum at 0")
    size = (intervals if family == "spline" else 3 * harmonics) + int(free_start)
    given = None if start is None else np.asarray(start, dtype=np.float64)
    if given is not None and (given.shape != (size,) or not np.isfinite(given).all()):
        raise InvalidValue(f"start of shape {given.shape}: must be {size} finite decision variables")
    begin = time.perf_counter()
    coarse = Objective(scenario, duration, coarse_step(scenario), control_period)
    number = intervals if family == "spline" else harmonics
    guess = (_spline_guess if family == "spline" else _harmonic_guess)(coarse, number, given, free_start)
    first = max_evaluations if objective == "omega1" else max(1, max_evaluations // 2)
    search = _Search(coarse, np.random.default_rng(seed), progress)
    if optimiser == "gauss-newton":
        x, search.evaluations = _gauss_newton(coarse, guess, first, progress)
    else:
        x = search.run(guess.x, guess, "omega1", first)
    if objective == "omega2":
        x = search.run(x, guess, "omega2", max_evaluations)
    kind = SplineDrive if family == "spline" else HarmonicDrive
    drive: Drive = kind.from_variables(x, float(duration), free_start)
    seconds = time.perf_counter() - begin
    outcome = Objective(scenario, duration, min(FINE_STEP, coarse.step), control_period).drive(drive)
    return OptimisedDrive(
        drive=drive,
        family=family,
        objective=objective,
        omega1=outcome.omega1,
        omega2=outcome.omega2,
        rms=outcome.rms,
        amplitude=outcome.amplitude,
        evaluations=search.evaluations,
        seconds=seconds,
    )


@dataclass(frozen=True)
class _Guess:
    """Starting point of a search, and the family of drives."""

    x: FloatArray
    """Decision variables."""
    scale: FloatArray
    """Change of each variable that moves about one metre of rope."""
    sample: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    """Angle and speed (S,) of a drive at the objective's samples, from its variables (n,)."""
    jacobian: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    """Jacobians (S, n) of angle and speed by the variables."""


def _wanted(objective: Objective) -> FloatArray:
    """Drum angle [rad] at the objective's samples that a guess is fitted to: the required one, as the drum follows it."""
    if objective.control_period is None:
        return required_angle(objective)
    stride = (len(objective.times) - 1) // (len(objective.samples) - 1)
    needed = required_angle(objective)[::stride]
    return objective.drum(needed, np.gradient(needed, objective.samples))[0][::stride]


def _spline_guess(objective: Objective, intervals: int, given: FloatArray | None, free_start: bool) -> _Guess:
    angle, speed = spline_matrices(objective.duration, intervals, objective.samples, free_start)
    # Least squares, not mere interpolation: with few intervals the knots share the error.
    x = np.linalg.lstsq(angle, _wanted(objective), rcond=None)[0] if given is None else given
    scale = np.full(len(x), 1.0 / objective.scenario.crane.winch.drum_radius)
    return _Guess(
        x=np.asarray(x, dtype=np.float64),
        scale=scale,
        sample=lambda v: (angle @ v, speed @ v),
        jacobian=lambda v: (angle, speed),
    )


def _harmonic_guess(objective: Objective, harmonics: int, given: FloatArray | None, free_start: bool) -> _Guess:
    times, skip = objective.samples, int(free_start)
    if given is None:
        fitted = _fitted_harmonics(times, _wanted(objective), harmonics)
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

    return _Guess(x=x, scale=scale, sample=sample, jacobian=jacobian)


def _fitted_harmonics(times: FloatArray, needed: FloatArray, harmonics: int) -> FloatArray:
    """Harmonics taken one by one from the residual's spectrum, all fitted anew after each."""
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
            max_nfev=60,
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


def _gauss_newton(
    objective: Objective, guess: _Guess, budget: int, progress: Progress | None
) -> tuple[FloatArray, int]:
    """Variables of least Ω1 found within a budget of evaluations, and how many it took.

    Gauss-Newton in a trust region. Each neighbour of the drive that gives a column of a Jacobian is an evaluation.
    """
    weight = np.full(objective.steps + 1, math.sqrt(objective.step))
    weight[[0, -1]] *= math.sqrt(0.5)
    size = len(guess.x)
    evaluations, best = 0, math.inf

    def variables(y: FloatArray) -> FloatArray:
        return guess.x + guess.scale * y

    def error(y: FloatArray) -> FloatArray:
        nonlocal evaluations, best
        evaluations += 1
        result = weight * np.nan_to_num(objective.errors(*guess.sample(variables(y))), nan=_UNUSABLE)
        best = min(best, float(result @ result))
        if progress is not None:
            progress(evaluations, best)
        return np.asarray(result)

    def jacobian(y: FloatArray) -> FloatArray:
        nonlocal evaluations
        evaluations += size
        angle, speed = guess.sample(variables(y))
        more = [_NEIGHBOUR * guess.scale * each for each in guess.jacobian(variables(y))]
        perturbed = objective.perturbed_errors(angle, speed, *more)
        return np.asarray(weight[:, None] * (perturbed - objective.errors(angle, speed)[:, None]) / _NEIGHBOUR)

    found = least_squares(
        error,
        np.zeros(size),
        jac=jacobian,
        ftol=_TOLERANCE,
        xtol=1e-10,
        gtol=None,
        max_nfev=max(1, budget // (size + 1)),
    )
    return variables(found.x), evaluations


class _Search:
    """Nelder-Mead with restarts, counting its evaluations."""

    def __init__(self, objective: Objective, rng: np.random.Generator, progress: Progress | None) -> None:
        self.objective = objective
        self.evaluations = 0
        self._rng = rng
        self._progress = progress

    def run(self, x: FloatArray, guess: _Guess, name: ObjectiveName, until: int) -> FloatArray:
        """Best variables found from ``x`` before ``until`` evaluations; one unit of scale is a metre of rope."""
        centre, scale, sample = x, guess.scale, guess.sample
        size = len(x)
        best_y = np.zeros(size)
        best = np.inf
        last: Outcome | None = None

        def value(y: FloatArray) -> float:
            nonlocal best, best_y, last
            if self.evaluations >= until:
                return np.inf
            self.evaluations += 1
            outcome = self.objective.evaluate(*sample(centre + scale * y))
            result = outcome.omega1 if name == "omega1" else outcome.omega2
            if result < best:
                best, best_y, last = result, y.copy(), outcome
            if self._progress is not None and self.evaluations % 100 == 0:
                self._progress(self.evaluations, best)
            return result if np.isfinite(result) else np.inf

        value(best_y)
        turn = np.eye(size)
        while self.evaluations < until and last is not None:
            before = best
            # A simplex of the size of what is still wrong: larger only throws the load about.
            edge = 0.5 * last.rms
            simplex = np.concatenate([best_y[None], best_y + edge * turn])
            minimize(
                value,
                best_y,
                method="Nelder-Mead",
                options={
                    "initial_simplex": simplex,
                    "adaptive": True,
                    "maxfev": until - self.evaluations,
                    "maxiter": 10**9,
                    "xatol": 1e-3 * edge,
                    "fatol": 1e-4 * best,
                },
            )
            if best > (1.0 - _IMPROVEMENT) * before:
                break
            turn = np.linalg.qr(self._rng.standard_normal((size, size)))[0]
        if self._progress is not None:
            self._progress(self.evaluations, best)
        return np.asarray(centre + scale * best_y)
