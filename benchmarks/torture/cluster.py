"""A sweep on a Ray cluster whose workers, nodes and driver are killed again and again."""

from __future__ import annotations

import sqlite3
import time
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal

import numpy as np

from benchmarks.torture.local_cluster import LocalCluster, local_cluster
from benchmarks.torture.processes import start
from benchmarks.torture.sweep import COUNT
from benchmarks.torture.trial import Outcome, Trial
from train.shared.job_store import JOBS

_PATIENCE: Final = 300.0
"""Seconds after which a sweep is no longer waited for."""
Row = tuple[str, str, str]
Victim = Literal["worker", "node", "driver"]
WANTED: Final[dict[Victim, int]] = {"worker": 20, "node": 10, "driver": 5}
"""Kills of each."""


@dataclass(frozen=True)
class Killed:
    """A sweep on two nodes of one processor each."""

    victim: Victim

    def attempt(self, rng: np.random.Generator, folder: Path, most: int) -> Outcome:
        """Kill in the middle of jobs, until the sweep ends or so many were killed; hold its rows to the true ones."""
        kills = 0
        with local_cluster(2) as cluster:
            process = self._start(folder, cluster.address)
            while kills < most and self._wait_for_row(process, folder):
                process.join(float(rng.uniform(0.0, 1.0)))
                if not process.is_alive() or not self._kill(process, cluster, rng):
                    continue
                kills += 1
                if self.victim == "driver":
                    process = self._start(folder, cluster.address)
            process.join(_PATIENCE)
            status = process.exitcode
            process.kill()
            process.join()
        tried = max(kills, 1)
        rows = _rows(folder)
        if status == 0 and len(rows) == COUNT and rows == self._truth:
            return Outcome(tried, tried)
        said = (folder / "said").read_text(encoding="utf-8")
        return Outcome(
            tried, 0, failures=(f"exit status {status}, {len(rows & self._truth)} of {COUNT} rows: {said[-1000:]}",)
        )

    def _kill(self, driver: ForkServerProcess, cluster: LocalCluster, rng: np.random.Generator) -> bool:
        """Kill one; return False if there was none at work."""
        working = cluster.working()
        if not working:
            return False
        if self.victim == "worker":
            cluster.kill_worker(int(rng.choice(working)))
        elif self.victim == "node":
            cluster.kill_node(int(rng.integers(len(cluster.nodes))))
            cluster.add_node()
        else:
            driver.kill()
            driver.join()
        return True

    @staticmethod
    def _wait_for_row(process: ForkServerProcess, folder: Path) -> bool:
        """Wait until one job more is finished; return False if the sweep has ended, or nothing comes."""
        end, before = time.monotonic() + _PATIENCE, len(_rows(folder))
        while process.is_alive() and time.monotonic() < end:
            if len(_rows(folder)) > before:
                return True
            process.join(0.05)
        return False

    @cached_property
    def _truth(self) -> set[Row]:
        """Rows of a sweep on this machine that nothing befalls."""
        with TemporaryDirectory(prefix="torture-") as name:
            folder = Path(name)
            self._start(folder).join(_PATIENCE)
            return _rows(folder)

    @staticmethod
    def _start(folder: Path, *address: str) -> ForkServerProcess:
        return start(folder / "said", "benchmarks.torture.sweep", folder, *address)


def _rows(folder: Path) -> set[Row]:
    """Rows of the store."""
    if not (folder / JOBS).exists():
        return set()
    with closing(sqlite3.connect(folder / JOBS, timeout=60.0)) as database:
        if not database.execute("SELECT 1 FROM sqlite_master").fetchall():
            return set()
        return set(database.execute("SELECT key, result, digest FROM results"))


def trials() -> list[Trial]:
    """Kills of workers, of nodes and of the driver."""
    return [
        Trial(
            name=f"cluster, {victim} killed",
            what=f"a sweep of {COUNT} jobs on two nodes, a {victim} killed (−9) in the middle of jobs: its rows are "
            "those of a sweep on one machine that nothing befell, to the bit",
            wanted=count,
            attempt=Killed(victim).attempt,
        )
        for victim, count in WANTED.items()
    ]
