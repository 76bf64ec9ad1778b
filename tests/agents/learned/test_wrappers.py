"""The public interface against the agents' own features, step by step."""

import math
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RescaleAction
from stable_baselines3.common.env_checker import check_env as check_env_for_sb3

import aframe_env
from aframe_env import InvalidValue, ScenarioDistribution
from agents import AgentInterface, AgentVectorInterface, FeaturePolicy, InterfaceConfig
from agents.learned.agent import output_zero
from agents.learned.feature_sets import features_for
from agents.learned.features import ACTIONS, SENSED_FEATURES, STATE_FEATURES, FeatureConfig
from agents.rollout import held_out_scenarios, run

OBSERVATIONS = pytest.mark.parametrize("observation", ["state", "sensors"])
MODES = pytest.mark.parametrize("mode", ["NextStep", "SameStep"])


def scalar(observation="state", **arguments):
    return gymnasium.make(aframe_env.ENV_ID, observation=observation, **arguments)


def vector(rows, observation="state", mode="SameStep", **arguments):
    return gymnasium.make_vec(
        aframe_env.ENV_ID,
        num_envs=rows,
        vectorization_mode="vector_entry_point",
        autoreset_mode=gymnasium.vector.AutoresetMode(mode),
        observation=observation,
        **arguments,
    )


def outputs(steps, rows, seed=1):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, rows, 1)).astype(np.float32)


@pytest.mark.parametrize("action", ACTIONS)
@OBSERVATIONS
def test_observations_are_the_agents_own_features(observation, action):
    env, bare = AgentInterface(scalar(observation), action=action), scalar(observation)
    seen, _ = env.reset(seed=3)
    first, _ = bare.reset(seed=3)
    features = features_for(1, FeatureConfig.of(bare.unwrapped.simulation.config, action))
    assert env.feature_names == features.names
    np.testing.assert_array_equal(seen, features.start(first[None], [bare.unwrapped.scenario])[0])
    for output in outputs(40, 1)[:, 0]:
        seen, _, _, _, info = env.step(output)
        observed, _, _, _, same = bare.step(features.command(output.astype(np.float64)))
        np.testing.assert_array_equal(seen, features.advance(observed[None])[0])
        assert info["omega1"] == same["omega1"]


@OBSERVATIONS
def test_an_output_of_zero_is_the_hand_written_base(observation):
    env = AgentInterface(scalar(observation))
    env.reset(seed=4)
    for _ in range(100):
        info = env.step(np.zeros(1, dtype=np.float32))[-1]
    made_for = FeatureConfig.of(env.unwrapped.simulation.config)
    base, bare = output_zero(made_for), scalar(observation)
    observed, _ = bare.reset(seed=4)
    base.reset([bare.unwrapped.scenario], 0.1)
    for step in range(100):
        observed, *_, same = bare.step(base.act(observed[None], 0.1 * step))
    np.testing.assert_equal(info, same)


@pytest.mark.parametrize("knee", [0.05, math.inf])
def test_the_reward_is_minus_the_root_mean_square_beyond_the_knee_its_logarithm(knee):
    env = AgentInterface(scalar(), reward_scale=3.0, reward_knee=knee)
    env.reset(seed=5)
    before = 0.0
    for action in outputs(30, 1)[:, 0]:
        _, reward, _, _, info = env.step(action)
        rms = math.sqrt((info["omega1"] - before) / 0.1)
        before = info["omega1"]
        assert reward == pytest.approx(-3.0 * (rms if knee == math.inf else knee * math.log1p(rms / knee)), rel=1e-6)


def test_the_task_s_own_reward_adds_up_to_its_objective():
    env, returned = AgentInterface(scalar(), InterfaceConfig(reward="task", horizon=1.0)), 0.0
    env.reset(seed=5)
    for action in outputs(10, 1)[:, 0]:
        _, reward, _, truncated, info = env.step(action)
        returned += reward
    assert returned == pytest.approx(-info["omega1"], rel=1e-12)
    assert truncated


@OBSERVATIONS
@MODES
def test_rows_are_scalar_interfaces_across_their_restarts(observation, mode):
    rows, arguments = 3, {"drift_limit": 0.1, "horizon": 1.5, "privileged": True}
    task = {"observation": observation, "episode_duration": 1.2, "scenario": ScenarioDistribution(hs=3.0)}
    envs = AgentVectorInterface(vector(rows, mode=mode, **task), **arguments)
    singles = [AgentInterface(scalar(**task), **arguments) for _ in range(rows)]
    seen, _ = envs.reset(seed=7)
    np.testing.assert_array_equal(seen, [env.reset(seed=7 + i)[0] for i, env in enumerate(singles)])
    ended, lengths, length = np.zeros(rows, dtype=bool), set(), np.zeros(rows, dtype=int)
    for actions in outputs(60, rows) + np.array([[0.8], [0.0], [-0.8]], dtype=np.float32):
        seen, rewards, terminations, truncations, infos = envs.step(actions)
        for i, env in enumerate(singles):
            if mode == "NextStep" and ended[i]:
                np.testing.assert_array_equal(seen[i], env.reset()[0])
                assert (rewards[i], terminations[i], truncations[i]) == (0.0, False, False)
                assert infos["omega1"][i] == 0.0
                ended[i], length[i] = False, 0
                continue
            want, reward, terminated, truncated, info = env.step(actions[i])
            assert (rewards[i], terminations[i], truncations[i]) == (reward, terminated, truncated)
            ended[i], length[i] = terminated or truncated, length[i] + 1
            if ended[i]:
                lengths.add(int(length[i]))
            if mode == "SameStep":
                assert bool(infos.get("_final_obs", np.zeros(rows))[i]) == ended[i]
                if ended[i]:
                    np.testing.assert_array_equal(infos["final_obs"][i], want)
                    assert infos["final_info"]["omega1"][i] == info["omega1"]
                    want, info = env.reset()
                    length[i] = 0
            np.testing.assert_array_equal(seen[i], want)
            assert infos["omega1"][i] == info["omega1"]
    assert {12} < lengths  # some were cut by their drift, some by the clock


