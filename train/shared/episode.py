"""An episode to be watched: the same scenario twice in step, under a policy and with the drum still."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.rendering.history import History
from aframe_env.rendering.scene import Scene, scene_of
from aframe_env.scenario import Scenario
from aframe_env.simulation import Simulation
from agents.policy import Policy, begin

FloatArray = npt.NDArray[np.float64]

DRIVEN, STILL = 0, 1
"""Rows: under the policy, with the drum still."""


@dataclass(frozen=True)
class Moment:
    """The episode at one time."""

    driven: Scene
    still: Scene


class Episode:
    """An episode, advanced one control step at a time."""

    def __init__(self, policy: Policy, config: TaskConfig, scenario: Scenario, noise_seed: int) -> None:
        """Begin; ``config`` has the observation that the policy acts on, ``noise_seed`` draws the sensors' noise."""
        self.policy, self.scenario = policy, scenario
        self.on_sensors = config.sensors is not None
        self._simulation = Simulation(2, config.replaced(scenario=scenario))
        self._simulation.reset_rows(np.arange(2), [(scenario, noise_seed)] * 2)
        begin(policy, [scenario], config.control_period)
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
        """Advance both rows by one control step."""
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
        """The episode at a time within the last control step, s."""
        length = self.time - self._before.driven.time
        share = 1.0 if length == 0.0 else min(max(1.0 - (self.time - time) / length, 0.0), 1.0)
        return Moment(
            between(self._before.driven, self._now.driven, share), between(self._before.still, self._now.still, share)
        )

    def history(self) -> FloatArray:
        """Time [s] and depth error [m] under the policy and with the drum still, of the last minute: (n, 3)."""
        return np.column_stack([self.own_history()[:, :2], self._history.of(STILL)[:, 1]])

    def own_history(self) -> FloatArray:
        """Time [s], depth error under the policy and heave of the pulley [m], of the last minute: (n, 3)."""
        return self._history.of(DRIVEN)

    def _moment(self) -> Moment:
        return Moment(scene_of(self._simulation, DRIVEN), scene_of(self._simulation, STILL))


def between(before: Scene, after: Scene, share: float) -> Scene:
    """Return the scene at a share in [0, 1] of the way from one to the next: a control step is short."""
    moving = (
        "time",
        "deck",
        "rotation",
        "pulley",
        "luffing_angle",
        "pulley_heave",
        "load",
        "drum_angle",
        "rope_length",
    )
    return replace(
        after,
        **{name: (1.0 - share) * getattr(before, name) + share * getattr(after, name) for name in moving},
    )
