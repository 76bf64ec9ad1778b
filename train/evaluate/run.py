"""Policies side by side on the same held-out scenarios, with the same noise: the run behind every comparison."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar, Final, Literal

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

import aframe_env
import agents
from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.memory import require_memory
from aframe_env.scenario import Scenario
from aframe_env.suite import find_task
from aframe_env.validation import InvalidValue, require_integer
from agents.control.optimum import saturating
from agents.drives.optimisation import OptimisedDrive
from agents.drives.tuned import TUNED
from agents.policy import FloatArray, Knowledge, Policy
from agents.registry import DRUM_STILL, OPTIMUM, BuildContext, PolicySpec, Spread, as_spec, choose, choose_all, in_turn
from agents.rollout import Episodes, held_out_scenarios, history_bytes, run
from train.evaluate.statistics import Entry, Mask, Row, compare, compare_families
from train.evaluate.tables import rich_table, write_comparison
from train.shared.job_store import JOBS, JobStore, version_of
from train.shared.jobs import HERE, Where, run_jobs
from train.shared.scenarios import ScenarioOptions

AFTER_TRAINING: Final = (
    *TUNED,
    OPTIMUM.name,
    "feed-forward + feedback (state)",
    "feed-forward + feedback",
    "S-Ω1 for each scenario",
    "H-Ω1 for each scenario",
    "S-Ω1 for each scenario, Gauss-Newton",
    "H-Ω1 for each scenario, Gauss-Newton",
)
"""Policies that an agent is compared with at the end of its training."""


@dataclass(frozen=True, kw_only=True)
class HeldOut(ScenarioOptions):
    """On what policies are compared: held-out scenarios, a series that training never draws from, and the task."""

    bounds: ClassVar[tuple[int, int]] = (1, 20_000)
    privileged: int | None = None
    """The first so many of them for the drives that are optimised for each scenario, its whole future known; by default
    all."""
    observation: Literal["state", "sensors"] = "state"
    """Observation of a policy that is made for neither; an agent sees what it was trained on."""
    model: Literal["simplified", "rfem"] = "simplified"
    """Model that the policies run on; drives are optimised on the simplified one."""
    rfem_modes: int | None = None
    """Number of natural modes to keep with rfem; all by default."""
    control_period: float = TaskConfig.control_period
    """Control step, s: that at which the agents among the policies were trained."""
    episode_duration: float = TaskConfig.episode_duration
    """s."""
    task: str | None = None
    """Task of the suite, by name: its validation scenarios are the held-out ones, on its observation, at its period and
    for its duration. Its test scenarios are those of train.benchmark."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.task is not None and isinstance(self.scenarios, Path):
            raise InvalidValue(f"task = {self.task!r}: has scenarios of its own: --scenarios must be a number")
        require_integer("privileged", self.privileged or 0, low=0, high=10**6)
        self.config  # noqa: B018 - raises here, before anything is written

    @cached_property
    def config(self) -> TaskConfig:
        """The task."""
        if self.task is not None:
            arguments = find_task(self.task).arguments
            return TaskConfig(model=self.model, rfem_modes=self.rfem_modes, **arguments)
        return TaskConfig(
            model=self.model,
            scenario=self.source,
            control_period=self.control_period,
            episode_duration=self.episode_duration,
            observation=self.observation,
            rfem_modes=self.rfem_modes,
        )

    def drawn(self) -> tuple[list[Scenario], int]:
        """Draw the scenarios; beside them the seed of their sensors' noise."""
        if self.task is not None:
            found = find_task(self.task)
            return found.scenarios("validation", self.number), found.seed("validation")
        return held_out_scenarios(self.config.source, self.number), 0


