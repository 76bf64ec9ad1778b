"""The leaderboard: a JSON file with one row for each policy on each task, which others add theirs to.

``docs/tasks.md`` has the form; every row that is read is held to it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from aframe_env.serialization import strict_converter, structure
from aframe_env.suite import TASKS, Split, Task
from aframe_env.text import read_json
from aframe_env.validation import InvalidValue
from agents.policy import Knowledge
from agents.registry import DRUM_STILL, OPTIMUM
from train.benchmark.ceiling import Ceiling
from train.evaluate.statistics import Interval, Row, family
from train.shared.run_folder import versions, write_json

NAME: Final = "leaderboard.json"
FORM: Final = 1
YARDSTICKS: Final = (OPTIMUM.name, DRUM_STILL.name)
"""Policies that every run has: they are nobody's."""


@dataclass(frozen=True, kw_only=True)
class LeaderboardRow:
    """A policy's score on a task: shares of the ceiling's heave reduction, with intervals of 95 %."""

    task: str
    """Id of the task, with its version."""
    split: Split
    scenarios: int
    """The first so many of the split."""
    draws: str
    """Digest of the split's scenarios."""
    policy: str
    """Its name, without a seed."""
    knows: str
    """What it is allowed to know, one of ``Knowledge``."""
    seeds: int
    """Agents that the row stands for, which differ in their seed alone."""
    share: Interval
    """Mean share of the ceiling: the score."""
    share_median: Interval
    share_worst: Interval
    """Mean of the worst 5 %."""
    reduction: Interval
    """Mean heave reduction, 1 - RMS/RMS(drum still)."""
    worse_than_still: float
    """Scenarios in which it does worse than a drum left still, a mean over the seeds."""
    parted: float
    """Scenarios in which the rope parted, likewise."""
    measures: dict[str, float] = field(default_factory=dict)
    """What the task tells beside the score, by name; the ceiling has none."""
    sha256: tuple[str, ...] = ()
    """Of the file of each agent, or of the module of somebody's law; none for what the package brings."""
    by: str = ""
    """Who added the row."""
    command: str
    versions: dict[str, str]

    @property
    def key(self) -> tuple[Any, ...]:
        """What a leaderboard has one row for."""
        return self.task, self.split, self.scenarios, self.policy, "" if self.policy in YARDSTICKS else self.by

    def require_sound(self, where: str) -> None:
        """Raise where a row cannot be what it says; ``where`` is named first."""
        by_id = {task.id: task for task in TASKS.values()}
        if self.task not in by_id:
            raise InvalidValue(f"{where}: task = {self.task!r}: must be one of {', '.join(map(repr, by_id))}")
        digest = by_id[self.task].digests.get(self.split)
        if self.draws != digest:
            raise InvalidValue(f"{where}: draws = {self.draws!r}: must be {digest!r}, the digest of these scenarios")
        expected = () if self.policy == OPTIMUM.name else by_id[self.task].measures
        if sorted(self.measures) != sorted(expected):
            raise InvalidValue(f"{where}: measures = {self.measures}: must be {', '.join(expected) or 'none'}")
        for name, value in self.measures.items():
            if not 0.0 <= value < np.inf:
                raise InvalidValue(f"{where}: {name} = {value!r}: must be 0 or more")
        known = [each.value for each in Knowledge]
        if self.knows not in known:
            raise InvalidValue(f"{where}: knows = {self.knows!r}: must be one of {', '.join(map(repr, known))}")
        for name in ("share", "share_median", "share_worst", "reduction"):
            each: Interval = getattr(self, name)
            if not (each.low <= each.high and -np.inf < each.value <= 1.0 + 1e-3):
                raise InvalidValue(f"{where}: {name} = {each}: must be at most 1, with low below high")
        if self.scenarios < 1 or self.seeds < 1:
            raise InvalidValue(f"{where}: scenarios = {self.scenarios}, seeds = {self.seeds}: must be 1 or more")
        for name in ("worse_than_still", "parted"):
            count = getattr(self, name)
            if not 0.0 <= count <= self.scenarios:
                raise InvalidValue(f"{where}: {name} = {count!r}: must be in [0, {self.scenarios}] scenarios")


