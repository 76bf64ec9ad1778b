import json
from dataclasses import asdict

import numpy as np
import pytest
import torch
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from aframe_env import Crane, InvalidValue, Scenario, ScenarioDistribution, Winch
from aframe_env.env import AFrameHeaveEnv
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import PULLEY_VELOCITY_Z
from agents import FeaturePolicy, cards
from agents.control.expected_waves import ExpectedWaves
from agents.learned.agent import CARD, WEIGHTS, AgentCard, LearnedPolicy, card_text, digest, load, serialise
from agents.learned.feature_sets import feature_names
from agents.learned.features import ACTIONS, STATE_FEATURES, FeatureConfig
from agents.learned.network import Actor
from agents.policy import Knowledge
from agents.rollout import held_out_scenarios, run

WAVES = ExpectedWaves(frequency=(0.5, 0.7, 0.9, 1.2), variances=((0.05, 0.1, 0.1, 0.05),), build_up=5.0)


def agent(observation="state", hidden=8, action="residual", winch=False):
    torch.manual_seed(1)
    sensors = None if observation == "state" else Sensors()
    features = feature_names(FeatureConfig(sensors=sensors, waves=WAVES, action=action, winch=winch))
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
    card = json.loads(card_text(policy.card))
    del card[cards.DIGEST]
    (folder / CARD).write_text(json.dumps(cards.sealed({**card, **changes})))


def test_an_agent_that_was_told_the_winch_says_so_by_its_features(tmp_path):
    policy, weights = agent("sensors", winch=True)
    write(tmp_path, policy, weights)
    back = load(tmp_path)
    assert back.card.made_for.winch
    assert not agent("sensors")[0].card.made_for.winch
    scenarios = held_out_scenarios(ScenarioDistribution(max_rope_speed=(1.5, 2.5)), 2)
    one, other = (run(each, scenarios, episode_duration=2.0, observation="sensors") for each in (policy, back))
    assert np.array_equal(one.error, other.error)


def test_an_agent_that_was_trained_on_a_task_says_so_by_its_name_and_plans_as_it_did_there(tmp_path):
    policy, weights = agent("sensors", action="predictive")
    write(tmp_path, policy, weights, task="AFrameHeave-DeepRope-v0", adapts=True, light=False)
    back = load(tmp_path)
    assert policy.name == "PPO on sensors"
    assert back.name == "PPO on sensors, trained on DeepRope"
    assert (back.card.made_for.adapts, back.card.made_for.light) == (True, False)
    assert (policy.card.made_for.adapts, policy.card.made_for.light) == (False, True)