@dataclass(frozen=True)
class Comparison:
    """Policies side by side; the first one is the drum still."""

    entries: tuple[Entry, ...]
    scenarios: tuple[Scenario, ...]
    config: TaskConfig

    @property
    def still(self) -> Episodes:
        """The yardstick: the drum left alone."""
        return self.entries[0].episodes

    @cached_property
    def optimum(self) -> Episodes | None:
        """Episodes of the winch-limited optimum, if it was among the policies."""
        return next((entry.episodes for entry in self.entries if entry.policy == OPTIMUM.name), None)

    @cached_property
    def saturating(self) -> Mask:
        """Whether holding the load still asks more of the winch than it has, in each scenario (N,)."""
        return saturating(self.scenarios, self.config)

    @cached_property
    def rows(self) -> list[Row]:
        """Every policy's figures."""
        return compare(self.entries, self.still, *self._yardsticks)

    @cached_property
    def families(self) -> list[Row]:
        """The same, agents that differ in their seed alone together."""
        return compare_families(self.entries, self.still, *self._yardsticks)

    @property
    def _yardsticks(self) -> tuple[FloatArray, Mask] | tuple[()]:
        """The optimum's errors, and where the winch saturates, if the optimum was among the policies."""
        return () if self.optimum is None else (self.optimum.rms, self.saturating)


def require_period(specs: Sequence[PolicySpec], control_period: float) -> None:
    """Raise where an agent was trained at another control step [s]."""
    for spec in specs:
        if spec.control_period is not None and abs(spec.control_period - control_period) > 1e-9:
            raise InvalidValue(
                f"control_period = {control_period:g} s: {spec.name} was trained at {spec.control_period:g} s, as by "
                f"--control-period {spec.control_period:g}"
            )


BLOCK: Final = 256
"""Scenarios of a job: what an interruption can cost of a policy's run."""
IN_MEMORY: Final = Path(":memory:")


@dataclass(frozen=True)
class _Ran:
    """A policy's run over a block of the scenarios."""

    knows: Knowledge
    episodes: Episodes


def run_all(
    specs: Sequence[PolicySpec], held_out: HeldOut, console: Console, *, jobs: Path = IN_MEMORY, where: Where = HERE
) -> Comparison:
    """Run the drum still and every policy that was chosen over the held-out scenarios, as ``run_on`` does."""
    scenarios, seed = held_out.drawn()
    return run_on(
        specs, held_out.config, scenarios, console, privileged=held_out.privileged, seed=seed, jobs=jobs, where=where
    )


def run_on(
    specs: Sequence[PolicySpec],
    config: TaskConfig,
    scenarios: Sequence[Scenario],
    console: Console,
    *,
    privileged: int | None = None,
    seed: int = 0,
    jobs: Path = IN_MEMORY,
    where: Where = HERE,
) -> Comparison:
    """Run the drum still and every policy that was chosen over these scenarios of the task of ``config``.

    ``privileged``: the first so many of them, or all, for policies that are built for each scenario; ``seed``: of the
    sensors' noise, by which the scenarios are told from another series in ``jobs``.
    What is finished, each policy's run over a block of scenarios and each drive that one needs, is kept in the file
    ``jobs``, and not computed again. Drives are optimised ``where``; policies run there too where it was asked for,
    and otherwise in this process, which has not to start others for that.
    Worker processes import the calling script: there the call has to stand where an import does not reach it.
    """
    chosen = (DRUM_STILL, *(c for c in specs if c.name != DRUM_STILL.name))
    first = scenarios[:privileged]
    count = sum(len(first if c.for_each_scenario else scenarios) for c in chosen)
    require_memory(f"{count} episodes of {config.steps} control steps", count * history_bytes(config.steps))
    version = version_of(aframe_env, agents)
    entries = []
    with (
        JobStore(jobs, _Ran, version) as ran,
        JobStore(jobs, OptimisedDrive, version) as drives,
        Progress(
            TextColumn("{task.description}", markup=False),  # the name of somebody's policy
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            console=console,
        ) as progress,
    ):
        if where.asked_for:
            elsewhere = [
                part
                for spec in chosen
                if spec.text and not spec.for_each_scenario
                for part in _parts(spec, config, scenarios, seed)
            ]
            run_jobs(
                _run_elsewhere, elsewhere, _Part.key, store=ran, where=where, progress=progress, description="policies"
            )
        for spec in chosen:
            mine = first if spec.for_each_scenario else scenarios
            if not mine:
                continue
            parts = _parts(spec, config, mine, seed)
            bar = progress.add_task(spec.name, total=len(parts) * config.steps)
            found = []
            for part in parts:
                found.append(ran.get(part.key(), partial(_run_here, spec, part, drives, where, progress, bar)))
                progress.update(bar, completed=len(found) * config.steps)
            episodes = Episodes.joined([each.episodes for each in found])
            entries.append(Entry(spec.name, found[0].knows, episodes, spec.text))
    return Comparison(tuple(entries), tuple(scenarios), config)


