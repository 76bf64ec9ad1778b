"""Policies that were made for light ropes in air, on heavy ropes in water, as they are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

from aframe_env.config import TaskConfig
from aframe_env.scenario import Sensors
from agents import shipped
from agents.policy import FloatArray
from agents.registry import BuildContext, PolicySpec, choose
from agents.rollout import held_out_scenarios, run
from train.deep_water.lifts import lifts
from train.evaluate.run import observation_of

CEILING: Final = "S-Ω1 for each scenario, Gauss-Newton"
"""The paper's spline, found for each lift with its whole future known: what the winch can do."""
POLICIES: Final = (
    "drum still",
    CEILING,
    "inverse dynamics",
    "predictive control (state)",
    "feed-forward + feedback (state)",
    "drive-map:state",
    "output zero",
    "predictive control",
    "feed-forward + feedback",
    shipped.DRIVE_MAP,
    "output zero on sensors",
    "ppo",
    "ppo-sensors",
    "ppo-speed",
    "predictive-ppo",
    "predictive-ppo-sensors",
    "sac",
    "sac-sensors",
    "sac-speed",
)
"""By their names on the command line; of each agent one seed."""
ON_SENSORS: Final = (
    "predictive control",
    "feed-forward + feedback",
    shipped.DRIVE_MAP,
    *(name for name in POLICIES if name.endswith("sensors")),
)


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A policy at one depth."""

    policy: str
    depth: float
    """m below the pulley."""
    count: int
    """Held-out lifts."""
    transponder: bool = False
    """Whether the load's depth is told by a transponder, late and seldom; else by the default sensor."""

    @property
    def spec(self) -> PolicySpec:
        """The policy."""
        return choose(self.policy)

    @property
    def key(self) -> list[Any]:
        """What fixes the trial."""
        spec = self.spec
        return [spec.name, spec.digest, self.config, self.count]

    @property
    def config(self) -> TaskConfig:
        """The task."""
        sensors = Sensors.transponder(self.depth) if self.transponder else None
        return TaskConfig(scenario=lifts(self.depth, sensors))


@dataclass(frozen=True)
class Left:
    """What a policy left of the heave."""

    name: str
    knows: str
    rms: FloatArray
    """(N,) depth error, m."""
    greatest: FloatArray
    """(N,) m."""
    parted: int
    """Ropes that parted."""


def key(trial: Trial) -> list[Any]:
    """What fixes a trial."""
    return trial.key


def try_policy(trial: Trial) -> Left:
    """Run a policy through the lifts of a depth."""
    scenarios, config = held_out_scenarios(trial.config.source, trial.count), trial.config
    policy = trial.spec.build(BuildContext(scenarios=scenarios, config=config))
    episodes = run(policy, scenarios, config.replaced(observation=observation_of(policy, config)))
    return Left(policy.name, policy.knows.value, episodes.rms, episodes.omega2, int(episodes.parted.sum()))


def trials(depths: tuple[float, ...], count: int) -> list[Trial]:
    """All trials; those on sensors once more with a transponder."""
    plain = [Trial(policy=policy, depth=depth, count=count) for depth in depths for policy in POLICIES]
    return plain + [replace(each, transponder=True) for each in plain if each.policy in ON_SENSORS]
