"""Speed and error of the full model for many rows, ratios to real time and to its stand-alone runs, in one run.

``python -m benchmarks.rfem --out results/benchmark-rfem.json``; set NUMBA_NUM_THREADS=1 for figures of one core.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import gymnasium
import numba
import numpy as np
import numpy.typing as npt

import aframe_env
from aframe_env import InvalidValue, Scenario
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible.readout import FEET, UTILISATION
from aframe_env.flexible_engine import FRAME_DIVISION, FRAME_MODES, FlexibleEngine, Mesh
from aframe_env.rfem.simulate import DynamicCase, simulate
from aframe_env.rfem.structure import Division
from train.shared.run_folder import versions, write_json

FloatArray = npt.NDArray[np.float64]

ROUNDS = 7
ROWS = 2048
PERIOD = 0.1
DURATION = 60.0
FINE = 6.25e-4
"""Step of the solution that errors refer to, s."""


def trajectory(scenario: Scenario, mesh: Mesh, step: float | None = None) -> tuple[FloatArray, FloatArray]:
    """x_L3 (k,) and reactions and servomotor tensions (k, 8) every PERIOD."""
    engine = FlexibleEngine(1, PERIOD, mesh, max_inner_step=step)
    engine.reset_row(0, scenario)
    heights, forces = [], []
    for _ in range(round(DURATION / PERIOD)):
        engine.step(np.zeros(1))
        heights.append(engine.read(at.LOAD_POSITION + 2)[0])
        forces.append(engine.read_frames()[0, FEET:UTILISATION])
    return np.array(heights), np.array(forces)


def real_time(mesh: Mesh, rows: int, step: float | None = None) -> float:
    """Simulated seconds (of all rows together) a second, on the calling thread alone; best of ROUNDS."""
    engine = FlexibleEngine(rows, PERIOD, mesh, max_inner_step=step)
    for row in range(rows):
        engine.reset_row(row, Scenario.paper(initial="rest"))
    commands = np.zeros(rows)
    engine.step(commands)
    best, count = np.inf, round(DURATION / PERIOD) // rows + 10
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        for _ in range(count):
            engine.step(commands)
        best = min(best, time.perf_counter() - begin)
    return rows * count * PERIOD / best


def full_chain() -> dict[str, Any]:
    """10 rfes a leg and 8 in the beam, all modes; load starting at rest."""
    mesh, scenario = Mesh(Division()), Scenario.paper(initial="rest")
    fine, _ = trajectory(scenario, mesh, FINE)
    steps = {
        f"{1e3 * step:g} ms": {
            "x_real_time": real_time(mesh, 1, step),
            "error_of_x_L3_mm": 1e3 * float(np.abs(trajectory(scenario, mesh, step)[0] - fine).max()),
        }
        for step in (0.025, 0.0125, 0.01, 0.005)
    }
    begin = time.perf_counter()
    simulate(DynamicCase(scenario=scenario, step=0.0125, duration=6.0))
    alone = 6.0 / (time.perf_counter() - begin)
    return {
        "one_row": steps,
        "block_of_64_rows_x_real_time": real_time(mesh, 64),
        "one_row_over_stand_alone_run": steps["12.5 ms"]["x_real_time"] / alone,
        "bar": "at least 2,000 x real time on one core within 1 mm",
    }


def reduced() -> dict[str, Any]:
    """Few modes beside the static shapes, against 60 of them, in the first seas that the environment draws."""
    result: dict[str, Any] = {}
    rng = np.random.default_rng(0)
    scenarios = [aframe_env.ScenarioDistribution().draw(rng) for _ in range(5)]
    full = [trajectory(scenario, Mesh(FRAME_DIVISION, 60)) for scenario in scenarios]
    for modes in (5, 10, FRAME_MODES):
        few = [trajectory(scenario, Mesh(FRAME_DIVISION, modes)) for scenario in scenarios]
        result[f"rfem_modes = {modes}"] = {
            "env_steps_per_second": env_speed(modes),
            "error_of_x_L3": max(
                float(np.abs(a[0] - b[0]).max() / np.ptp(a[0])) for a, b in zip(full, few, strict=True)
            ),
            "error_of_reactions": max(
                float(np.max(np.abs(a[1] - b[1]).max(axis=0) / np.ptp(a[1], axis=0)))
                for a, b in zip(full, few, strict=True)
            ),
        }
    return result | {
        "bar": "at least 100,000 env steps/s on two cores; 0.1 % of x_L3, 1 % of reactions (of their range)"
    }


def env_speed(modes: int | None) -> float:
    """Row steps a second of the vector environment over whole episodes with autoreset."""
    env = gymnasium.make_vec(
        aframe_env.ENV_ID, num_envs=ROWS, vectorization_mode="vector_entry_point", model="rfem", rfem_modes=modes
    )
    env.reset(seed=0)
    actions = np.zeros((ROWS, 1), dtype=np.float32)
    env.step(actions)
    begin = time.perf_counter()
    for _ in range(601):
        env.step(actions)
    return ROWS * 601 / (time.perf_counter() - begin)


def linear() -> dict[str, Any]:
    """Cost against the number of rfes, all modes: microseconds of one row's control step, and a row in a block."""
    result: dict[str, Any] = {}
    for leg, beam in ((4, 4), (8, 8), (16, 16), (32, 32)):
        mesh = Mesh(Division(leg=leg, beam=beam))
        result[str(2 * leg + beam)] = {
            "one_row_us": 1e6 * PERIOD / real_time(mesh, 1),
            "row_of_64_us": 1e6 * PERIOD / real_time(mesh, 64),
        }
    return result


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/benchmark-rfem.json"))
    arguments = parser.parse_args()
    if arguments.out.is_dir():
        raise InvalidValue(f"out = {arguments.out}: is a folder, must be a file")
    result = {
        "what": "paper's case and drawn seas on the reference crane; control step 0.1 s",
        "threads": numba.get_num_threads(),
        "full_chain": full_chain(),
        "reduced": reduced(),
        "control_step_by_number_of_rfes": linear(),
        "versions": versions(),
    }
    write_json(arguments.out, result)
    print(arguments.out.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
