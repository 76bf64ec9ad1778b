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

from agents.drives import spline_matrices
from agents.objectives import Objective
from agents.optimisation import required_angle
from benchmarks.peers.serve import Measurement, serve, speed
from train.drives import paper_case

FloatArray = npt.NDArray[np.float64]

DURATION: Final = 36.0
INTERVALS: Final = 18
RIGHT_TO: Final = 1e-4
"""Relative error of Ω1 that an inner step may make."""
STEPS: Final = (0.2, 0.15, 0.12, 0.1, 0.09, 0.08, 0.075, 0.06, 0.05, 0.04, 0.03, 0.02, 0.01)
FINE: Final = 0.002
LANES: Final = 64


def drives(objective: Objective, finest: Objective) -> list[tuple[FloatArray, FloatArray]]:
    """Angle and speed at the objective's times of the drum at rest and of a spline that follows the motion."""
    still = np.zeros(len(objective.times))
    knots = np.linalg.lstsq(spline_matrices(DURATION, INTERVALS, finest.times)[0], required_angle(finest), rcond=None)[
        0
    ]
    angle, speed_ = spline_matrices(DURATION, INTERVALS, objective.times)
    return [(still, still), (angle @ knots, speed_ @ knots)]


@cache
def objective() -> Objective:
    """With the largest of STEPS that keeps Ω1 right for the drum at rest and for a drive that leaves little of it."""
    scenario = paper_case()
    finest = Objective(scenario, DURATION, FINE)
    exact = [finest.evaluate(*drive).omega1 for drive in drives(finest, finest)]
    for step in STEPS:
        tried = Objective(scenario, DURATION, step)
        found = [tried.evaluate(*drive).omega1 for drive in drives(tried, finest)]
        if np.allclose(found, exact, rtol=RIGHT_TO, atol=0.0):
            return tried
    raise RuntimeError(f"no inner step of {STEPS} s keeps Ω1 right to {RIGHT_TO:g}")


def microseconds(call: Callable[[], object], work: int) -> Measurement:
    evaluations_a_second = speed(call, work)
    return lambda: 1e6 / evaluations_a_second()


def alone() -> Measurement:
    """Microseconds of one evaluation."""
    o = objective()
    angle, rate = drives(o, Objective(o.scenario, DURATION, FINE))[1]
    return microseconds(lambda: o.evaluate(angle, rate), 1)


def filled() -> Measurement:
    """Microseconds of each evaluation when as many drives as a block has lanes are evaluated together."""
    o = objective()
    together: Callable[..., object] | None = getattr(o, "evaluate_many", None)
    if together is None:
        raise NotImplementedError("agents.objectives evaluates one drive at a time")
    angle, rate = drives(o, Objective(o.scenario, DURATION, FINE))[1]
    angles, rates = np.tile(angle, (LANES, 1)), np.tile(rate, (LANES, 1))
    return microseconds(lambda: together(angles, rates), LANES)


def step() -> Measurement:
    """The inner step of the two above, ms."""
    return lambda: 1e3 * objective().step


def table() -> Measurement:
    """Seconds of the whole command, from the shell and back."""

    def measure() -> float:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "train.drives", "--case", "paper", "--out", str(Path(folder) / "out")]
            begin = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            return time.perf_counter() - begin

    measure()
    return measure


if __name__ == "__main__":
    serve({"omega1-alone": alone, "omega1-filled": filled, "omega1-step": step, "paper-table": table})