def test_without_autoreset_rows_are_reset_by_hand():
    envs = AgentVectorInterface(vector(2, mode="Disabled"), horizon=0.3, stagger=True)
    envs.reset(seed=0)
    actions = np.zeros((2, 1), dtype=np.float32)
    envs.step(actions)
    *_, truncations, _ = envs.step(actions)
    np.testing.assert_array_equal(truncations, [True, False])
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"rows \[0\]"):
        envs.step(actions)
    seen, _ = envs.reset(options={"reset_mask": truncations})
    fresh, *_, truncations, _ = envs.step(actions)
    np.testing.assert_array_equal(truncations, [False, True])
    assert not np.array_equal(seen[0], fresh[0])


def test_staggered_rows_end_one_after_the_other():
    envs = AgentVectorInterface(vector(4), horizon=0.8, stagger=True)
    envs.reset(seed=0)
    actions = np.zeros((4, 1), dtype=np.float32)
    ends = [np.flatnonzero(envs.step(actions)[3]).tolist() for _ in range(8)]
    assert ends == [[], [0], [], [1], [], [2], [], [3]]


def test_privileged_features_stand_behind_the_agents():
    env = AgentInterface(scalar("sensors"), privileged=True)
    assert env.actor_inputs == len(SENSED_FEATURES)
    assert env.feature_names[env.actor_inputs :] == tuple(f"true_{name}" for name in STATE_FEATURES)
    seen, _ = env.reset(seed=2)
    alike, _ = AgentInterface(scalar("sensors")).reset(seed=2)
    np.testing.assert_array_equal(seen[: env.actor_inputs], alike)
    assert AgentInterface(scalar(), privileged=True).feature_names == STATE_FEATURES


@OBSERVATIONS
def test_checkers_of_gymnasium_and_stable_baselines_accept_it(observation, recwarn):
    env = AgentInterface(scalar(observation, episode_duration=2.0))
    check_env(env, skip_render_check=True)
    check_env_for_sb3(env)
    assert [str(each.message) for each in recwarn if "different from the unwrapped" not in str(each.message)] == []


def test_its_spec_makes_it_again_and_it_can_be_copied():
    env = AgentInterface(scalar(), drift_limit=2.0)
    again = gymnasium.make(env.spec)
    assert isinstance(again, AgentInterface)
    seen, _ = env.reset(seed=1)
    np.testing.assert_array_equal(seen, again.reset(seed=1)[0])
    copy, action = pickle.loads(pickle.dumps(env)), np.full(1, 0.3, dtype=np.float32)
    np.testing.assert_array_equal(copy.step(action)[0], env.step(action)[0])


@OBSERVATIONS
def test_what_acts_on_the_features_runs_in_the_comparison(observation):
    scenarios = held_out_scenarios(ScenarioDistribution(), 3)
    made_for = FeatureConfig.of(aframe_env.TaskConfig(observation=observation))
    zero = FeaturePolicy(lambda features: np.zeros((len(features), 1), dtype=np.float32), made_for)
    got, want = (
        run(policy, scenarios, observation=observation, episode_duration=5.0)
        for policy in (zero, output_zero(made_for))
    )
    np.testing.assert_array_equal(got.error, want.error)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (lambda features: features[:, :2], r"gave shape \(3, 2\): must be \(3,\)"),
        (lambda features: np.full(len(features), np.nan), "not finite"),
    ],
)
def test_outputs_that_are_none_are_refused(function, words):
    policy = FeaturePolicy(function, name="mine")
    with pytest.raises(InvalidValue, match=words):
        run(policy, held_out_scenarios(ScenarioDistribution(), 3), episode_duration=1.0)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: AgentInterface(gymnasium.make("Pendulum-v1")), "must be AFrameHeaveEnv"),
        (lambda: AgentInterface(RescaleAction(scalar(), np.float32(-1), np.float32(1))), "as they are"),
        (lambda: AgentVectorInterface(gymnasium.make_vec(aframe_env.ENV_ID, 2, "sync")), "must be AFrameHeaveVector"),
        (
            lambda: AgentInterface(scalar(), drift=1.0),
            "unexpected keyword argument 'drift': must be one of action, adapts, drift_limit",
        ),
        (lambda: AgentInterface(scalar(), drift_limit=0.0), r"drift_limit = 0.0 m: must be in \(0, 1000\] m"),
        (lambda: AgentInterface(scalar(), horizon=-1.0), r"horizon = -1.0 s"),
        (
            lambda: AgentInterface(scalar(), action="mine"),
            "action = 'mine': must be one of 'residual', 'speed', 'predictive'",
        ),
        (lambda: AgentInterface(scalar(), reward="mine"), "reward = 'mine': must be one of 'training', 'task'"),
    ],
)
def test_what_cannot_be_wrapped_or_set_is_refused(make, words):
    with pytest.raises(InvalidValue, match=words):
        make()


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (np.zeros(2, dtype=np.float32), r"shape \(2,\): must be of shape \(1,\)"),
        (np.full(1, np.nan, dtype=np.float32), "must be finite"),
    ],
)
def test_actions_that_are_none_are_refused(action, words):
    env = AgentInterface(scalar())
    env.reset(seed=0)
    with pytest.raises(InvalidValue, match=words):
        env.step(action)
