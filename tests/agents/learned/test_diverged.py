"""A network whose training has diverged is refused, whoever sees it first."""

from __future__ import annotations

import gymnasium
import pytest

from aframe_env import InvalidValue, ScenarioDistribution, TaskConfig
from agents.learned.agent import LearnedPolicy, load, serialise
from agents.rollout import drawn_scenarios, run


@pytest.fixture
def diverged() -> LearnedPolicy:
    policy = load("ppo")
    next(policy.actor.parameters()).data.fill_(float("nan"))
    return policy


def test_it_gives_no_command(diverged: LearnedPolicy) -> None:
    with pytest.raises(InvalidValue, match="residual PPO gave an output that is not finite"):
        run(diverged, drawn_scenarios(ScenarioDistribution(), 0, 2), TaskConfig(episode_duration=1.0))
    with pytest.raises(InvalidValue, match="residual PPO gave an output that is not finite"):
        diverged.predict(gymnasium.make("AFrameHeave-v0").reset(seed=0)[0])


def test_it_is_not_written(diverged: LearnedPolicy) -> None:
    with pytest.raises(InvalidValue, match="weights are not finite: the training has diverged"):
        serialise(diverged.actor)
