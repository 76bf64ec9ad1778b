"""The best agent of a training: looked at now and then, on scenarios that are neither those of training nor held out.

A learner that explores may end worse than it was, and worse than the hand-written base that it began with. What a
training gives is the best that was looked at, the first of all included.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from agents.policy import FloatArray
from agents.registry import DRUM_STILL, BuildContext, PolicySpec, as_spec
from agents.rollout import run
from train.learn.learner import Learner
from train.learn.options import LearningOptions
from train.learn.practice import half_saturating
from train.learn.trained import to_policy

VALIDATION_SEED: Final = 8_000_001
"""Seed of the scenarios that agents are looked at on."""
LOOKS: Final = 8
"""In a training, beside the one before it."""


class KeepBest(BaseCallback):
    """Look at the agent between two rollouts, and keep the best."""

    def __init__(self, learner: Learner, options: LearningOptions) -> None:
        super().__init__()
        self._learner, self._options = learner, options
        self._scenarios = half_saturating(options.config, VALIDATION_SEED, options.selected_by)
        self._task = BuildContext(scenarios=self._scenarios, config=options.config)
        self._still = np.maximum(self._rms(DRUM_STILL), 1e-6)
        self._every = max(1, options.timesteps // LOOKS)
        self._looked = -1

    def _on_training_start(self) -> None:
        # A training that goes on has looked at everything up to here.
        self._looked = (self.num_timesteps - 1) // self._every

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        look = self.num_timesteps // self._every
        if look != self._looked:
            self._looked = look
            self._look()

    def _on_training_end(self) -> None:
        self._look()

    def _look(self) -> None:
        policy = to_policy(self._learner, self._options)[0]
        left = float(np.mean(self._rms(as_spec(policy)) / self._still))
        self.logger.record("selection/heave_left", left)
        best = self._learner.best
        if left < best.left:
            best.left, best.timesteps, best.actor = left, self.num_timesteps, self._learner.to_actor()

    def _rms(self, spec: PolicySpec) -> FloatArray:
        """What a policy leaves (N,) m, as it is compared: made to follow a target that moves."""
        return run(spec.policy(self._task), self._scenarios, self._task.config).rms
