"""Evaluations of Ω1 over 36 s of the paper's case, and the time of the whole table of ``train.drives``."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from agents.drives.functions import spline_matrices
from agents.drives.guesses import required_angle
from agents.drives.objectives import Objective, coarse_step
from benchmarks.peers.serve import Measurement, serve, speed
from train.drives.experiment import paper_case

FloatArray = npt.NDArray[np.float64]

DURATION: Final = 36.0
INTERVALS: Final = 18
FINE: Final = 0.002
"""Inner step of the exact Ω1, s."""
LANES: Final = 64


@cache
def objective() -> Objective:
    """Objective with the coarse step of the optimisers."""
    scenario = paper_case()
    return Objective(scenario, DURATION, coarse_step(scenario))


@cache
def finest() -> Objective:
    """Objective with a fine step, for the exact Ω1."""
    return Objective(paper_case(), DURATION, FINE)


def following(objective: Objective) -> tuple[FloatArray, FloatArray]:
    """Angle and speed at the objective's times of a spline that follows the motion and leaves little of it."""
    matrix = spline_matrices(DURATION, INTERVALS, finest().times)[0]
    knots = np.linalg.lstsq(matrix, required_angle(finest()), rcond=None)[0]
    angle, rate = spline_matrices(DURATION, INTERVALS, objective.times)
    return angle @ knots, rate @ knots


def microseconds(call: Callable[[], object], work: int) -> Measurement:
    evaluations_a_second = speed(call, work)
    return lambda: 1e6 / evaluations_a_second()


def alone() -> Measurement:
    """Microseconds of one evaluation."""
    angle, rate = following(objective())
    return microseconds(lambda: objective().evaluate(angle, rate), 1)


def filled() -> Measurement:
    """Microseconds of each evaluation, as many neighbours of a drive together as a block has lanes."""
    angle, rate = following(objective())
    none = np.zeros((len(angle), LANES))

    def together() -> FloatArray:
        errors = objective().perturbed_errors(angle, rate, none, none)
        return np.trapezoid(errors**2, dx=objective().step, axis=0)

    return microseconds(together, LANES)


def error() -> Measurement:
    """Relative error of Ω1 at that inner step: the greater of a drum at rest's and of a drive's."""

    def measure() -> float:
        pairs = [
            (objective().still(), finest().still()),
            (objective().evaluate(*following(objective())), finest().evaluate(*following(finest()))),
        ]
        return max(abs(found.omega1 / exact.omega1 - 1.0) for found, exact in pairs)

    return measure


def table() -> Measurement:
    """Seconds of the whole command, from the shell and back."""

    def measure() -> float:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "train.drives", "--case", "paper", "--out", str(Path(folder) / "out")]
            begin = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            return time.perf_counter() - begin

    return measure


if __name__ == "__main__":
    serve({"omega1-alone": alone, "omega1-filled": filled, "omega1-error": error, "paper-table": table})
