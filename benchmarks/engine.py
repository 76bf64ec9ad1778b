"""Speed of the environment as ratios to Gymnasium's Pendulum-v1, measured in turn in one run.

``python -m benchmarks.engine --out results/benchmark-engine.json``
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import aframe_env
from aframe_env import InvalidValue
from train.output import versions, write_json

ROUNDS = 9
ROWS = 4096


def seconds_a_step(step: Callable[[], Any], steps: int) -> float:
    """Seconds that one of ``steps`` calls takes."""
    begin = time.perf_counter()
    for _ in range(steps):
        step()
    return (time.perf_counter() - begin) / steps


def scalar(env_id: str) -> Callable[[], float]:
    """Seconds a step of a scalar environment, resets left out."""
    env = gymnasium.make(env_id)
    action = np.zeros(1, dtype=np.float32)

    def measure() -> float:
        env.reset(seed=0)
        return seconds_a_step(lambda: env.step(action), 190)

    measure()
    return measure


def vector() -> Callable[[], float]:
    """Seconds a row's step of the native vector environment, over whole episodes with autoreset."""
    env = gymnasium.make_vec(aframe_env.ENV_ID, num_envs=ROWS, vectorization_mode="vector_entry_point")
    env.reset(seed=0)
    actions = np.zeros((ROWS, 1), dtype=np.float32)
    env.step(actions)

    def measure() -> float:
        return seconds_a_step(lambda: env.step(actions), 601) / ROWS

    return measure


def main() -> None:
    """Measure in turn, print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("results/benchmark-engine.json"))
    arguments = parser.parse_args()
    if arguments.out.is_dir():
        raise InvalidValue(f"out = {arguments.out}: is a folder, must be a file")
    measures = {"pendulum": scalar("Pendulum-v1"), "scalar": scalar(aframe_env.ENV_ID), "vector": vector()}
    samples: dict[str, list[float]] = {name: [] for name in measures}
    for _ in range(ROUNDS):
        for name, measure in measures.items():
            samples[name].append(measure())
    ratios = [a / b for a, b in zip(samples["scalar"], samples["pendulum"], strict=True)]
    result = {
        "what": "medians of rounds in turn; scalar environments through gymnasium.make, vector over whole episodes "
        "with autoreset (control step 0.1 s, 32 wave components, inner step at most 0.02 s)",
        "scalar_over_pendulum": {
            "median": statistics.median(ratios),
            "min": min(ratios),
            "max": max(ratios),
            "bar": "at most 1",
        },
        "scalar_us": {name: 1e6 * statistics.median(samples[name]) for name in ("scalar", "pendulum")},
        "vector_steps_per_second": {
            "rows": ROWS,
            "median": 1.0 / statistics.median(samples["vector"]),
            "min": 1.0 / max(samples["vector"]),
            "max": 1.0 / min(samples["vector"]),
            "bar": "at least 1,000,000 on two cores",
        },
        "versions": versions(),
    }
    write_json(arguments.out, result)
    print(arguments.out.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
