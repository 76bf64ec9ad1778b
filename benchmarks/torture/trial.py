"""What is tried, how often, and what came out; kept in a file from attempt to attempt."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from aframe_env.serialization import strict_converter, structure
from train.shared.run_folder import versions, write_json


@dataclass(frozen=True)
class Outcome:
    """Of one attempt: what was tried, what survived it, and why the rest did not."""

    tried: int
    survived: int
    counts: dict[str, int] = field(default_factory=dict)
    """How many of ``tried`` were of a kind."""
    failures: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One row of the table."""

    name: str
    what: str
    """What is tried, and what survival means."""
    wanted: int
    attempt: Callable[[np.random.Generator, Path, int], Outcome]
    """(generator, an empty folder, most that it may try): try some, at least one."""


@dataclass
class Row:
    """What came out of a trial so far."""

    what: str
    wanted: int
    command: str
    """The command that repeats it."""
    seed: int
    versions: dict[str, str]
    tried: int = 0
    survived: int = 0
    attempts: int = 0
    seconds: float = 0.0
    counts: dict[str, int] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)

    def add(self, outcome: Outcome, seconds: float) -> None:
        """Add an attempt."""
        self.tried += outcome.tried
        self.survived += outcome.survived
        self.attempts += 1
        self.seconds = round(self.seconds + seconds, 1)
        for kind, count in outcome.counts.items():
            self.counts[kind] = self.counts.get(kind, 0) + count
        self.failures += outcome.failures


@dataclass
class Results:
    """Rows of a run, finished or not."""

    rows: dict[str, Row]

    @classmethod
    def begin(cls, command: str, seed: int, trials: list[Trial], partial: Path) -> Results:
        """Those of an interrupted run of the same command and versions; empty ones if there is none."""
        here = versions()
        new = cls({trial.name: Row(trial.what, trial.wanted, command, seed, here) for trial in trials})
        if partial.exists():
            old = cls.read(partial)
            if [*map(_asked, old.rows.items())] == [*map(_asked, new.rows.items())]:
                return old
        return new

    @classmethod
    def read(cls, path: Path) -> Results:
        """Read a file that ``save`` wrote."""
        return structure(strict_converter(), json.loads(path.read_text(encoding="utf-8")), cls, str(path))

    def beside(self, path: Path) -> Results:
        """These rows, and those of a finished run in ``path`` that this one has not tried."""
        others = self.read(path).rows if path.exists() else {}
        return Results({**others, **self.rows})

    @property
    def survived(self) -> bool:
        """Whether everything that was tried survived."""
        return all(row.survived == row.tried for row in self.rows.values())

    def save(self, path: Path) -> None:
        """Write them, all or nothing."""
        data: dict[str, Any] = strict_converter().unstructure(self)
        write_json(path, data)


def _asked(item: tuple[str, Row]) -> tuple[Any, ...]:
    name, row = item
    return name, row.what, row.wanted, row.command, row.seed, row.versions


def attempts(trial: Trial, row: Row, seed: int) -> Iterator[Outcome]:
    """Go on with a trial until as much was tried as is wanted; each attempt has a generator of its own."""
    name = int.from_bytes(trial.name.encode(), "big")
    while row.tried < trial.wanted:
        begin = time.monotonic()
        with TemporaryDirectory(prefix="torture-") as folder:
            rng = np.random.default_rng([seed, name, row.attempts])
            outcome = trial.attempt(rng, Path(folder), trial.wanted - row.tried)
        row.add(outcome, time.monotonic() - begin)
        yield outcome
