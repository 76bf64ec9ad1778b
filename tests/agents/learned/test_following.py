"""Learners meet targets that move as an agent does that is scored: made to follow them, and to set down."""

import numpy as np
import pytest

from aframe_env.config import TaskConfig
from aframe_env.simulation import Simulation
from aframe_env.suite import find_task
from aframe_env.task import DRUM_SPEED
from agents.learned.agent import output_zero
from agents.learned.features import FeatureConfig
from agents.learned.following import FollowingFeatures
from agents.learned.interface import InterfaceConfig, LearnerFeatures
from agents.registry import BuildContext, as_spec
from agents.rollout import noise_seeds, run

ROWS = 3


def begun(name, observation, **arguments):
    task = find_task(name)
    config = TaskConfig(**{**task.arguments, "observation": observation, **arguments})
    scenarios = task.scenarios("train", ROWS)
    simulation = Simulation(ROWS, config.replaced(observation=config.sensors or "state", scenario=scenarios[0]))
    simulation.reset_rows(np.arange(ROWS), list(zip(scenarios, noise_seeds(0, ROWS), strict=True)))
    return config, scenarios, simulation


@pytest.mark.parametrize(
    ("name", "observation", "action"),
    [("Splash", "sensors", "predictive"), ("Landing", "sensors", "residual"), ("Landing", "state", "predictive")],
)
def test_rows_of_output_zero_do_what_the_agent_of_output_zero_does(name, observation, action):
    config, scenarios, simulation = begun(name, observation, episode_duration=40.0)
    features = LearnerFeatures.of(config, ROWS, InterfaceConfig(action=action))
    features.start(simulation.observe(), simulation.state, scenarios)
    drum_speed = [simulation.state[:, DRUM_SPEED].astype(np.float32)]
    for _ in range(config.steps):
        simulation.advance(features.command(np.zeros(ROWS)))
        features.advance(simulation.observe(), simulation.state)
        drum_speed.append(simulation.state[:, DRUM_SPEED].astype(np.float32))
    policy = as_spec(output_zero(FeatureConfig.of(config, action)))
    expected = run(policy.policy(BuildContext(scenarios=scenarios, config=config)), scenarios, config)
    np.testing.assert_array_equal(np.array(drum_speed).T, expected.drum_speed)
    # It followed: the target is metres lower at the end.
    assert (expected.rms < 1.0).all()


def test_a_row_that_starts_anew_follows_its_target_from_the_start():
    """The commands of a row do not depend on when it started beside others."""
    config, scenarios, simulation = begun("Landing", "sensors")
    made_for = FeatureConfig.of(config)
    features, alone = FollowingFeatures(ROWS, made_for), FollowingFeatures(1, made_for)
    features.start(simulation.observe(), scenarios)
    late, anew = 170, np.array([1])
    for step in range(late + 220):
        if step == late:
            simulation.reset_rows(anew, [(scenarios[1], 5)])
            features.start(simulation.observe()[anew], [scenarios[1]], anew)
            alone.start(simulation.observe()[anew], [scenarios[1]])
        command = features.command(np.zeros(ROWS))
        if step >= late:
            assert command[1] == pytest.approx(alone.command(np.zeros(1))[0], abs=1e-9)
        simulation.advance(command)
        observation = simulation.observe()
        features.advance(observation)
        if step >= late:
            alone.advance(observation[anew])
