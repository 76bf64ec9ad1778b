"""``run_jobs``: every sweep's independent jobs over worker processes, resumable after any interruption.

Each worker is an executor of its own, so that one that dies (out of memory, killed) takes only its own job with it
and is replaced. What is finished is on disk before the next job starts.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any, Generic, TypeVar

from rich.progress import Progress

from aframe_env.validation import require_integer
from train.shared.job_store import JobStore, NotStored

Item = TypeVar("Item")
Result = TypeVar("Result")

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class WorkerDied(RuntimeError):
    """A worker process ended in the middle of a job, as often as the job was tried."""


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
    workers: int | None = None,
    attempts: int = 3,
    progress: Progress | None = None,
    description: str = "jobs",
) -> list[Result]:
    """Return ``[fn(item) for item in items]``, computed by ``workers`` processes (by default one for each core).

    ``fn``, items and results must be picklable. With a ``store``, what it already holds is not computed again and
    each result is kept as soon as it is there: interrupt or kill the process at any moment and call again. ``key``
    gives what identifies an item (plain data or a dataclass; by default the item itself); items of one key are
    computed once. A job whose worker dies is tried up to ``attempts`` times in all, one that raises, or whose result
    cannot be stored for its NaN or infinity, only once; the rest is finished before ``JobsFailed`` reports them.
    """
    require_integer("attempts", attempts, low=1, high=1000)
    require_integer("workers", 1 if workers is None else workers, low=1, high=4096)
    keys: list[str] = [str(i) for i in range(len(items))]
    found: dict[str, Result] = {}
    if store is not None:
        keys = [store.key(key(item) if key else item) for item in items]
        found = store.read(keys)
    first: dict[str, int] = {}
    for index, each in enumerate(keys):
        first.setdefault(each, index)
    jobs = deque(_Job(index, items[index]) for each, index in first.items() if each not in found)
    failures: list[tuple[int, Exception]] = []
    with contextlib.ExitStack() as stack:
        bars = stack.enter_context(Progress()) if progress is None else progress
        bar = bars.add_task(description, total=len(first), completed=len(first) - len(jobs))
        for job, outcome in _outcomes(fn, jobs, min(workers or os.cpu_count() or 1, len(jobs)), attempts):
            if isinstance(outcome, _Failure):
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


@dataclass
class _Job(Generic[Item]):
    index: int
    item: Item
    tries: int = 0


@dataclass(frozen=True)
class _Success(Generic[Result]):
    value: Result


@dataclass(frozen=True)
class _Failure:
    error: Exception


def _outcomes(
    fn: Callable[[Item], Result], jobs: deque[_Job[Item]], workers: int, attempts: int
) -> Iterator[tuple[_Job[Item], _Success[Result] | _Failure]]:
    """Each job with what came of it, in the order of finishing. Closing the iterator kills the workers."""
    running: dict[Future[Result], tuple[_Worker, _Job[Item]]] = {}
    idle: list[_Worker] = []
    with _one_thread_each():
        try:
            idle += [_Worker() for _ in range(workers)]
            while jobs or running:
                while jobs and idle:
                    worker, job = idle.pop(), jobs.popleft()
                    job.tries += 1
                    running[worker.executor.submit(fn, job.item)] = worker, job
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    worker, job = running.pop(future)
                    try:
                        outcome: _Success[Result] | _Failure = _Success(future.result())
                    except BrokenProcessPool:
                        worker.kill()
                        worker = _Worker()
                        if job.tries < attempts:
                            idle.append(worker)
                            jobs.append(job)
                            continue
                        outcome = _Failure(WorkerDied(f"the worker died in each of {job.tries} attempts"))
                    except Exception as error:
                        outcome = _Failure(error)
                    idle.append(worker)
                    yield job, outcome
        finally:
            for worker in [*idle, *(worker for worker, _ in running.values())]:
                worker.kill()


class _Worker:
    """One process, behind an executor of its own."""

    def __init__(self) -> None:
        context = get_context("spawn")
        ours, self._lifeline = context.Pipe(duplex=False)
        self._ours = ours
        self.executor = ProcessPoolExecutor(1, mp_context=context, initializer=_live_on, initargs=(ours,))

    def kill(self) -> None:
        """End the process at once, whatever it is at."""
        self._lifeline.close()
        self.executor.shutdown(wait=True, cancel_futures=True)
        self._ours.close()


def _live_on(lifeline: Connection) -> None:
    """Make this process end with the other end of its lifeline: closed, or lost with a parent that was killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        with contextlib.suppress(EOFError, OSError):
            lifeline.recv()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def _one_thread_each() -> Iterator[None]:
    """Workers started meanwhile compute with one thread each: there is one of them for each core."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
