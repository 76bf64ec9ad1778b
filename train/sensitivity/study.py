"""One policy's share of a sensitivity study, the job of a worker process."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue, require_choice, require_integer
from agents import shipped
from agents.drives import map as drive_map
from agents.drives.map_policy import DriveMapPolicy
from agents.drives.optimisation import OPTIMISERS, OptimisedDrive, Optimiser
from agents.drives.policy import DrivePolicy
from agents.drives.tuned import TUNED
from agents.policy import DrumStill, FloatArray, Knowledge, Policy
from agents.registry import BuildContext, choose
from agents.rollout import held_out_scenarios, run
from train.sensitivity.analysis import Sensitivity, analyse
from train.shared.jobs import Where
from train.shared.run_folder import RunOptions
from train.shared.scenarios import ScenarioOptions

STILL, MAP = "drum still", "drive map"


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, Where, ScenarioOptions):
    """Policies and scenarios of the study."""

    policies: tuple[str, ...] = (
        STILL,
        *TUNED,
        MAP,
        "feed-forward + feedback",
        "ppo",
        "sac",
        "ppo-sensors",
        "sac-sensors",
    )
    """"drum still", "S-Ω1", "S-Ω2", "H-Ω1", "H-Ω2", "drive map", or an agent by its name or folder."""
    bounds: ClassVar[tuple[int, int]] = (1, 10_000)
    scenarios: int | Path = 8
    """Number of held-out scenarios that are assumed; or a TOML file with a scenario or a distribution of your own."""
    points: int = 9
    """Values of each factor, one at a time."""
    samples: int = 128
    """Base samples of the Sobol indices, a power of two: 8 times as many combinations, in every assumed scenario."""
    drive_map: str = shipped.DRIVE_MAP
    """The drive map: the shipped one by its name, or the folder of one."""
    optimiser: Optimiser = "nelder-mead"
    """Optimiser of the drives for Ω1."""
    seed: int = 0
    """Seed of the Sobol samples."""

    def __post_init__(self) -> None:
        Where.__post_init__(self)
        ScenarioOptions.__post_init__(self)
        if not self.policies or len(set(self.policies)) < len(self.policies):
            raise InvalidValue(f"policies = {self.policies}: must be at least one, each named once")
        require_integer("points", self.points, low=2, high=1001)
        require_integer("samples", self.samples, low=2, high=2**20)
        if self.samples & (self.samples - 1):
            raise InvalidValue(f"samples = {self.samples}: must be a power of two in [2, 1048576]")
        require_choice("optimiser", self.optimiser, OPTIMISERS)
        require_integer("seed", self.seed, low=0, high=2**32 - 1)
        for name in self.policies:
            if name not in (STILL, MAP, *TUNED) and choose(name).for_each_scenario:
                raise InvalidValue(f"policies: {name!r}: is optimised for each scenario as S-Ω1 and its like are here")

    @property
    def config(self) -> TaskConfig:
        """The task."""
        return TaskConfig(scenario=self.source)


@dataclass(frozen=True)
class Job:
    """One policy's share of the study."""

    name: str
    drives: tuple[OptimisedDrive, ...]
    """Tuned for the assumed scenarios, if the policy follows such."""
    still: tuple[float, ...]
    """RMS depth error with the drum still in the assumed scenarios, m."""
    options: Options


def identity(job: Job) -> list[Any]:
    """What fixes a job: the task, the study's size and seed, and the policy with the files that it comes from."""
    options = job.options
    digest = "" if job.name in (STILL, *TUNED) else choose(options.drive_map if job.name == MAP else job.name).digest
    size = (options.number, options.points, options.samples, options.seed)
    return [job.name, digest, job.drives, options.config, *size]


def _policy(job: Job) -> Policy:
    if job.name == STILL:
        return DrumStill()
    if job.name == MAP:
        return DriveMapPolicy(drive_map.load(job.options.drive_map), None)
    if job.name in TUNED:
        return DrivePolicy(job.name, job.drives, Knowledge.FUTURE)
    scenarios = assumed_scenarios(job.options)
    return choose(job.name).build(BuildContext(scenarios=scenarios, config=job.options.config))


def study(job: Job) -> Sensitivity:
    """Study one policy."""
    options = job.options
    assumed = assumed_scenarios(options)
    still = np.array(job.still)
    return analyse(_policy(job), assumed, still, options.config, options.points, options.samples, options.seed)


def assumed_scenarios(options: Options) -> list[Scenario]:
    """Scenarios that the policies are told."""
    return held_out_scenarios(options.source, options.number)


def still_rms(assumed: Sequence[Scenario]) -> FloatArray:
    """RMS depth error [m] with the drum still in each assumed scenario."""
    return run(DrumStill(), assumed).rms
