"""The bars and their verdicts: every word of a verdict is computed from the samples."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from benchmarks.catalogue import COST_ROWS, ENVPOOL, MEASURES
from benchmarks.results import NOT_ASKED, Run, Series


@dataclass(frozen=True)
class Verdict:
    """A row of the table."""

    what: str
    bar: str
    measured: str
    peer: str
    ratio: str
    met: bool | None
    """Verdict by the median. None where it could not be measured; ``measured`` or ``peer`` then says why."""
    split: bool = False
    """True if some rounds contradict the verdict."""

    @property
    def word(self) -> str:
        """The verdict in words."""
        word = {True: "yes", False: "no", None: "not measured"}[self.met]
        return f"{word}, not in every round" if self.split else word


class Bar(Protocol):
    """A bar."""

    def verdict(self, run: Run) -> Verdict:
        """Judge a run."""
        ...


def number(value: float) -> str:
    """Three digits, with separators of thousands and without exponents where that is readable."""
    if value == 0.0 or not 1e-3 <= abs(value) < 1e12:
        return f"{value:.3g}"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{round(value, 2 - math.floor(math.log10(abs(value)))):,.{digits}f}"


def spread(samples: Sequence[float]) -> str:
    """Median with least and greatest."""
    median = number(statistics.median(samples))
    return median if len(samples) == 1 else f"{median} [{number(min(samples))}, {number(max(samples))}]"


def shown(series: Series, unit: str) -> str:
    """Samples with their unit, or why there are none."""
    return f"{spread(series.samples)} {unit}" if series.measured else series.error


def best_of(run: Run, keys: Sequence[str]) -> str | None:
    """The fastest of a peer's settings; None if none was measured."""
    return max((key for key in keys if run.get(key).measured), key=lambda key: run.get(key).median, default=None)


def ratios(mine: Series, peer: Series) -> list[float]:
    """Ratio to the peer's speed, round by round."""
    return [a / b for a, b in zip(mine.samples, peer.samples, strict=False)]


@dataclass(frozen=True)
class Ratio:
    """At least so many times a peer's speed: median of each round's ratio to the peer's best setting."""

    what: str
    mine: str
    peers: tuple[str, ...]
    least: float
    of: str
    """Name of the peer, in the bar's words."""

    def verdict(self, run: Run) -> Verdict:
        """Compare round by round."""
        bar = f"≥ {self.least:g} × {self.of}"
        mine = run.get(self.mine)
        measured = shown(mine, MEASURES[self.mine].unit)
        best = best_of(run, self.peers)
        if best is None:
            return Verdict(self.what, bar, measured, run.get(self.peers[0]).error, "", None)
        peer = f"{MEASURES[best].what}: {shown(run.get(best), MEASURES[best].unit)}"
        if not mine.measured:
            return Verdict(self.what, bar, measured, peer, "", None)
        times = ratios(mine, run.get(best))
        holds = [ratio >= self.least for ratio in times]
        met = statistics.median(times) >= self.least
        return Verdict(self.what, bar, measured, peer, spread(times), met, len(set(holds)) > 1)


@dataclass(frozen=True)
class Limit:
    """A figure that may not exceed, or not fall short of, a limit in its own unit."""

    what: str
    key: str
    limit: float
    at_least: bool = False

    def verdict(self, run: Run) -> Verdict:
        """Compare the median."""
        series, unit = run.get(self.key), MEASURES[self.key].unit
        bar = f"{'≥' if self.at_least else '≤'} {number(self.limit) if self.limit >= 1e6 else f'{self.limit:g}'} {unit}"
        if not series.measured:
            return Verdict(self.what, bar, series.error, "", "", None)
        met, *holds = (
            value >= self.limit if self.at_least else value <= self.limit for value in (series.median, *series.samples)
        )
        return Verdict(self.what, bar, shown(series, unit), "", "", met, len(set(holds)) > 1)


@dataclass(frozen=True)
class Linear:
    """Cost of a step proportional to the number of rows: the exponent of a power law through the large ones."""

    what: str
    prefix: str
    from_rows: int
    tolerance: float

    def verdict(self, run: Run) -> Verdict:
        """Fit log seconds over log rows."""
        bar = f"N^p, |p − 1| ≤ {self.tolerance:g} for N ≥ {self.from_rows:,}"
        points = [(rows, run.get(f"{self.prefix}-{rows}@2")) for rows in COST_ROWS if rows >= self.from_rows]
        for _, series in points:
            if not series.measured:
                return Verdict(self.what, bar, series.error, "", "", None)
        rows = np.log([n for n, _ in points])
        seconds = rows - np.log([series.median for _, series in points])
        exponent = float(np.polyfit(rows, seconds, 1)[0])
        return Verdict(self.what, bar, f"p = {exponent:.3f}", "", "", abs(exponent - 1.0) <= self.tolerance)


