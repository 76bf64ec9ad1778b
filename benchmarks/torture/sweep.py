"""A sweep of small jobs, to be killed: ``python -m benchmarks.torture.sweep FOLDER [HOST:PORT]``."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from train.shared.job_store import JOBS, JobStore
from train.shared.jobs import Where, run_jobs

COUNT: Final = 60
ATTEMPTS: Final = 20
"""Of each job: more than it can be killed."""


@dataclass(frozen=True)
class Walk:
    """Result of a job."""

    seed: int
    places: npt.NDArray[np.float64]


def walk(seed: int) -> Walk:
    """Walk at random, for some time."""
    rng = np.random.default_rng(seed)
    time.sleep(rng.uniform(0.1, 0.5))
    return Walk(seed, rng.normal(size=1000).cumsum())


def main() -> int:
    """Run the sweep."""
    folder, *address = sys.argv[1:]
    where = Where(cluster=address[0]) if address else Where(workers=2)
    with JobStore(Path(folder) / JOBS, Walk, "1") as store:
        run_jobs(walk, range(COUNT), store=store, where=where, attempts=ATTEMPTS)
    return 0


if __name__ == "__main__":
    # Under its own name: a worker imports what it is given.
    from benchmarks.torture.sweep import main as run

    sys.exit(run())