def test_a_card_from_before_there_were_tasks_means_what_it_did(tmp_path):
    policy, weights = agent("sensors", action="predictive")
    (tmp_path / WEIGHTS).write_bytes(weights)
    card = json.loads(card_text(policy.card))
    for name in (cards.DIGEST, "task", "adapts", "light"):
        del card[name]
    (tmp_path / CARD).write_text(json.dumps(cards.sealed(card)))
    assert load(tmp_path).card == policy.card


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
    assert again.predict(observed)[0].tobytes() == policy.predict(observed)[0].tobytes()
    assert env.action_space.contains(again.predict(observed)[0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sha256": "0" * 64}, "does not match the sha256"),
        ({"format": 99}, "format = 99"),
        ({"format": 4}, "this version reads format 5"),
        ({"action": "force"}, r"\[action\] force not in literal"),
        ({"waves": {**asdict(WAVES), "build_up": -1.0}}, "build_up = -1.0 s"),
        ({"hidden": "8"}, r"\[hidden\] '8': must be of type int"),
        ({"hidden": 9}, "not the weights of the network"),
        ({"surprise": 1}, "unknown key 'surprise'"),
        ({"task": "Calm"}, "task = 'Calm': must be one of"),
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
    begun, memory = policy.predict(first)
    for _ in range(30):
        observed = env.step(np.zeros(1, dtype=np.float32))[0]
        remembering, memory = policy.predict(observed, memory)
    assert remembering != policy.predict(observed)[0]
    assert policy.predict(first, memory, np.ones(1, dtype=bool))[0] == begun == policy.predict(first)[0]


def test_a_memory_that_was_given_stays_as_it_is():
    policy, _ = agent("sensors")
    env = AFrameHeaveEnv(observation="sensors")
    _, memory = policy.predict(env.reset(seed=0)[0])
    observed = env.step(np.ones(1, dtype=np.float32))[0]
    actions = [policy.predict(observed, memory)[0] for _ in range(2)]
    assert actions[0] == actions[1]


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_rows_that_begin_anew_do_so_alone(observation):
    """Each row's actions are, up to rounding, those of the protocol's ``act`` on each of its episodes by itself."""
    policy, _ = agent(observation)
    rng = np.random.default_rng(0)
    lengths = ((13, 7, 10), (9, 21), (30,))
    envs = [AFrameHeaveEnv(observation=observation) for _ in lengths]
    observed = np.zeros((30, 3, *envs[0].observation_space.shape), dtype=np.float32)
    starts = np.zeros((30, 3), dtype=bool)
    for row, (env, episodes) in enumerate(zip(envs, lengths, strict=True)):
        step = 0
        for seed, length in enumerate(episodes):
            starts[step, row] = True
            observed[step, row] = env.reset(seed=100 * row + seed)[0]
            for i in range(step + 1, step + length):
                observed[i, row] = env.step(rng.uniform(-1.0, 1.0, 1).astype(np.float32))[0]
            step += length
    memory, actions = None, np.zeros((30, 3))
    for step in range(30):
        found, memory = policy.predict(observed[step], memory, starts[step])
        assert found.shape == (3, 1)
        assert found.dtype == np.float32
        actions[step] = found[:, 0]
    alone, _ = agent(observation)
    for row in range(3):
        for step in range(30):
            if starts[step, row]:
                alone.reset([Scenario.paper()], 0.1)
            expected = alone.act(observed[step, row][None], 0.0)[0]
            assert actions[step, row] == pytest.approx(expected, rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("kind", ["agent", "function"])
def test_evaluate_policy_of_stable_baselines3_gives_the_task_s_return(kind):
    """That of the comparison's own rollout, with the drum's turns by ``act``, in rows that end at different times."""
    policy = agent("sensors")[0] if kind == "agent" else FeaturePolicy(lambda f: np.tanh(f[:, 0] - 0.3))
    observation = "sensors" if kind == "agent" else "state"
    scenarios = [ScenarioDistribution().draw(np.random.default_rng(i)) for i in range(2)]

    def made(i):
        return lambda: Monitor(
            AFrameHeaveEnv(scenario=scenarios[i], observation=observation, max_episode_steps=150 + 50 * i)
        )

    rewards, lengths = evaluate_policy(
        policy, DummyVecEnv([made(0), made(1)]), n_eval_episodes=4, return_episode_rewards=True
    )
    by_length = {150: [], 200: []}
    for reward, length in zip(rewards, lengths, strict=True):
        by_length[length].append(reward)
    for i, found in enumerate(by_length.values()):
        if observation == "state":  # sensors' noise differs from episode to episode
            env = AFrameHeaveEnv(scenario=scenarios[i], observation=observation, max_episode_steps=150 + 50 * i)
            policy.reset([scenarios[i]], 0.1)
            observed, total, done = env.reset()[0], 0.0, False
            while not done:
                observed, reward, _, done, _ = env.step(policy.act(observed[None], 0.0).astype(np.float32))
                total += reward
            assert found == pytest.approx([total] * 2, rel=1e-4)
        else:
            assert len(found) == 2
            assert np.isfinite(found).all()


def test_an_agent_is_told_its_crane_once():
    policy, _ = agent()
    observed, _ = AFrameHeaveEnv(scenario=ScenarioDistribution(hs=4.0)).reset(seed=0)
    moving = observed.copy()
    moving[PULLEY_VELOCITY_Z] = 0.5
    reference = policy.predict(moving)[0]
    policy.crane = Crane(winch=Winch(drum_diameter=3.0))
    assert abs(policy.predict(moving)[0]) < abs(reference)
    scenario = Scenario.paper(crane=policy.crane)
    policy.reset([scenario], 0.1)
    assert policy.predict(moving)[0] == np.float32(policy.act(moving[None], 0.0)[0])


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
    with pytest.raises(InvalidValue, match=r"shape \(10,\): must be \(14,\) or \(N, 14\), .*observation=\"state\""):
        policy.predict(np.zeros(10, dtype=np.float32))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (({"a": np.zeros(14)},), "must be an array of numbers"),
        ((np.zeros((1, 2, 14)),), r"shape \(1, 2, 14\)"),
        ((np.zeros((2, 14)), (np.zeros(3),)), r"state = \(array.*must be what the last predict\(\) of 2 rows returned"),
        (
            (np.zeros((2, 14)), "one row"),
            r"state = a memory of 1: must be what the last predict\(\) of 2 rows returned",
        ),
        ((np.zeros(14), "one row", [True, False]), r"episode_start of shape \(2,\): must be \(1,\)"),
    ],
)
def test_what_predict_cannot_take_is_named(arguments, words):
    policy, _ = agent()
    memory = policy.predict(AFrameHeaveEnv().reset(seed=0)[0])[1]
    with pytest.raises(InvalidValue, match=words):
        policy.predict(*(memory if isinstance(each, str) else each for each in arguments))
