"""Optimised drives: Nelder-Mead on the decision variables (35), (36), from a starting guess that needs no luck.

The guess is the inverse of the model's vertical motion: the rope that a load held at h would need while the pulley
moves. Restarts around the best vertex, with a fresh simplex, take Nelder-Mead out of the stalls it is known for.

Beside it, for Ω1: Gauss-Newton on the depth error at the inner steps. The drive enters the error nearly linearly, so
a few steps do; a Jacobian is the run of one neighbour of the drive for each variable, all side by side.

Under the winch's limits (``control_period``) what is optimised is what is played: a drive is judged by the motion of
the drum that follows it. The guess is then a drive that the winch can follow.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares, minimize

from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue, require_choice, require_integer, require_number
from agents.drives.functions import HarmonicDrive, SplineDrive
from agents.drives.guesses import Guess, excess, harmonic_guess, spline_guess, within_limits
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
_PRICES = (10.0, 3.0, 1.0)  # of the excess over the winch's limits, in the rounds of Gauss-Newton under them


@dataclass(frozen=True, kw_only=True)
class OptimisedDrive:
    """A drive, its objective, and its result on its scenario as it was optimised."""

    drive: SplineDrive | HarmonicDrive
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
    A drum that starts elsewhere than at 0 has lowered or raised the load before the start. No episode of the
    environment begins so: it goes without ``control_period``. Raises InvalidValue for arguments out of range.
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
    guess = (spline_guess if family == "spline" else harmonic_guess)(coarse, number, given, free_start)
    if control_period is not None and given is None:
        guess = within_limits(coarse, guess)
    first = max_evaluations if objective == "omega1" else max(1, max_evaluations // 2)
    search = _Search(coarse, np.random.default_rng(seed), progress)
    if optimiser == "gauss-newton":
        x, search.evaluations = _gauss_newton(coarse, guess, first, progress)
    else:
        x = search.run(guess.x, guess, "omega1", first)
    if objective == "omega2":
        x = search.run(x, guess, "omega2", max_evaluations)
    kind = SplineDrive if family == "spline" else HarmonicDrive
    drive: SplineDrive | HarmonicDrive = kind.from_variables(x, float(duration), free_start)
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


def _gauss_newton(objective: Objective, guess: Guess, budget: int, progress: Progress | None) -> tuple[FloatArray, int]:
    """Variables of least Ω1 found within a budget of evaluations, and how many it took.

    Under the winch's limits it goes in rounds. A drum that cannot follow catches up in leaps, by which no derivative
    finds its way; so what a drive asks beyond the limits has a price, less in each round, and the best drive is kept.
    """
    if objective.control_period is None:
        return _least_squares(objective, guess, budget, 0.0, progress)
    evaluations, best = 1, objective.evaluate(*guess.sample(guess.x)).omega1
    for price in _PRICES:
        x, made = _least_squares(objective, guess, budget // len(_PRICES) - 1, price, None)
        value = objective.evaluate(*guess.sample(x)).omega1
        evaluations += made + 1
        if value < best:
            guess, best = replace(guess, x=x), value
        if progress is not None:
            progress(evaluations, best)
    return guess.x, evaluations


def _least_squares(
    objective: Objective, guess: Guess, budget: int, price: float, progress: Progress | None
) -> tuple[FloatArray, int]:
    """Variables of least Ω1, with a price of the excess over the winch's limits, and the evaluations that it took.

    Gauss-Newton in a trust region. Each neighbour of the drive that gives a column of a Jacobian is an evaluation.
    """
    weight = np.full(objective.steps + 1, math.sqrt(objective.step))
    weight[[0, -1]] *= math.sqrt(0.5)
    size = len(guess.x)
    evaluations, best = 0, math.inf

    def variables(y: FloatArray) -> FloatArray:
        return guess.x + guess.scale * y

    def residual(y: FloatArray) -> FloatArray:
        nonlocal evaluations, best
        evaluations += 1
        v = variables(y)
        angle, speed = guess.sample(v)
        result = weight * np.nan_to_num(objective.errors(angle, speed), nan=_UNUSABLE)
        best = min(best, float(result @ result))
        if progress is not None:
            progress(evaluations, best)
        if not price:
            return np.asarray(result)
        return np.concatenate([result, price * excess(objective, speed, guess.jacobian(v)[1])[0]])

    def jacobian(y: FloatArray) -> FloatArray:
        nonlocal evaluations
        evaluations += size
        v = variables(y)
        angle, speed = guess.sample(v)
        rows = guess.jacobian(v)
        more = [_NEIGHBOUR * guess.scale * each for each in rows]
        perturbed = objective.perturbed_errors(angle, speed, *more)
        result = weight[:, None] * (perturbed - objective.errors(angle, speed)[:, None]) / _NEIGHBOUR
        if not price:
            return np.asarray(result)
        return np.concatenate([result, price * guess.scale * excess(objective, speed, rows[1])[1]])

    found = least_squares(
        residual,
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

    def run(self, x: FloatArray, guess: Guess, name: ObjectiveName, until: int) -> FloatArray:
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