@dataclass(frozen=True)
class _Part:
    """A policy's run over a block of the scenarios."""

    text: str
    name: str
    digest: str
    config: TaskConfig
    scenarios: Sequence[Scenario]
    first: int
    """Number of the first scenario."""
    seed: int
    """Of the sensors' noise."""

    def key(self) -> list[Any]:
        """What identifies the run."""
        return [self.name, self.digest, self.config, self.seed, self.first, len(self.scenarios)]

    def run(self, spec: PolicySpec, spread: Spread = in_turn, advance: Callable[[], object] = lambda: None) -> _Ran:
        """Build the policy, and run it; ``advance`` is called after each step."""
        policy = spec.policy(BuildContext(scenarios=self.scenarios, config=self.config, spread=spread))
        seen = self.config.replaced(observation=observation_of(policy, self.config))
        episodes = run(
            policy, self.scenarios, seen, noise_seed=self.seed, first=self.first, progress=lambda _: advance()
        )
        return _Ran(policy.knows, episodes)


def _parts(spec: PolicySpec, config: TaskConfig, scenarios: Sequence[Scenario], seed: int) -> list[_Part]:
    """Runs of a policy over all scenarios, a block each."""
    return [
        _Part(spec.text, spec.name, spec.digest, config, scenarios[first : first + BLOCK], first, seed)
        for first in range(0, len(scenarios), BLOCK)
    ]


def _run_elsewhere(part: _Part) -> _Ran:
    """Run a policy that another process has chosen; what it is chosen by must be the same here."""
    spec = choose(part.text)
    if spec.digest != part.digest:
        raise InvalidValue(f"policy = {part.text!r}: has changed since it was chosen, or is another on this machine")
    return part.run(spec)


def _run_here(
    spec: PolicySpec,
    part: _Part,
    drives: JobStore[OptimisedDrive],
    where: Where,
    progress: Progress,
    bar: TaskID,
) -> _Ran:
    spread = partial(
        run_jobs,
        key=lambda scenario: [spec.name, part.config, scenario],
        store=drives,
        where=where,
        progress=progress,
        description=f"{spec.name}: preparing",
    )
    return part.run(spec, spread, lambda: progress.advance(bar))


def observation_of(policy: Policy, config: TaskConfig) -> task.Observation:
    """Observation that a policy acts on: by its knowledge, or else the task's own."""
    seen: dict[Knowledge, task.Observation] = {
        Knowledge.STATE: "state",
        Knowledge.FUTURE: "state",
        Knowledge.SENSORS: "sensors",
    }
    return seen.get(policy.knows, config.sensors or "state")


def write(folder: Path, comparison: Comparison, console: Console) -> None:
    """Write figures, table and picture of a comparison into a folder, then print the table."""
    from train.evaluate.figure import comparison_figure  # its libraries take a second, which every training would wait

    write_comparison(folder, comparison.families, comparison.rows, comparison.entries)
    comparison_figure(folder / "comparison.png", comparison.entries, comparison.still, comparison.families)
    console.print(rich_table(comparison.families))
    console.print(f"comparison: {folder / 'comparison.md'}, {folder / 'comparison.png'}")


def evaluate(policy: Policy, folder: Path, held_out: HeldOut, console: Console) -> None:
    """Compare an agent with the drum still and the paper's drives, and write the comparison into ``folder``."""
    specs = [as_spec(policy), *choose_all(AFTER_TRAINING)]
    write(folder, run_all(specs, held_out, console, jobs=folder / JOBS), console)
    (folder / JOBS).unlink()