ENVPOOL_KEYS: Final = tuple(f"envpool/{name}@2" for name in ENVPOOL)
ENVPOOL_64_KEYS: Final = tuple(key for key in ENVPOOL_KEYS if "-64-" in key)

BARS: Final[tuple[Bar, ...]] = (
    Limit("C++ limit gives the package's trajectory", "limit/deviation@1", 1e-5),
    *(
        Ratio(f"dynamics alone, {sea}, N = 4096, {cores}", f"dynamics/{name}@{n}", (f"limit/double@{n}",), 0.8, "C++")
        for name, sea in (("sea", "32-component sea included"), ("calm", "no sea, as in C++"))
        for n, cores in ((1, "one core"), (2, "two cores"))
    ),
    Ratio(
        "vector env, whole episodes, N = 4096, two cores",
        "env/episodes-4096@2",
        ENVPOOL_KEYS,
        5.0,
        "EnvPool at its best",
    ),
    Ratio("vector env, whole episodes, N = 4096, two cores", "env/episodes-4096@2", ("limit/double@2",), 0.4, "C++"),
    Ratio("vector env, whole episodes, N = 64", "env/episodes-64@2", ENVPOOL_64_KEYS, 3.0, "EnvPool with 64 rows"),
    Ratio("scalar env.step", "env/scalar@1", ("gymnasium/pendulum@1",), 1.0, "Pendulum-v1"),
    Ratio(
        "scalar env.step, inner step as by default",
        "env/scalar-default@1",
        ("gymnasium/pendulum@1",),
        1.0,
        "Pendulum-v1",
    ),
    Limit(
        "vector env, whole episodes, N = 4096, inner step as by default, two cores",
        "env/episodes-4096-default@2",
        1e6,
        at_least=True,
    ),
    Ratio(
        "an episode's steps, row of 4096 on one core", "dynamics/sea@1", ("solve_ivp/episode@1",), 500.0, "solve_ivp"
    ),
    *(
        Ratio(what, f"dynamics/deep-{name}@1", ("dynamics/deep-massless@1",), least, "a light rope in air")
        for name, what, least in (
            ("heavy", "rope of nine lumps at 1,000 m", 0.2),
            ("everything", "everything on at 1,000 m", 0.125),
        )
    ),
    Limit("Ω1 over 36 s, alone", "drives/omega1-alone@1", 100.0),
    Limit("Ω1 over 36 s, each of 64 together", "drives/omega1-filled@1", 30.0),
    Limit("Ω1's relative error at this inner step", "drives/omega1-error@1", 1e-4),
    Limit("the paper's whole table", "drives/paper-table@2", 20.0),
    Limit("memory a row, N = 65,536, at its most", "env/memory-peak@2", 64.0),
    Ratio("two cores over one: dynamics, N = 4096", "dynamics/sea@2", ("dynamics/sea@1",), 1.8, "one core"),
    Ratio("two cores over one: vector env, N = 4096", "env/episodes-4096@2", ("env/episodes-4096@1",), 1.8, "one core"),
    Linear("cost of Engine.step against N", "cost/engine", 1024, 0.05),
    Linear("cost of vector env's step against N", "cost/env", 1024, 0.05),
    Limit("import aframe_env, without torch", "startup/import@1", 0.5),
    Limit("make and first reset, warm compile cache", "startup/warm@1", 1.0),
    Limit("the same, vector env", "startup/warm-vector@1", 1.0),
    Limit("make and first reset, nothing compiled", "startup/cold@1", 20.0),
    Limit("the same, vector env", "startup/cold-vector@1", 20.0),
)
"""All of them, in the table's order. Inner step 0.01 s unless said, control step 0.1 s."""


def verdicts(run: Run) -> list[Verdict]:
    """Verdicts of the bars that the run was asked for."""
    found = [bar.verdict(run) for bar in BARS]
    return [verdict for verdict in found if NOT_ASKED not in (verdict.measured, verdict.peer)]
