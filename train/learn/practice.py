"""A fixed set of scenarios to practise on, in half of which the winch saturates, and what training may know of them.

Most of the seas that a task draws ask little of the winch, and a learner that meets them as they come spends its effort
where nothing is left to gain. Here half of the scenarios saturate the winch. The reward is what a scenario adds to the
share of the heave that is left, so that a calm sea weighs as much as a rough one. The critic, which is no part of the
agent, is told the waves to come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from agents.control.optimum import required_speeds, saturating
from agents.policy import Policy
from agents.registry import DRUM_STILL, BuildContext, as_spec
from agents.rollout import drawn_scenarios, run

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]

SERIES: Final = 500_000_003
"""Series of the scenarios: this plus the seed of the training."""
DRAWN: Final = 5
"""As many times the scenarios that are wanted are drawn, to find enough in which the winch saturates."""
MEAN_REWARD: Final = 0.05
"""Mean loss in a control step with the base."""
FARTHEST: Final = 2.0
"""Root mean square of the depth error in a control step beyond which it costs no more, m."""
RESOLUTION: Final = 0.01
"""Share of a still drum's heave that is added to what the base leaves, where rewards are weighed."""
AHEAD: Final = (0, 2, 4, 6, 9, 12, 16, 20, 25, 30, 36, 42, 50)
"""Control steps to come whose waves the critic is told."""


@dataclass(frozen=True, kw_only=True)
class Practice:
    """N scenarios to practise on."""

    scenarios: Sequence[Scenario]
    weight: FloatArray
    """(N,) loss in a control step for a mean square depth error in it of 1 m², 1/m²."""
    waves: Float32Array
    """(N, n + 1, W) what the critic is told at each control step: the rope's speed that would hold the load still and
    its changes over a step, ``AHEAD``, as shares of the winch's greatest; how much the sea moves the load, and what
    share the base leaves."""

    @classmethod
    def of(cls, config: TaskConfig, base: Policy, count: int, seed: int) -> Practice:
        """Draw ``count`` scenarios of the task, and find what the ``base`` leaves in them, which is to be bettered."""
        scenarios = half_saturating(config, SERIES + seed, count)
        context = BuildContext(scenarios=scenarios, config=config)
        still, left = (run(spec.policy(context), scenarios, config).rms for spec in (DRUM_STILL, as_spec(base)))
        still = np.maximum(still, 1e-6)
        # The slope of the mean share that is left, √(mean square) / still, over a scenario's mean square.
        slope = 1.0 / ((left + RESOLUTION * still) * still)
        weight = MEAN_REWARD / np.mean(left / still) * slope
        return cls(scenarios=scenarios, weight=weight, waves=_waves(scenarios, config, still, left))

    def rewards(self, which: Indices, mean_square: FloatArray) -> FloatArray:
        """Rewards (n,) in scenarios ``which`` (n,), for mean squares (n,) m² of the depth error over a control step."""
        return np.asarray(-self.weight[which] * np.minimum(mean_square, FARTHEST**2))

    def told(self, which: Indices, step: Indices) -> Float32Array:
        """What the critic is told (n, W) at these control steps (n,) of scenarios ``which`` (n,)."""
        return np.asarray(self.waves[which, np.minimum(step, self.waves.shape[1] - 1)])


def half_saturating(config: TaskConfig, seed: int, count: int) -> list[Scenario]:
    """Scenarios of the task of which half saturate the winch, or as many as are found."""
    drawn = drawn_scenarios(config.source, seed, DRAWN * count)
    hard = saturating(drawn, config)
    chosen = np.flatnonzero(hard)[: count // 2].tolist()
    chosen += np.flatnonzero(~hard)[: count - len(chosen)].tolist()
    # A source whose every sea saturates the winch has no others.
    chosen += np.flatnonzero(hard)[count // 2 :][: count - len(chosen)].tolist()
    return [drawn[i] for i in chosen]


def _waves(scenarios: Sequence[Scenario], config: TaskConfig, still: FloatArray, left: FloatArray) -> Float32Array:
    speed = required_speeds(scenarios, config)
    padded = np.pad(speed, ((0, 0), (0, max(AHEAD) + 1)), mode="edge")
    change = np.diff(padded, axis=1) / config.control_period
    steps = np.arange(speed.shape[1])[:, None] + np.array(AHEAD)
    fastest = np.array([s.crane.winch.max_rope_speed for s in scenarios])[:, None, None]
    most = np.array([s.crane.winch.max_rope_acceleration for s in scenarios])[:, None, None]
    sea = np.stack([np.minimum(0.1 * still / left, 20.0), np.minimum(1.0 / still, 5.0)], axis=1)
    told = np.concatenate(
        [
            change[:, steps] / most,
            padded[:, steps] / fastest,
            np.repeat(sea[:, None], speed.shape[1], axis=1),
        ],
        axis=2,
    )
    return np.asarray(np.clip(told, -20.0, 20.0), dtype=np.float32)
