"""A study on a Ray cluster whose workers, nodes and driver are killed again and again."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal

import numpy as np

from agents.drives.map import ARRAYS
from benchmarks.torture.local_cluster import LocalCluster, local_cluster
from benchmarks.torture.processes import start
from benchmarks.torture.trial import Outcome, Trial

_STUDY: Final = "--amplitudes 0.5 1 2 --periods 8 9 10 --masses 4e4 5e4 --lengths 200 300 --held-out 2 --scenarios 2"
"""Some fifty jobs."""
_PATIENCE: Final = 300.0
"""Seconds after which a study is no longer waited for."""
Victim = Literal["worker", "node", "driver"]
WANTED: Final[dict[Victim, int]] = {"worker": 20, "node": 10, "driver": 5}
"""Kills of each."""


@dataclass(frozen=True)
class Killed:
    """``train.drive_map`` on two nodes of one processor each."""

    victim: Victim

    def attempt(self, rng: np.random.Generator, folder: Path, most: int) -> Outcome:
        """Kill in the middle of jobs, until the study ends or so many were killed; hold its map to the true one."""
        kills = 0
        with local_cluster(2) as cluster:
            options = ("--cluster", cluster.address)
            process = self._start(folder, *options)
            while kills < most and self._wait_for_work(process, cluster):
                process.join(float(rng.uniform(0.0, 1.0)))
                if not process.is_alive() or not self._kill(process, cluster, rng):
                    continue
                kills += 1
                if self.victim == "driver":
                    process = self._start(folder, *options)
            process.join(_PATIENCE)
            status = process.exitcode
            process.kill()
            process.join()
        tried = max(kills, 1)
        if status == 0 and _results(folder) == self._results:
            return Outcome(tried, tried)
        said = (folder / "said").read_text(encoding="utf-8")
        return Outcome(tried, 0, failures=(f"exit status {status}, or another map: {said[-1000:]}",))

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
    def _wait_for_work(process: ForkServerProcess, cluster: LocalCluster) -> bool:
        """Wait until a worker is at a job; return False if the study has ended, or nothing comes."""
        end = time.monotonic() + _PATIENCE
        while process.is_alive() and time.monotonic() < end:
            if cluster.working():
                return True
            process.join(0.05)
        return False

    @cached_property
    def _results(self) -> list[bytes]:
        """Of a study on this machine that nothing befalls."""
        with TemporaryDirectory(prefix="torture-") as name:
            folder = Path(name)
            process = self._start(folder, "--workers", 1)
            process.join(_PATIENCE)
            return _results(folder)

    @staticmethod
    def _start(folder: Path, *options: object) -> ForkServerProcess:
        places = ("--store", folder / "jobs.sqlite", "--out", folder / "run")
        return start(folder / "said", "train.drive_map", *_STUDY.split(), *places, *options)


def _results(folder: Path) -> list[bytes]:
    return [(folder / "run" / name).read_bytes() for name in (ARRAYS, "held_out.json")]


def trials() -> list[Trial]:
    """Kills of workers, of nodes and of the driver."""
    return [
        Trial(
            name=f"cluster, {victim} killed",
            what=f"`train.drive_map --cluster` on two nodes, a {victim} killed (−9) in the middle of jobs: the map is "
            "that of a study on one machine that nothing befell, to the bit",
            wanted=count,
            attempt=Killed(victim).attempt,
        )
        for victim, count in WANTED.items()
    ]
