"""Jobs on a Ray cluster of several raylets on this machine, some of which are killed."""

from __future__ import annotations

import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from aframe_env import InvalidValue
from benchmarks.torture.local_cluster import LocalCluster, local_cluster
from train.shared import cluster as backend
from train.shared.job_store import JobStore
from train.shared.jobs import JobsFailed, Where, run_jobs
from train.shared.local_workers import WorkerDied

ray: Any = pytest.importorskip("ray", reason="needs the extra cluster")


@dataclass(frozen=True)
class Wave:
    number: int
    heave: npt.NDArray[np.float64]
    threads: str


def wave(number: int) -> Wave:
    return Wave(number, np.sin(np.random.default_rng(number).normal(size=100)), os.environ["NUMBA_NUM_THREADS"])


def refuses(number: int) -> int:
    if number % 2:
        raise ValueError(f"{number} is odd")
    return number


def dies(job: tuple[int, str]) -> int:
    """Job 0 kills its worker once, job 1 always."""
    number, folder = job
    marker = Path(folder) / f"{number}"
    if number == 1 or (number == 0 and not marker.exists()):
        with marker.open("a") as log:
            log.write("x")
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def timed(folder: str) -> int:
    with (Path(folder) / f"{os.getpid()}").open("a") as log:
        begin = time.monotonic()
        time.sleep(0.1)
        log.write(f"{begin} {time.monotonic()}\n")
    return 0


def waits(job: tuple[int, str]) -> int:
    number, folder = job
    (Path(folder) / f"begun-{number}-{time.monotonic_ns()}").touch()
    while not (Path(folder) / "go").exists():
        time.sleep(0.02)
    return number


@pytest.fixture(scope="module")
def started() -> Iterator[LocalCluster]:
    with local_cluster(2) as cluster:
        yield cluster
        ray.shutdown()


@pytest.fixture
def there(started: LocalCluster) -> Where:
    return Where(cluster=started.address)


def rows(path: Path) -> list[tuple[str, str, str]]:
    with closing(sqlite3.connect(path)) as database:
        return database.execute("SELECT * FROM results ORDER BY key").fetchall()


