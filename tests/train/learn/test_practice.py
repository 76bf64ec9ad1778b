import numpy as np
import pytest
import torch

from aframe_env import ScenarioDistribution, task
from aframe_env.config import TaskConfig
from aframe_env.simulation import Simulation
from agents.control.optimum import saturating
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.learned.agent import output_zero
from agents.learned.features import FeatureConfig
from agents.policy import DrumStill
from agents.rollout import run
from train.learn import ppo
from train.learn.practice import AHEAD, MEAN_REWARD, Practice
from train.learn.sb3_env import TrainingVecEnv

CONFIG = TaskConfig(episode_duration=20.0, scenario=ScenarioDistribution(hs=(2.0, 4.0)))
FEATURES = FeatureConfig.of(CONFIG, "predictive")


@pytest.fixture(scope="module")
def practice():
    return Practice.of(CONFIG, output_zero(FEATURES), 12, seed=1)


def test_half_of_the_scenarios_saturate_the_winch(practice):
    assert len(practice.scenarios) == 12
    assert saturating(practice.scenarios, CONFIG).sum() == 6


def test_rewards_follow_the_share_of_the_heave_that_is_left(practice):
    """A little less depth error in one scenario raises the sum of rewards as it lowers the mean share that is left."""
    law = PredictiveControl(PlanningConfig(sensors=None, waves=FEATURES.waves))
    left = run(law, practice.scenarios, CONFIG).rms
    still = run(DrumStill(), practice.scenarios, CONFIG).rms
    which = np.arange(12)
    gain = (practice.rewards(which, (0.99 * left) ** 2) - practice.rewards(which, left**2)) / MEAN_REWARD
    share = left / still
    # √x has half the slope of x; calm seas, where next to nothing is left, count for a little less.
    expected = 0.02 * share / share.mean() * share / (share + 0.01)
    assert gain == pytest.approx(expected, rel=0.02)


def test_the_critic_is_told_the_waves_to_come(practice):
    """A load at rest needs the rope to follow the pulley: the rope's speed told is the pulley's."""
    simulation = Simulation(12, CONFIG.replaced(scenario=practice.scenarios[0]))
    simulation.reset_rows(np.arange(12), [(scenario, 0) for scenario in practice.scenarios])
    velocity = []
    for _ in range(150):
        velocity.append(simulation.state[:, task.PULLEY_VELOCITY_Z].copy())
        simulation.advance(np.zeros(12))
    velocity = np.array(velocity).T
    fastest = np.array([s.crane.winch.max_rope_speed for s in practice.scenarios])[:, None]
    step = np.full(12, 60)
    told = practice.told(np.arange(12), step)[:, len(AHEAD) : 2 * len(AHEAD)] * fastest
    came = velocity[:, 60 + np.array(AHEAD)]
    assert np.corrcoef(told.ravel(), came.ravel())[0, 1] > 0.99


def test_rows_are_in_the_scenarios_that_their_rewards_are_of(practice):
    rows = TrainingVecEnv(5, CONFIG, practice=practice, seed=2)
    observed = rows.reset()
    told = practice.waves.shape[2]
    for _ in range(30):
        cost_before = rows._simulation.results[:, task.OMEGA1].copy()
        which = rows._which.copy()
        observed, rewards, finished, infos = rows.step(np.zeros((5, 1), dtype=np.float32))
        cost = rows._simulation.results[:, task.OMEGA1] - cost_before
        going = ~finished
        assert rewards[going] == pytest.approx(practice.rewards(which, cost / 0.1)[going], rel=1e-3, abs=1e-9)
        for row in range(5):
            assert rows._simulation.scenarios[row] is practice.scenarios[rows._which[row]]
            step = rows._simulation.steps[row]
            np.testing.assert_array_equal(observed[row, -told:], practice.waves[rows._which[row], step])
        for row in np.flatnonzero(finished):
            assert infos[row]["terminal_observation"].shape == observed[row].shape


def test_the_actor_keeps_as_it_is_while_the_critic_learns_first():
    def learned(critic_first, updates):
        options = ppo.Options(n_envs=4, n_steps=8, batch_size=16, n_epochs=1, critic_first=critic_first, practice=4)
        learner = ppo.build(options)
        before = [p.clone() for p in learner.to_actor().parameters()]
        values = [p.clone() for p in learner.model.policy.value_net.parameters()]
        learner.model.learn(32 * updates)
        kept = all(torch.equal(a, b) for a, b in zip(before, learner.to_actor().parameters(), strict=True))
        same = all(torch.equal(a, b) for a, b in zip(values, learner.model.policy.value_net.parameters(), strict=True))
        assert not same
        return kept

    assert learned(2, 2)
    assert not learned(2, 3)
    assert not learned(0, 1)