def rows_of(
    task: Task,
    ceiling: Ceiling,
    rows: Iterable[Row],
    measures: Mapping[str, dict[str, float]],
    sha256: Mapping[str, tuple[str, ...]],
    by: str,
    command: str,
) -> list[LeaderboardRow]:
    """Rows of a task: the ceiling, and every policy; ``measures`` and ``sha256`` by their names without seeds."""
    same: dict[str, Any] = {
        "task": task.id,
        "split": ceiling.split,
        "scenarios": len(ceiling.still),
        "draws": ceiling.draws,
        "by": by,
        "command": command,
        "versions": versions(),
    }
    whole = Interval(1.0, 1.0, 1.0)
    best = LeaderboardRow(
        policy=OPTIMUM.name,
        knows=Knowledge.FUTURE.value,
        seeds=1,
        share=whole,
        share_median=whole,
        share_worst=whole,
        reduction=Interval.of(ceiling.reductions, np.mean),
        worse_than_still=0.0,
        parted=0.0,
        **same,
    )
    return [
        best,
        *(_row(row, measures[family(row.policy)], sha256.get(family(row.policy), ()), same) for row in rows),
    ]


def _row(row: Row, measures: dict[str, float], sha256: tuple[str, ...], same: dict[str, Any]) -> LeaderboardRow:
    assert row.share is not None
    assert row.share_median is not None
    assert row.share_tail is not None
    return LeaderboardRow(
        policy=family(row.policy),
        knows=row.knows,
        seeds=row.seeds,
        share=row.share,
        share_median=row.share_median,
        share_worst=row.share_tail,
        reduction=row.mean,
        worse_than_still=row.worse_than_still,
        parted=row.parted,
        measures=measures,
        sha256=sha256,
        **same,
    )


def read(path: Path) -> list[LeaderboardRow]:
    """Read the rows of a leaderboard, none if there is no such file; raise ``InvalidValue`` where one is unsound."""
    if not path.exists():
        return []
    data = read_json(path, "leaderboard")
    if not isinstance(data, dict) or data.get("form") != FORM or not isinstance(data.get("rows"), list):
        raise InvalidValue(f"{path}: must be a table with form = {FORM} and a list of rows")
    converter = strict_converter()
    rows = [structure(converter, row, LeaderboardRow, f"{path}: row {i}") for i, row in enumerate(data["rows"])]
    for number, row in enumerate(rows):
        row.require_sound(f"{path}: row {number}")
    return rows


def require_room(
    path: Path, tasks: Iterable[Task], split: Split, scenarios: int, sha256: Mapping[str, tuple[str, ...]], by: str
) -> None:
    """Raise where a leaderboard has a row of the same name, but of other agents; ``sha256`` by the policies' names."""
    ids = {task.id for task in tasks}
    for row in read(path):
        same = (row.split, row.scenarios, row.by) == (split, scenarios, by) and row.task in ids
        if same and row.policy in sha256 and row.sha256 != sha256[row.policy]:
            raise InvalidValue(
                f"by = {by!r}: {path} has a row {row.policy!r} of other agents: say whose these are by --by NAME, or "
                "pass --overwrite to put them in its place"
            )


def merged(
    old: Sequence[LeaderboardRow], new: Sequence[LeaderboardRow], *, yardsticks: bool = True
) -> list[LeaderboardRow]:
    """Rows of both, new ones in the place of old ones of the same policy; the best of each task first.

    Without ``yardsticks`` ceiling and drum still, which every run has, stay as they are where they are there already.
    """
    found = {row.key: row for row in old}
    found |= {row.key: row for row in new if yardsticks or row.key not in found or row.policy not in YARDSTICKS}
    return sorted(found.values(), key=lambda row: (row.task, row.split, row.scenarios, -row.share.value, row.policy))


def write(path: Path, rows: Sequence[LeaderboardRow]) -> None:
    """Write a leaderboard."""
    write_json(path, {"form": FORM, "rows": [asdict(row) for row in rows]})
