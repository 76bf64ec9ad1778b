"""Server of a measuring script: it stays warm, and measures whenever it is asked for one of its measurements.

The standard library alone, so that every environment can run it. By hand, ``python SCRIPT.py [NAME ...]`` measures
three times and prints.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any

Measurement = Callable[[], float]
"""Take one sample."""
Prepare = Callable[[], Measurement]
"""Build what is measured and warm it."""

SECONDS = 0.3
"""About how long one sample of a speed takes."""


def speed(call: Callable[[], Any], work: int, seconds: float = SECONDS) -> Measurement:
    """Env steps a second of ``call``, which makes ``work`` of them; warmed and timed over about ``seconds`` s."""

    def elapsed(count: int) -> float:
        begin = time.perf_counter()
        for _ in range(count):
            call()
        return time.perf_counter() - begin

    call()
    count = 1
    while (taken := elapsed(count)) < 0.1 * seconds:
        count *= 2
    count = max(1, round(count * seconds / taken))
    return lambda: work * count / elapsed(count)


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def serve(measurements: Mapping[str, Prepare], packages: Sequence[str] = ()) -> None:
    """Answer each line of standard input, the name of a measurement, with one line of JSON."""
    if sys.argv[1:2] != ["--serve"]:
        by_hand(measurements, sys.argv[1:] or list(measurements))
        return
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8", buffering=1)
    os.dup2(2, 1)  # whatever else is printed must not mix with the answers
    print(json.dumps({"versions": versions(packages)}), file=answers)
    ready: dict[str, Measurement] = {}
    for line in sys.stdin:
        name = line.strip()
        answer: dict[str, float | str]
        try:
            if name not in ready:
                ready[name] = measurements[name]()
            value = float(ready[name]())
            answer = {"value": value} if math.isfinite(value) else {"error": f"{name}: {value} is no measurement"}
        except Exception as error:
            answer = {"error": f"{type(error).__name__}: {error}".splitlines()[0]}
        print(json.dumps(answer), file=answers)


def by_hand(measurements: Mapping[str, Prepare], names: Sequence[str]) -> None:
    """Measure three times and print."""
    for name in names:
        measure = measurements[name]()
        print(name, *(f"{measure():.4g}" for _ in range(3)), flush=True)


def versions(packages: Sequence[str]) -> dict[str, str]:
    """Installed versions."""
    found = {}
    for name in packages:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found
