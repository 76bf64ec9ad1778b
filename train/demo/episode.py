"""The lift that is shown: the same scenario twice in step, under a policy and with the drum still."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.rendering.history import History
from aframe_env.rendering.scene import Scene, scene_of
from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.simulation import Simulation
from train.demo.policies import DURATION, build

FloatArray = npt.NDArray[np.float64]

DRIVEN, STILL = 0, 1
"""Rows: under the policy, with the drum still."""
RUN_IN: Final = 30.0
"""Time of a new lift that is over when it is first shown, s: the sea has built up, and there is a curve to see."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What fixes a lift."""

    policy: str
    """Name, folder or function, in the registry's words."""
    sensors: bool
    """Observation of a policy that is made for neither: sensors or the full state."""
    hs: float
    """Significant wave height, m."""
    tp: float
    """Peak period, s."""
    heading: float
    """Direction that the waves travel towards, rad from the bow."""
    load_mass: float
    """kg."""
    rope_length: float
    """|LS| with the ship at rest, m."""
    seed: int
    """Draws the sea's realisation, the rope's damping and the sensors' noise."""

    def scenario(self) -> Scenario:
        """Return the scenario."""
        distribution = ScenarioDistribution(
            hs=self.hs, tp=self.tp, heading=self.heading, load_mass=self.load_mass, rope_length=self.rope_length
        )
        return distribution.draw(np.random.default_rng(self.seed))


@dataclass(frozen=True)
class Moment:
    """The lift at one time."""

    driven: Scene
    still: Scene


class Episode:
    """A lift, advanced one control step at a time."""

    def __init__(self, setting: Setting) -> None:
        """Begin. Raises ``InvalidValue`` where there is no such policy or scenario."""
        self.policy, observation = build(setting.policy, setting.sensors)
        self.scenario = setting.scenario()
        config = TaskConfig(scenario=self.scenario, observation=observation, episode_duration=DURATION)
        self.on_sensors = config.sensors is not None
        self._simulation = Simulation(2, config)
        self._simulation.reset_rows(np.arange(2), [(self.scenario, setting.seed)] * 2)
        self.policy.reset([self.scenario], config.control_period)
        self._history = History(config.control_period)
        self._history.record(self._simulation)
        self._before = self._now = self._moment()

    @property
    def time(self) -> float:
        """s."""
        return self._now.driven.time

    @property
    def over(self) -> bool:
        """True when the time is up."""
        return bool(self._simulation.steps[DRIVEN] >= self._simulation.episode_steps)

    def step(self) -> None:
        """Advance both lifts by one control step."""
        commands = np.zeros(2)
        commands[DRIVEN] = self.policy.act(self._simulation.observe()[:1], self.time)[0]
        self._simulation.advance(commands)
        self._history.record(self._simulation)
        self._before, self._now = self._now, self._moment()

    def advance_to(self, time: float) -> None:
        """Advance until ``time`` s, or until the time is up."""
        while self.time < time - 1e-9 and not self.over:
            self.step()

    def at(self, time: float) -> Moment:
        """The lift at a time within the last control step, s."""
        length = self.time - self._before.driven.time
        share = 1.0 if length == 0.0 else min(max(1.0 - (self.time - time) / length, 0.0), 1.0)
        return Moment(
            between(self._before.driven, self._now.driven, share), between(self._before.still, self._now.still, share)
        )

    def history(self) -> FloatArray:
        """Time [s] and depth error [m] under the policy and with the drum still, of the last minute: (n, 3)."""
        driven, still = self._history.of(DRIVEN), self._history.of(STILL)
        return np.column_stack([driven[:, :2], still[:, 1]])

    def _moment(self) -> Moment:
        return Moment(scene_of(self._simulation, DRIVEN), scene_of(self._simulation, STILL))


def between(before: Scene, after: Scene, share: float) -> Scene:
    """Return the scene at a share in [0, 1] of the way from one to the next: a control step is short."""
    moving = ("time", "deck", "rotation", "pulley", "pulley_heave", "load", "drum_angle", "rope_length")
    return replace(
        after,
        **{name: (1.0 - share) * getattr(before, name) + share * getattr(after, name) for name in moving},
    )


def reduction(history: FloatArray) -> float:
    """Heave reduction over a history (n, 3): 1 - RMS / RMS(drum still); nan where the still load has not moved."""
    driven, still = np.sqrt(np.mean(history[:, 1:] ** 2, axis=0))
    return float(1.0 - driven / still) if still > 0.0 else math.nan
