"""The ceiling of a task: what the winch-limited optimum leaves in each scenario of a split, the whole future known.

It is computed once and stored, ``results/tasks/TASK/ceiling.json``: a score is what a policy removes of the heave over
what the ceiling removes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from rich.progress import Progress

import aframe_env
import agents
from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.serialization import strict_converter, structure
from aframe_env.suite import Split, Task, find_task
from aframe_env.validation import InvalidValue
from agents import cards, shipped
from agents.control.optimum import optimise
from agents.policy import FloatArray
from agents.registry import DRUM_STILL, BuildContext
from agents.rollout import Episodes, run
from train.shared.job_store import JobStore, version_of
from train.shared.jobs import Where, run_jobs
from train.shared.run_folder import versions, write_json

FORMAT: Final = 1
METHOD: Final = "Gauss-Newton on the drum's speeds under the winch's limits, whole future known"
BLOCK: Final = 20
"""Scenarios of a job: what an interruption can cost."""
SAME: Final = 1e-6
"""Share by which the errors of a drum left still may differ from the stored ones: physics that has changed is told by
them."""


@dataclass(frozen=True, kw_only=True)
class Ceiling:
    """Root mean square depth errors in the first scenarios of a split, m."""

    task: str
    """Id of the task, with its version."""
    split: Split
    seed: int
    """Of the split."""
    draws: str
    """Digest of the split's scenarios, as ``Task.digest`` tells it."""
    method: str
    """How the optimum was found."""
    still: tuple[float, ...]
    """With the drum left still, but for what a target that moves asks of it."""
    best: tuple[float, ...]
    """With the best drum commands."""
    versions: dict[str, str]

    @property
    def reductions(self) -> FloatArray:
        """Heave reduction of the optimum in each scenario, (N,)."""
        return np.asarray(1.0 - np.array(self.best) / np.array(self.still))

    def first(self, count: int) -> Ceiling:
        """Return that of the first scenarios."""
        return replace(self, still=self.still[:count], best=self.best[:count])

    def holds_for(self, task: Task, split: Split, count: int) -> bool:
        """Whether it is of so many scenarios of this split, and of the physics as it is."""
        if (self.task, self.split, self.seed, self.draws) != (task.id, split, task.seed(split), task.digest(split)):
            return False
        some = min(count, BLOCK)
        still = _still(task, split, some)
        return len(self.still) >= count and bool(np.allclose(still, self.still[:some], rtol=SAME, atol=0.0))

    def write(self, folder: Path) -> None:
        """Write it into a folder of the task."""
        write_json(folder / file_name(self.split), cards.sealed({"format": FORMAT, **asdict(self)}))


def file_name(split: Split) -> str:
    """Name of a ceiling's file."""
    return "ceiling.json" if split == "test" else f"ceiling-{split}.json"


def read(path: Path) -> Ceiling:
    """Read a ceiling. Raises ``InvalidValue`` where the file is damaged, altered, or of another format."""
    card = cards.read(path, "ceiling", FORMAT)
    del card["format"]
    return structure(strict_converter(), card, Ceiling, str(path))


def ceiling_of(
    task: Task, split: Split, count: int, jobs: Path, where: Where, progress: Progress | None = None
) -> Ceiling:
    """Return the ceiling of the first ``count`` scenarios: the stored one, if it holds, or one that is computed.

    What is computed is kept in the file ``jobs``, block by block.
    """
    stored = shipped.task_folder(task.name) / file_name(split)
    if stored.is_file() and (found := read(stored)).holds_for(task, split, count):
        return found.first(count)
    draws = task.require_frozen(split)
    blocks = [_Block(task.name, split, draws, first, min(BLOCK, count - first)) for first in range(0, count, BLOCK)]
    with JobStore(jobs, _Solved, version_of(aframe_env, agents)) as store:
        solved = run_jobs(
            _solve, blocks, store=store, where=where, progress=progress, description=f"{task.name}: ceiling"
        )
    (scenario,) = task.scenarios(split, 1)
    return Ceiling(
        task=task.id,
        split=split,
        seed=task.seed(split),
        draws=draws,
        method=METHOD if scenario.is_light else f"{METHOD}; the best end of three starts",
        still=_joined([each.still for each in solved]),
        best=_joined([each.best for each in solved]),
        versions=versions(),
    )


@dataclass(frozen=True)
class _Block:
    """Some of a split's scenarios."""

    task: str
    split: Split
    draws: str
    first: int
    count: int


@dataclass(frozen=True)
class _Solved:
    """Root mean square depth errors (n,) m of a block."""

    still: FloatArray
    best: FloatArray


def _solve(block: _Block) -> _Solved:
    task = find_task(block.task)
    config = TaskConfig(**task.arguments)
    scenarios = task.scenarios(block.split, block.first + block.count)[block.first :]
    best = optimise(scenarios, config).omega1
    if np.isinf(best).any():
        raise InvalidValue(
            f"task {task.id}: in scenario {block.first + int(np.isinf(best).argmax())} of the split {block.split!r} "
            "the rope parts whatever the drum does: it must be left out"
        )
    return _Solved(_left_still(scenarios, config).rms, np.sqrt(best / config.duration))


def _still(task: Task, split: Split, count: int) -> FloatArray:
    return _left_still(task.scenarios(split, count), TaskConfig(**task.arguments)).rms


def _left_still(scenarios: Sequence[Scenario], config: TaskConfig) -> Episodes:
    policy = DRUM_STILL.policy(BuildContext(scenarios=scenarios, config=config))
    return run(policy, scenarios, config)


def _joined(parts: Sequence[FloatArray]) -> tuple[float, ...]:
    return tuple(np.concatenate(parts).tolist())
