import json
from dataclasses import asdict

import numpy as np
import pytest
import torch

from aframe_env import InvalidValue, ScenarioDistribution
from aframe_env.env import AFrameHeaveEnv
from aframe_env.scenario.sensors import Sensors
from agents.control.expected_waves import ExpectedWaves
from agents.learned.agent import CARD, WEIGHTS, AgentCard, LearnedPolicy, card_text, digest, load, serialise
from agents.learned.feature_sets import feature_names
from agents.learned.features import ACTIONS, STATE_FEATURES, FeatureConfig
from agents.learned.network import Actor
from agents.policy import Knowledge
from agents.rollout import held_out_scenarios, run

WAVES = ExpectedWaves(frequency=(0.5, 0.7, 0.9, 1.2), variance=(0.05, 0.1, 0.1, 0.05), build_up=5.0)


def agent(observation="state", hidden=8, action="residual"):
    torch.manual_seed(1)
    sensors = None if observation == "state" else Sensors()
    features = feature_names(FeatureConfig(sensors=sensors, waves=WAVES, action=action))
    actor = Actor(len(features), hidden)
    weights = serialise(actor)
    card = AgentCard(
        algorithm="PPO",
        observation=observation,
        sensors=sensors,
        waves=WAVES,
        action=action,
        features=features,
        hidden=hidden,
        control_period=0.1,
        seed=7,
        timesteps=1234,
        versions={"torch": "2"},
        sha256=digest(weights),
    )
    return LearnedPolicy(actor, card), weights


def write(folder, policy, weights, **changes):
    (folder / WEIGHTS).write_bytes(weights)
    (folder / CARD).write_text(json.dumps({**json.loads(card_text(policy.card)), **changes}))


@pytest.mark.parametrize("action", ACTIONS)
@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_an_agent_comes_back_from_its_folder_as_it_was(observation, action, tmp_path):
    policy, weights = agent(observation, action=action)
    write(tmp_path, policy, weights)
    again = load(tmp_path)
    assert again.card == policy.card
    assert again.card.made_for == policy.card.made_for
    assert (again.card.made_for.waves, again.card.made_for.action) == (WAVES, action)
    assert again.knows is (Knowledge.STATE if observation == "state" else Knowledge.SENSORS)
    env = AFrameHeaveEnv(observation=observation)
    observed, _ = env.reset(seed=0)
    assert again.predict(observed).tobytes() == policy.predict(observed).tobytes()
    assert env.action_space.contains(again.predict(observed))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sha256": "0" * 64}, "does not match the sha256"),
        ({"format": 99}, "format = 99"),
        ({"format": 2}, "this version reads format 3"),
        ({"action": "force"}, r"\[action\] force not in literal"),
        ({"waves": {**asdict(WAVES), "build_up": -1.0}}, "build_up = -1.0 s"),
        ({"hidden": "8"}, r"\[hidden\] '8': must be of type int"),
        ({"hidden": 9}, "not the weights of the network"),
        ({"surprise": 1}, "unknown key 'surprise'"),
        ({"features": [f"x{i}" for i in range(len(STATE_FEATURES))]}, "the agent's features are"),
    ],
)
def test_files_that_do_not_belong_together_are_refused(changes, words, tmp_path):
    policy, weights = agent()
    write(tmp_path, policy, weights, **changes)
    with pytest.raises(InvalidValue, match=words):
        load(tmp_path)


def test_damaged_weights_are_refused(tmp_path):
    policy, weights = agent()
    write(tmp_path, policy, weights[:-1] + b"\x00")
    with pytest.raises(InvalidValue, match="sha256"):
        load(tmp_path)


def test_no_agent_and_no_json(tmp_path):
    with pytest.raises(InvalidValue, match=r"must be one of 'ppo', .*, or the folder of an agent"):
        load(tmp_path / "absent")
    with pytest.raises(InvalidValue, match="no agent in"):
        load(tmp_path)
    (tmp_path / WEIGHTS).write_bytes(b"")
    (tmp_path / CARD).write_text("{")
    with pytest.raises(InvalidValue, match="not JSON"):
        load(tmp_path)


def test_another_control_period_is_refused():
    policy, _ = agent()
    with pytest.raises(InvalidValue, match=r"trained for 0\.1 s"):
        policy.reset([], 0.2)


def test_an_agent_on_sensors_remembers_until_its_episode_ends():
    policy, _ = agent("sensors")
    env = AFrameHeaveEnv(observation="sensors", scenario=ScenarioDistribution(hs=4.0))
    first, _ = env.reset(seed=0)
    begun = policy.predict(first, first=True)
    for _ in range(30):
        observed = env.step(np.zeros(1, dtype=np.float32))[0]
        remembering = policy.predict(observed)
    assert remembering != policy.predict(observed, first=True)
    assert policy.predict(first, first=True) == begun


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_an_agent_acts_alike_alone_and_in_a_batch(observation):
    policy, _ = agent(observation)
    scenarios = held_out_scenarios(ScenarioDistribution(), 70)
    together = run(policy, scenarios, observation=observation, episode_duration=10.0)
    for count in (1, 66):
        fewer = run(policy, scenarios[:count], observation=observation, episode_duration=10.0)
        np.testing.assert_array_equal(together.error[:count], fewer.error)


def test_an_observation_of_the_wrong_length_is_refused():
    policy, _ = agent()
    with pytest.raises(InvalidValue, match=r"shape \(10,\): must be \(14,\)"):
        policy.predict(np.zeros(10, dtype=np.float32), first=True)
