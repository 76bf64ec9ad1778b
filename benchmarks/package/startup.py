"""Start-up, each figure from a fresh interpreter: import, first reset from a warm cache, cold compile."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from functools import partial

from benchmarks.peers.serve import Measurement, serve

PROBE = """
import sys, time
begin = time.perf_counter()
import gymnasium, aframe_env
print(time.perf_counter() - begin)
if "torch" in sys.modules:
    sys.exit("import aframe_env imports torch")
begin = time.perf_counter()
{make}.reset(seed=0)
print(time.perf_counter() - begin)
"""
MAKE = {
    "scalar": "gymnasium.make(aframe_env.ENV_ID)",
    "vector": "gymnasium.make_vec(aframe_env.ENV_ID, num_envs=256, vectorization_mode='vector_entry_point')",
}


def probe(make: str, cache: str) -> list[float]:
    """Seconds of ``import gymnasium, aframe_env`` and from making an environment to the end of its first reset."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE.format(make=MAKE[make])],
        env={**os.environ, "NUMBA_CACHE_DIR": cache},
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    return [float(line) for line in done.stdout.split()]


def warm(make: str, column: int) -> Measurement:
    """From a compiled cache of the measurement's own."""
    cache = tempfile.TemporaryDirectory()
    probe(make, cache.name)

    def measure() -> float:
        return probe(make, cache.name)[column]

    return measure


def cold(make: str) -> Measurement:
    """With nothing compiled yet."""

    def measure() -> float:
        with tempfile.TemporaryDirectory() as cache:
            return probe(make, cache)[1]

    return measure


if __name__ == "__main__":
    serve(
        {
            "import": partial(warm, "scalar", 0),
            "warm": partial(warm, "scalar", 1),
            "warm-vector": partial(warm, "vector", 1),
            "cold": partial(cold, "scalar"),
            "cold-vector": partial(cold, "vector"),
        }
    )
