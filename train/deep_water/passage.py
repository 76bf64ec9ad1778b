"""Lowering through the resonance of load and rope."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario, Sea, SeaMotion, Sensors, Vessel, Water
from aframe_env.scenario.target import TargetPath
from aframe_env.suite.deep_rope import DEEP_CRANE, MANIFOLD, steel_load
from agents.control.lowering import Following
from agents.policy import DrumStill, FloatArray, Policy
from agents.registry import BuildContext, choose
from agents.rollout import run
from train.deep_water.lifts import lifts

START: Final = 25.0
"""Time at which the lowering begins, s."""
CORNER: Final = 40.0
"""Time over which it gathers speed, and comes to rest, s: several times the period of the bobbing."""
EVERY: Final = 2
"""Control steps from one depth error that is kept to the next."""
POLICIES: Final = ("drum still", "feed-forward + feedback", "predictive control", "ppo-sensors")


@dataclass(frozen=True, kw_only=True)
class Passage:
    """A lowering in one sea, with one policy beside the planned pay-out."""

    policy: str
    top: float
    """Depths below the pulley where it begins and ends, m."""
    bottom: float
    speed: float
    """m/s."""
    hs: float = 1.5
    """m."""
    tp: float = 9.0
    """s."""

    @property
    def scenario(self) -> Scenario:
        """The lowering: a load of 100 t with its added mass."""
        sea = Sea(hs=self.hs, tp=self.tp, heading=math.radians(150.0), components=128, seed=0)
        path = TargetPath.lowering(self.top - self.bottom, self.speed, START, CORNER)
        return Scenario(
            crane=DEEP_CRANE,
            motion=SeaMotion(sea=sea, vessel=Vessel.supply()),
            load_mass=MANIFOLD,
            target_level=DEEP_CRANE.pulley_position[2] - self.top,
            ramp=10.0,
            water=Water(),
            load=steel_load(MANIFOLD),
            target_path=path,
        )

    @property
    def duration(self) -> float:
        """s."""
        return START + (self.bottom - self.top) / self.speed + 0.5 * CORNER + 20.0

    @property
    def depths(self) -> FloatArray:
        """(n,) m of the target below the pulley at the moments that are kept."""
        path = self.scenario.target_path
        assert path is not None
        steps = np.arange(0, round(self.duration / 0.1) + 1, EVERY)
        return np.array([self.top - path.at(0.1 * step)[0] for step in steps.tolist()])


@dataclass(frozen=True)
class Passed:
    """Depth error on the way."""

    name: str
    error: npt.NDArray[np.float64]
    """(n,) m, every ``EVERY`` control steps."""
    parted: bool
    slack: int
    """Times that the rope went slack."""
    peak_tension: float
    """N."""


def key(passage: Passage) -> list[Any]:
    """What fixes a passage."""
    return [choose(passage.policy).digest, passage]


def lower(passage: Passage) -> Passed:
    """Lower the load."""
    config = TaskConfig(scenario=passage.scenario, episode_duration=passage.duration)
    sensors = None if passage.policy == DrumStill.name else Sensors()
    policy = Following(_policy(passage), sensors)
    seen = config.replaced(observation=sensors or "state")
    episodes = run(policy, [passage.scenario], seen)
    return Passed(
        policy.policy.name,
        episodes.error[0, ::EVERY].astype(np.float64),
        bool(episodes.parted[0]),
        int(episodes.slack_events[0]),
        float(episodes.peak_tension[0]),
    )


def _policy(passage: Passage) -> Policy:
    # Laws expect the seas of the zero-shot table, not the one that they are in.
    config = TaskConfig(scenario=lifts(1000.0))
    return choose(passage.policy).build(BuildContext(scenarios=[passage.scenario], config=config))


def running(error: FloatArray, window: int) -> FloatArray:
    """RMS of a depth error over ``window`` neighbours, (n,)."""
    weight = np.ones(window)
    return np.sqrt(np.convolve(error**2, weight, "same") / np.convolve(np.ones_like(error), weight, "same"))


def bobbing_periods(passage: Passage, depths: FloatArray) -> FloatArray:
    """Period [s] of the load's bobbing at depths (n,) m: the mass that moves on the rope's spring."""
    rope, load = DEEP_CRANE.rope, steel_load(MANIFOLD)
    mass = MANIFOLD + load.added_mass_vertical + rope.mass_per_length * depths / 3.0
    return np.asarray(2.0 * np.pi * np.sqrt((depths + DEEP_CRANE.drum_to_pulley) * mass / rope.axial_stiffness))
