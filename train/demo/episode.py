"""The lift that is shown."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario, ScenarioDistribution
from train.demo.policies import DURATION, build
from train.shared.episode import Episode, FloatArray

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


def begin(setting: Setting) -> Episode:
    """Begin the lift. Raises ``InvalidValue`` where there is no such policy or scenario."""
    policy, observation = build(setting.policy, setting.sensors)
    config = TaskConfig(observation=observation, episode_duration=DURATION)
    return Episode(policy, config, setting.scenario(), setting.seed)


def reduction(history: FloatArray) -> float:
    """Heave reduction over a history (n, 3): 1 - RMS / RMS(drum still); nan where the still load has not moved."""
    driven, still = np.sqrt(np.mean(history[:, 1:] ** 2, axis=0))
    return float(1.0 - driven / still) if still > 0.0 else math.nan
