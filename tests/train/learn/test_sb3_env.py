from dataclasses import replace

import numpy as np
import pytest
import torch
from stable_baselines3.common.vec_env import VecEnv

from aframe_env import ScenarioDistribution
from aframe_env.config import TaskConfig
from aframe_env.env import AFrameHeaveEnv
from agents.learned.features import STATE_FEATURES, FeatureConfig, Features
from agents.learned.interface import InterfaceConfig
from train.learn import ppo, sac
from train.learn.sb3_env import TrainingVecEnv


def bridge(rows=3, *, horizon=2.0, drift_limit=4.0, reward_scale=1.0, reward_knee=np.inf, seed=5, **task):
    interface = InterfaceConfig(
        horizon=horizon, drift_limit=drift_limit, reward_scale=reward_scale, reward_knee=reward_knee, privileged=True
    )
    return TrainingVecEnv(rows, TaskConfig(**task), interface, seed=seed)


def test_rows_are_the_environments():
    rows = bridge(horizon=60.0)
    observed = rows.reset()
    envs = []
    for i, scenario in enumerate(rows._simulation.scenarios):
        env, features = AFrameHeaveEnv(scenario=scenario), Features(1, FeatureConfig())
        first, _ = env.reset(seed=0)
        np.testing.assert_array_equal(features.start(first[None], [scenario])[0], observed[i])
        envs.append((env, features))
    actions = np.array([[0.1], [-0.2], [0.0]], dtype=np.float32)
    for _ in range(8):
        observed, rewards, finished, _ = rows.step(actions)
        assert not finished.any()
        for i, (env, features) in enumerate(envs):
            command = features.command(actions[i].astype(np.float64))
            want, reward, _, _, _ = env.step(command.astype(np.float32))
            np.testing.assert_allclose(observed[i], features.advance(want[None])[0], atol=2e-5)
            # The reward is the root mean square over the step, in place of the mean square.
            assert rewards[i] == pytest.approx(-np.sqrt(-reward / 0.1), rel=1e-4, abs=1e-6)


def test_rows_start_at_random_phases_and_finish_by_truncation():
    rows = bridge(rows=40)
    rows.reset()
    finished_at = []
    for step in range(20):
        observed, _, finished, infos = rows.step(np.zeros((40, 1), dtype=np.float32))
        for i in np.flatnonzero(finished):
            finished_at.append(step)
            assert infos[i]["TimeLimit.truncated"]
            assert infos[i]["terminal_observation"].shape == observed[i].shape
            assert not np.array_equal(infos[i]["terminal_observation"], observed[i])
        assert all(not infos[i] for i in np.flatnonzero(~finished))
    assert len(finished_at) == 40
    assert len(set(finished_at)) > 10


def test_a_drifting_row_starts_anew():
    rows = bridge(horizon=60.0, drift_limit=0.5, scenario=ScenarioDistribution(hs=0.5))
    rows.reset()
    for _ in range(60):
        _, _, finished, infos = rows.step(np.ones((3, 1), dtype=np.float32))
        if finished.any():
            break
    assert infos[int(np.flatnonzero(finished)[0])]["TimeLimit.truncated"]
    assert finished.any()


def test_it_is_a_vec_env_that_learners_accept():
    assert isinstance(bridge(), VecEnv)
    model = ppo.build(ppo.Options(n_envs=4, n_steps=8, batch_size=16, n_epochs=1)).model
    before = {k: v.clone() for k, v in model.policy.state_dict().items()}
    model.learn(64)
    after = model.policy.state_dict()
    assert any(not torch.equal(before[k], after[k]) for k in before)


@pytest.mark.parametrize("observation", ["state", "sensors"])
@pytest.mark.parametrize(
    ("build", "options"),
    [
        (ppo.build, ppo.Options(n_envs=4, n_steps=8, batch_size=16, n_epochs=1)),
        (sac.build, sac.Options(n_envs=4, batch_size=16, learning_starts=8)),
    ],
    ids=["ppo", "sac"],
)
def test_the_plain_actor_is_the_learners_mean_action(build, options, observation):
    learner = build(replace(options, observation=observation))
    learner.model.learn(64)
    observed = learner.rows.reset()
    want, _ = learner.model.predict(observed, deterministic=True)
    with torch.no_grad():
        got = learner.to_actor()(torch.from_numpy(observed[:, : learner.rows.actor_inputs]))
    assert np.abs(want).max() > 1e-4
    np.testing.assert_allclose(got.numpy(), want, atol=1e-6)


def test_what_the_critics_see_beyond_the_sensors_does_not_move_the_agent():
    learner = ppo.build(ppo.Options(n_envs=4, n_steps=8, batch_size=16, observation="sensors"))
    observed = learner.rows.reset()
    other = observed.copy()
    other[:, learner.rows.actor_inputs :] += 1.0
    policy = learner.model.policy
    assert observed.shape[1] == learner.rows.actor_inputs + len(STATE_FEATURES)
    with torch.no_grad():
        values = [policy.predict_values(torch.from_numpy(x)) for x in (observed, other)]
    np.testing.assert_array_equal(*[learner.model.predict(x, deterministic=True)[0] for x in (observed, other)])
    assert not torch.equal(*values)
