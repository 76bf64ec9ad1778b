"""What tests of several packages share: a browser, and processes that end with their test, or are killed in it."""

from __future__ import annotations

import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

# Pytest's workers share the cores, and on busy cores threads that wait for one another take ten times as long as one.
# Before numpy, numba and torch are imported, which look once; what needs two threads says so to a process of its own.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = ("--no-first-run", "--disable-background-networking", "--disable-component-update")


@contextmanager
def browser_with(*flags: str) -> Iterator[Any]:
    """Start Chromium with these flags, or skip where there is none."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    if CHROMIUM is None:
        pytest.skip("needs Chromium on the path")
    root = ("--no-sandbox",) if os.geteuid() == 0 else ()
    with playwright.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS, *flags, *root])
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    with browser_with("--disable-gpu") as browser:
        yield browser


@pytest.fixture(scope="module")
def chromium_in_3d() -> Iterator[Any]:
    """Without a GPU: the renderer on the processor that Chromium brings."""
    with browser_with("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist") as browser:
        yield browser


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start processes that hear Ctrl-C, each in a process group of its own that is gone when the test ends."""
    started: list[subprocess.Popen[str]] = []

    def process(command: list[str], **options: Any) -> subprocess.Popen[str]:
        # Under nohup, or in a shell's background, SIGINT is ignored, and a process hands that on to its children.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            started.append(subprocess.Popen(command, text=True, start_new_session=True, **options))
        finally:
            signal.signal(signal.SIGINT, before)
        return started[-1]

    yield process
    for each in started:
        with suppress(ProcessLookupError):
            os.killpg(each.pid, signal.SIGKILL)
        each.communicate()


@pytest.fixture
def interrupt() -> Callable[[subprocess.Popen[str], Callable[[], object]], str]:
    """Press Ctrl-C half a second after a process has begun its work; return what it says on standard error."""

    def press(process: subprocess.Popen[str], begun: Callable[[], object]) -> str:
        until = time.monotonic() + 120.0
        while not begun() and time.monotonic() < until:
            time.sleep(0.1)
        time.sleep(0.5)
        process.send_signal(signal.SIGINT)
        return process.communicate(timeout=60.0)[1]

    return press


@pytest.fixture
def jobs_in() -> Callable[[Path], int]:
    """Count the finished jobs in a store; -1 if there is none yet."""

    def count(store: Path) -> int:
        if not store.exists():
            return -1
        with closing(sqlite3.connect(store, timeout=60.0)) as database:
            try:
                return int(database.execute("SELECT COUNT(*) FROM results").fetchone()[0])
            except sqlite3.OperationalError:  # the table is not there yet
                return -1

    return count


@pytest.fixture
def run_module(start: Callable[..., subprocess.Popen[str]]) -> Callable[..., str]:
    """Run ``python -m`` to its end, which must be a good one; return what it says on standard error."""

    def ended(module: str, *arguments: object, **options: Any) -> str:
        process = start(_line(module, arguments), env=_environment(), stdout=subprocess.DEVNULL, stderr=-1, **options)
        said = process.communicate(timeout=300.0)[1]
        assert process.returncode == 0, said
        return said

    return ended


@pytest.fixture
def kill_module(start: Callable[..., subprocess.Popen[str]], jobs_in: Callable[[Path], int]) -> Callable[..., int]:
    """Run ``python -m`` until its store has so many jobs, and kill it (-9); return how many it has then."""

    def killed(store: Path, jobs: int, module: str, *arguments: object, **options: Any) -> int:
        # Python's own resource tracker remarks on the kill.
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        process = start(_line(module, arguments), env=_environment(), **quiet, **options)
        until = time.monotonic() + 300.0
        while jobs_in(store) < jobs and time.monotonic() < until and process.poll() is None:
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGKILL)
        assert process.wait(timeout=60.0) == -signal.SIGKILL
        kept = jobs_in(store)
        assert kept >= jobs
        return kept

    return killed


def _line(module: str, arguments: tuple[object, ...]) -> list[str]:
    return [sys.executable, "-m", module, *map(str, arguments)]


def _environment() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
