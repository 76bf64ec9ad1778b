"""Jobs over worker processes of this machine, which are replaced when they die.

Each worker is an executor of its own, so that one that dies (out of memory, killed) takes only its own job with it.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Final, Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

ONE_THREAD: Final = {
    name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
}
"""Environment of a worker that computes with one thread: there is one of them for each core."""


class WorkerDied(RuntimeError):
    """A worker process ended in the middle of a job, as often as the job was tried."""


@dataclass
class Job(Generic[Item]):
    """One item, and how often it was tried."""

    index: int
    item: Item
    tries: int = 0


@dataclass(frozen=True)
class Success(Generic[Result]):
    """What came of a job."""

    value: Result


@dataclass(frozen=True)
class Failure:
    """Why nothing came of a job."""

    error: Exception


def died(job: Job[Item]) -> Failure:
    """The failure of a job whose worker died in each attempt."""
    return Failure(WorkerDied(f"the worker died in each of {job.tries} attempts"))


def outcomes(
    fn: Callable[[Item], Result], jobs: deque[Job[Item]], workers: int, attempts: int
) -> Generator[tuple[Job[Item], Success[Result] | Failure], None, None]:
    """Each job with what came of it, in the order of finishing. Closing the iterator kills the workers."""
    running: dict[Future[Result], tuple[_Worker, Job[Item]]] = {}
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
                        outcome: Success[Result] | Failure = Success(future.result())
                    except BrokenProcessPool:
                        worker.kill()
                        worker = _Worker()
                        if job.tries < attempts:
                            idle.append(worker)
                            jobs.append(job)
                            continue
                        outcome = died(job)
                    except Exception as error:
                        outcome = Failure(error)
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
    """Workers started meanwhile compute with one thread each."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
