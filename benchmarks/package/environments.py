"""The environments as their users step them: scalar, vector over whole episodes with autoreset, memory, cost."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv

import aframe_env
from benchmarks.catalogue import COST_ROWS
from benchmarks.package.dynamics import INNER_STEP, SyntheticMotion, steps
from benchmarks.peers.serve import Measurement, serve, speed

EPISODE = 601
"""Steps of an episode of 60 s, the one that resets included."""
MEMORY_ROWS = 65_536


def vector_env(rows: int, inner_step: float | None, **options: object) -> VectorEnv:
    return gymnasium.make_vec(
        aframe_env.ENV_ID,
        num_envs=rows,
        vectorization_mode="vector_entry_point",
        max_inner_step=inner_step,
        **options,
    )


def scalar(inner_step: float | None) -> Measurement:
    """Steps of drawn scenarios through ``gymnasium.make``, resets included."""
    env = gymnasium.make(aframe_env.ENV_ID, max_inner_step=inner_step)
    env.reset(seed=0)
    action = np.zeros(1, dtype=np.float32)

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return speed(step, 1)


def episodes(rows: int, inner_step: float | None) -> Measurement:
    """Whole episodes of drawn scenarios with autoreset; at least 16,384 of them a sample for few rows' sake."""
    env = vector_env(rows, inner_step)
    env.reset(seed=0)
    actions = np.zeros((rows, 1), dtype=np.float32)
    for _ in range(EPISODE):
        env.step(actions)
    repeats = max(1, 512 // rows)

    def measure() -> float:
        begin = time.perf_counter()
        for _ in range(repeats * EPISODE):
            env.step(actions)
        return repeats * EPISODE * rows / (time.perf_counter() - begin)

    return measure


def within_episode(rows: int) -> Measurement:
    """Steps of whole batches in the midst of an episode; every row has the same scenario, which is quick to set up."""
    env = vector_env(rows, INNER_STEP, episode_duration=1e5, scenario=_scenario())
    env.reset(seed=0)
    actions = np.zeros((rows, 1), dtype=np.float32)
    return speed(lambda: env.step(actions), rows)


def _scenario() -> aframe_env.Scenario:
    return aframe_env.Scenario(motion=SyntheticMotion(), rope_damping=1.5e4)


def resident(field: str) -> int:
    """VmRSS or VmHWM of this process, KiB."""
    with open("/proc/self/status", encoding="ascii") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(field))


def probe_memory() -> None:
    """Print KiB a row at its most and as kept, over a reset, a short episode and its autoreset, drawn seas."""

    def run(rows: int) -> VectorEnv:
        env = vector_env(rows, INNER_STEP, max_episode_steps=2)
        env.reset(seed=0)
        actions = np.zeros((rows, 1), dtype=np.float32)
        for _ in range(4):
            env.step(actions)
        return env

    run(256)
    before = resident("VmRSS")
    env = run(MEMORY_ROWS)
    print((resident("VmHWM") - before) / env.num_envs, (resident("VmRSS") - before) / env.num_envs)


def memory(column: int) -> Measurement:
    def measure() -> float:
        command = [sys.executable, "-m", "benchmarks.package.environments", "--probe-memory"]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return float(done.stdout.split()[column])

    return measure


def main() -> None:
    if sys.argv[1:] == ["--probe-memory"]:
        probe_memory()
        return
    measurements: dict[str, Callable[[], Measurement]] = {
        "scalar": partial(scalar, INNER_STEP),
        "scalar-default": partial(scalar, None),
        "episodes-4096": partial(episodes, 4096, INNER_STEP),
        "episodes-4096-default": partial(episodes, 4096, None),
        "episodes-64": partial(episodes, 64, INNER_STEP),
        "memory-peak": partial(memory, 0),
        "memory-kept": partial(memory, 1),
    }
    for rows in COST_ROWS:
        measurements[f"env-{rows}"] = partial(within_episode, rows)
        measurements[f"engine-{rows}"] = partial(steps, rows, SyntheticMotion())
    serve(measurements)


if __name__ == "__main__":
    main()
