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


Caches = dict[str, "tempfile.TemporaryDirectory[str]"]
"""Compile caches, by what was made with them."""


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


def cold(make: str, caches: Caches) -> Measurement:
    """Measure a start with nothing compiled yet; the cache that it fills stays for the warm starts."""

    def measure() -> float:
        caches[make] = tempfile.TemporaryDirectory()
        return probe(make, caches[make].name)[1]

    return measure


def warm(make: str, caches: Caches, column: int) -> Measurement:
    """Measure a start from the cache of the cold start before it."""
    if make not in caches:
        cold(make, caches)()

    def measure() -> float:
        return probe(make, caches[make].name)[column]

    return measure


def main() -> None:
    caches: Caches = {}
    serve(
        {
            "cold": partial(cold, "scalar", caches),
            "cold-vector": partial(cold, "vector", caches),
            "import": partial(warm, "scalar", caches, 0),
            "warm": partial(warm, "scalar", caches, 1),
            "warm-vector": partial(warm, "vector", caches, 1),
        }
    )


if __name__ == "__main__":
    main()
