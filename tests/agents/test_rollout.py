import dataclasses

import numpy as np
import pytest

from aframe_env import Crane, Rope, ScenarioDistribution
from aframe_env.env import AFrameHeaveEnv
from agents.policy import DrumStill, Knowledge
from agents.rollout import held_out_scenarios, run


class Sine:
    """A policy that moves the drum, for comparison."""

    name = "sine"
    knows = Knowledge.CLOCK

    def reset(self, scenarios, control_period):
        self.rows = len(scenarios)

    def act(self, observation, time):
        return np.full(self.rows, 0.5 * np.sin(time))


def test_held_out_scenarios_are_the_same_whatever_their_number():
    distribution = ScenarioDistribution()
    assert held_out_scenarios(distribution, 5)[:3] == held_out_scenarios(distribution, 3)


def test_a_run_is_what_the_scalar_environment_gives():
    scenarios = held_out_scenarios(ScenarioDistribution(), 3)
    episodes = run(Sine(), scenarios, episode_duration=20.0)
    env = AFrameHeaveEnv(scenario=scenarios[2], episode_duration=20.0)
    env.reset(seed=0)
    total, time = 0.0, 0.0
    for _ in range(200):
        _, reward, _, _, info = env.step(np.array([0.5 * np.sin(time)], dtype=np.float32))
        total, time = total - reward, info["time"]
    assert episodes.omega1[2] == pytest.approx(total, rel=1e-6)
    assert episodes.omega2[2] == pytest.approx(info["omega2"], rel=1e-6)


def test_a_lost_load_is_charged_once_and_marked():
    base = held_out_scenarios(ScenarioDistribution(), 2)
    weak = Crane(rope=Rope(breaking_load=1.05 * base[0].weight))
    scenarios = [dataclasses.replace(base[0], crane=weak), base[1]]
    episodes = run(DrumStill(), scenarios, episode_duration=60.0)
    assert episodes.parted.tolist() == [True, False]
    env = AFrameHeaveEnv(scenario=scenarios[0], episode_duration=60.0)
    env.reset(seed=0)
    total, terminated = 0.0, False
    while not terminated:
        _, reward, terminated, _, _ = env.step(np.zeros(1, dtype=np.float32))
        total -= reward
    assert episodes.omega1[0] == pytest.approx(total, rel=1e-9)
