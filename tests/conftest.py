"""What tests of several packages share: a browser, and processes that end with their test."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

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