def until(ready: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not ready():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_store_gets_the_rows_that_local_workers_give(there: Where, tmp_path: Path) -> None:
    numbers = range(12)
    for name, where in (("here", Where(workers=1)), ("there", there)):
        with JobStore(tmp_path / name, Wave, "1") as store:
            found = run_jobs(wave, numbers, store=store, where=where)
            assert [each.number for each in found] == list(numbers)
            assert {each.threads for each in found} == {"1"}
    assert rows(tmp_path / "here") == rows(tmp_path / "there")
    assert len(rows(tmp_path / "there")) == 12


def test_a_job_that_raises_is_reported_with_its_own_error(there: Where) -> None:
    with pytest.raises(JobsFailed, match="2 of 4 jobs failed") as failed:
        run_jobs(refuses, range(4), where=there)
    assert [(i, str(e)) for i, e in failed.value.failures] == [(1, "1 is odd"), (3, "3 is odd")]


def test_a_worker_that_dies_takes_only_its_attempt_with_it(there: Where, tmp_path: Path) -> None:
    jobs = [(number, str(tmp_path)) for number in range(6)]
    with JobStore(tmp_path / "jobs.sqlite", int, "1") as store:
        with pytest.raises(JobsFailed, match=r"1 of 6 jobs failed; the first, job 1: .*2 attempts") as failed:
            run_jobs(dies, jobs, store=store, where=there, attempts=2)
        assert sorted(store.read([store.key(job) for job in jobs]).values()) == [0, 2, 3, 4, 5]
    assert isinstance(failed.value.failures[0][1], WorkerDied)
    assert [(tmp_path / name).read_text() for name in ("0", "1")] == ["x", "xx"]


@pytest.mark.parametrize("most", [1, None])
def test_no_more_jobs_are_in_flight_than_asked_for(most: int | None, there: Where, tmp_path: Path) -> None:
    run_jobs(timed, [str(tmp_path)] * 12, where=Where(cluster=there.cluster, workers=most))
    spans = [tuple(map(float, line.split())) for log in tmp_path.iterdir() for line in log.read_text().splitlines()]
    assert len(spans) == 12
    assert max(sum(begin <= at < end for begin, end in spans) for at, _ in spans) == (most or 2)


def test_a_node_that_is_lost_loses_no_job(started: LocalCluster, there: Where, tmp_path: Path) -> None:
    found: list[int] = []
    jobs = [(number, str(tmp_path)) for number in range(4)]
    sweep = Thread(target=lambda: found.extend(run_jobs(waits, jobs, where=there)))
    sweep.start()
    until(lambda: len(list(tmp_path.glob("begun-*"))) == 2)
    started.kill_node(0)
    started.add_node()
    until(lambda: len(list(tmp_path.glob("begun-*"))) == 3)
    (tmp_path / "go").touch()
    sweep.join(60.0)
    assert found == [0, 1, 2, 3]
    assert len(list(tmp_path.glob("begun-*"))) == 5


SWEEP = """
import sys, time
from pathlib import Path
from train.shared.job_store import JobStore
from train.shared.jobs import Where, run_jobs

def slow(number):
    folder = Path(sys.argv[1])
    with (folder / "computed").open("a") as log:
        log.write(f"{number} ")
    while number >= 3 and not (folder / "go").exists():
        time.sleep(0.05)
    return number

if __name__ == "__main__":
    sys.argv[1:], address = sys.argv[1:2], sys.argv[2]
    with JobStore(Path(sys.argv[1]) / "jobs.sqlite", int, "1") as store:
        try:
            print(run_jobs(slow, range(6), store=store, where=Where(cluster=address)))
        except KeyboardInterrupt:
            sys.exit(130)
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)])
def test_a_driver_that_is_gone_loses_only_what_was_in_flight(
    how: signal.Signals, started: LocalCluster, tmp_path: Path, start: Callable[..., subprocess.Popen[str]]
) -> None:
    script = tmp_path / "sweep.py"
    script.write_text(SWEEP.replace("sys.argv[1])\n    with (folder", f"{str(tmp_path)!r})\n    with (folder"))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, str(script), str(tmp_path), started.address]
    process = start(command, env=environment, stdout=subprocess.DEVNULL)
    computed = tmp_path / "computed"
    until(lambda: computed.exists() and len(computed.read_text().split()) == 5)
    # The last of the finished ones may still be on its way to the driver.
    until(lambda: len(rows(tmp_path / "jobs.sqlite")) == 3)
    os.killpg(process.pid, how)
    assert process.wait(60.0) == (130 if how == signal.SIGINT else -signal.SIGKILL)
    assert len(rows(tmp_path / "jobs.sqlite")) == 3
    until(lambda: not started.working())
    (tmp_path / "go").touch()
    again = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60.0, check=False)
    # Ray tells a driver, on its standard output, of nodes that were lost, such as the one of a test before.
    assert again.returncode == 0, again.stderr
    assert "[0, 1, 2, 3, 4, 5]" in again.stdout.splitlines()
    assert sorted(computed.read_text().split()) == ["0", "1", "2", "3", "3", "4", "4", "5"]


def test_a_worker_of_other_sources_is_refused(there: Where, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backend, "installed", lambda: "0" * 64)
    with pytest.raises(InvalidValue, match=r"another aframe-heave \(sources \w{12}, here 0{12}\) on .*: install there"):
        run_jobs(refuses, [0], where=there)


def test_a_place_without_a_cluster_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(InvalidValue, match=rf"cluster = '127.0.0.1:{port}': no Ray cluster to work on .*refused"):
        run_jobs(refuses, [0], where=Where(cluster=f"127.0.0.1:{port}"))
