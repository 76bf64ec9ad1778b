"""``run_jobs``: every sweep's independent jobs, on this machine or a cluster, resumable after any interruption.

What is finished is on disk before the next job starts.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

from rich.progress import Progress

from aframe_env.validation import InvalidValue, require_integer
from train.shared import cluster, local_workers
from train.shared.job_store import JobStore, NotStored
from train.shared.local_workers import Failure, Job, Success

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where the jobs of a sweep run; what comes of them is the same everywhere."""

    workers: int | None = None
    """Most jobs at once; by default one for each core of this machine, or as many as keep the cluster busy."""
    cluster: str | None = None
    """Ray cluster that they run on: "auto" for the one that this machine belongs to, or HOST:PORT of its head; by
    default they run in processes of this machine."""

    def __post_init__(self) -> None:
        require_integer("workers", 1 if self.workers is None else self.workers, low=1, high=10**6)
        if self.cluster is not None and not re.fullmatch(r"auto|[^\s:/]+:[0-9]{1,5}", self.cluster):
            raise InvalidValue(f"cluster = {self.cluster!r}: must be auto or HOST:PORT, as in 10.0.0.1:6379")

    @property
    def asked_for(self) -> bool:
        """Whether a cluster, or more than one process of this machine, was asked for in words."""
        return self.cluster is not None or (self.workers or 1) > 1

    def outcomes(
        self, fn: Callable[[Item], Result], jobs: deque[Job[Item]], attempts: int
    ) -> Generator[tuple[Job[Item], Success[Result] | Failure], None, None]:
        """Each job with what came of it, in the order of finishing. Closing the iterator ends those that run."""
        if self.cluster is not None:
            return cluster.outcomes(fn, jobs, self.cluster, self.workers, attempts)
        return local_workers.outcomes(fn, jobs, min(self.workers or os.cpu_count() or 1, len(jobs)), attempts)


HERE: Final = Where()
"""One process for each core of this machine."""


class JobsFailed(RuntimeError):
    """Some jobs failed; the others were finished, and kept if there is a store."""

    def __init__(self, failures: Sequence[tuple[int, Exception]], count: int) -> None:
        index, error = failures[0]
        super().__init__(f"{len(failures)} of {count} jobs failed; the first, job {index}: {error!r}")
        self.failures = tuple(failures)
        """Index of each failed item, and what it raised."""


def run_jobs(
    fn: Callable[[Item], Result],
    items: Sequence[Item],
    key: Callable[[Item], Any] | None = None,
    *,
    store: JobStore[Result] | None = None,
    where: Where = HERE,
    attempts: int = 3,
    progress: Progress | None = None,
    description: str = "jobs",
) -> list[Result]:
    """Return ``[fn(item) for item in items]``, computed ``where`` (by default by one process for each core).

    ``fn``, items and results must be picklable. With a ``store``, what it already holds is not computed again and
    each result is kept as soon as it is there: interrupt or kill the process at any moment and call again. ``key``
    gives what identifies an item (plain data or a dataclass; by default the item itself); items of one key are
    computed once. A job whose worker dies is tried up to ``attempts`` times in all, one that raises, or whose result
    cannot be stored for its NaN or infinity, only once; the rest is finished before ``JobsFailed`` reports them.
    """
    require_integer("attempts", attempts, low=1, high=1000)
    keys: list[str] = [str(i) for i in range(len(items))]
    found: dict[str, Result] = {}
    if store is not None:
        keys = [store.key(key(item) if key else item) for item in items]
        found = store.read(keys)
    first: dict[str, int] = {}
    for index, each in enumerate(keys):
        first.setdefault(each, index)
    jobs = deque(Job(index, items[index]) for each, index in first.items() if each not in found)
    failures: list[tuple[int, Exception]] = []
    with contextlib.ExitStack() as stack:
        bars = stack.enter_context(Progress()) if progress is None else progress
        bar = bars.add_task(description, total=len(first), completed=len(first) - len(jobs))
        outcomes = stack.enter_context(contextlib.closing(where.outcomes(fn, jobs, attempts)))
        for job, outcome in outcomes:
            if isinstance(outcome, Failure):
                failures.append((job.index, outcome.error))
            else:
                try:
                    if store is not None:
                        store.write(keys[job.index], outcome.value)
                    found[keys[job.index]] = outcome.value
                except NotStored as error:
                    failures.append((job.index, error))
            bars.advance(bar)
    if failures:
        raise JobsFailed(sorted(failures, key=lambda failure: failure[0]), len(items))
    return [found[each] for each in keys]
