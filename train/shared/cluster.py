"""Jobs over the workers of a Ray cluster, which may die, and their nodes with them.

The driver, this process, hands out so many jobs that none of the cluster's processors waits for it, and no more. It
alone decides what is tried again, and it alone writes what comes back.
"""

from __future__ import annotations

import hashlib
import logging
import os
import socket
import time
from collections import deque
from collections.abc import Callable, Generator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, TypeVar

from gymnasium.error import DependencyNotInstalled

from aframe_env.validation import InvalidValue
from train.shared.local_workers import ONE_THREAD, Failure, Job, Success, died

Item = TypeVar("Item")
Result = TypeVar("Result")

_FOR_EACH_PROCESSOR: Final = 2
"""Jobs in flight: one runs, one waits beside it. It is also what makes a cluster grow that grows by itself."""
_LOOK_AT_CLUSTER: Final = 2.0
"""Seconds after which its processors are counted anew."""


def outcomes(
    fn: Callable[[Item], Result], jobs: deque[Job[Item]], address: str, most: int | None, attempts: int
) -> Generator[tuple[Job[Item], Success[Result] | Failure], None, None]:
    """Each job with what came of it, in the order of finishing. Closing the iterator kills those that run.

    ``most`` jobs are in flight at once; by default twice as many as the cluster has processors.

    Raises:
        InvalidValue: No cluster answers there, or a worker has other sources than this process.
    """
    if not jobs:
        return
    ray = _connected(address)
    lost = (
        ray.exceptions.WorkerCrashedError,
        ray.exceptions.NodeDiedError,
        ray.exceptions.LocalRayletDiedError,
        ray.exceptions.ObjectLostError,
        ray.exceptions.OutOfMemoryError,
    )
    # What is lost is tried again here, where attempts are counted, not by Ray.
    work = ray.remote(num_cpus=1, max_retries=0, runtime_env={"env_vars": ONE_THREAD})(_carried_work())
    running: dict[Any, Job[Item]] = {}
    room, counted = 0, -_LOOK_AT_CLUSTER
    try:
        while jobs or running:
            if time.monotonic() - counted > _LOOK_AT_CLUSTER:
                processors = int(ray.cluster_resources().get("CPU", 0))
                room, counted = most or max(_FOR_EACH_PROCESSOR * processors, 1), time.monotonic()
            while jobs and len(running) < room:
                job = jobs.popleft()
                job.tries += 1
                try:
                    packed = ray.cloudpickle.dumps((fn, job.item))
                except Exception as error:
                    yield job, Failure(error)
                else:
                    running[work.remote(installed(), packed)] = job
            if not running:
                continue
            ray.wait(list(running), num_returns=1, timeout=_LOOK_AT_CLUSTER)
            ready, _ = ray.wait(list(running), num_returns=len(running), timeout=0)
            for reference in ready:
                job = running.pop(reference)
                try:
                    refusal, value = ray.get(reference)
                except lost:
                    if job.tries < attempts:
                        jobs.append(job)
                        continue
                    yield job, died(job)
                except ray.exceptions.RayTaskError as error:
                    yield job, Failure(error.cause if isinstance(error.cause, Exception) else error)
                except ray.exceptions.RayError as error:
                    yield job, Failure(error)
                else:
                    if refusal:
                        raise InvalidValue(f"cluster = {address!r}: {refusal}")
                    yield job, Success(value)
    finally:
        for reference in running:
            ray.cancel(reference, force=True)


@cache
def installed() -> str:
    """Digest of the sources that are installed here: a worker must have the same.

    They are not imported for that: a job may need only a part of them.
    """
    digest = hashlib.sha256()
    for package in ("aframe_env", "agents", "train"):
        spec = find_spec(package)
        for folder in (spec and spec.submodule_search_locations) or ():
            for path in sorted(Path(folder).rglob("*.py")):
                digest.update(path.read_bytes())
    return digest.hexdigest()


def _carried_work() -> Callable[[str, bytes], tuple[str, Any]]:
    """What a worker does, as a function that travels by value: it runs where our package is another, or missing."""

    def work(version: str, packed: bytes) -> tuple[str, Any]:
        import pickle
        import socket

        advice = f"on {socket.gethostname()}: install there what is installed here"
        try:
            from train.shared.cluster import installed
        except ImportError as error:
            return f"no aframe-heave ({error}) {advice}", None
        if installed() != version:
            return f"another aframe-heave (sources {installed()[:12]}, here {version[:12]}) {advice}", None
        fn, item = pickle.loads(packed)
        return "", fn(item)

    return work


def _connected(address: str) -> Any:
    """Ray, connected to the cluster at ``address`` until this process ends."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray
    except ImportError as error:
        raise DependencyNotInstalled('ray is not installed: pip install "aframe-heave[cluster]"') from error
    if ray.is_initialized():
        return ray
    try:
        if address != "auto":  # Ray itself would wait for minutes, and then end the process
            host, _, port = address.rpartition(":")
            socket.create_connection((host, int(port)), timeout=10.0).close()
        ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR)
    except (OSError, RuntimeError, ValueError, OverflowError) as error:
        said = " ".join(str(error).split())
        raise InvalidValue(f"cluster = {address!r}: no Ray cluster to work on ({said}): see docs/cluster.md") from error
    return ray
