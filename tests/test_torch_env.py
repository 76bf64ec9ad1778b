"""Rows with tensors in and out, on the processor; ``tests/cuda`` holds the GPU's together with them."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.error import DependencyNotInstalled

from aframe_env import Crane, InvalidValue, Rope, Scenario, ScenarioDistribution
from aframe_env.scenario import NUMBERS
from aframe_env.vector_env import AFrameHeaveVectorEnv

pytest.importorskip("tensordict", reason='tensordict is not installed (extra "cuda")')

from aframe_env.dynamics.random import episode_uniforms
from aframe_env.torch_env import GROUP, AFrameHeaveTorchEnv

FRAGILE = Crane(rope=Rope(breaking_load=1.0e6))


def make(num_envs: int = 3, **arguments: Any) -> AFrameHeaveTorchEnv:
    return AFrameHeaveTorchEnv(num_envs, device="cpu", **arguments)


def drawn(seed: int, row: int, episode: int) -> Scenario:
    numbers = np.empty(NUMBERS)
    episode_uniforms(seed, row, episode, numbers)
    return ScenarioDistribution().at(numbers)


def speeds(rows: int, steps: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-3.0, 3.0, (steps, rows, 1)).astype(np.float32)


@pytest.mark.parametrize(
    ("scenario", "parts"), [(Scenario.paper(), False), (Scenario.paper(crane=FRAGILE), True)], ids=["lasts", "parts"]
)
def test_rows_are_those_of_the_vector_environment(scenario: Scenario, parts: bool) -> None:
    tensors = make(scenario=scenario, episode_duration=2.0)
    arrays = AFrameHeaveVectorEnv(3, scenario=scenario, episode_duration=2.0, autoreset_mode="SameStep")
    expected, _ = arrays.reset(seed=0)
    np.testing.assert_array_equal(tensors.get_observations()[GROUP], expected)
    ended = parted = 0
    for action in speeds(3, 50):
        observation, reward, done, extras = tensors.step(torch.from_numpy(action))
        want, rewards, terminated, truncated, infos = arrays.step(action)
        np.testing.assert_array_equal(observation[GROUP], want)
        np.testing.assert_array_equal(reward, rewards.astype(np.float32))
        np.testing.assert_array_equal(done, terminated | truncated)
        np.testing.assert_array_equal(extras["time_outs"], truncated & ~terminated)
        for row in np.flatnonzero(done):
            ended += 1
            np.testing.assert_array_equal(extras["final_obs"][row], infos["final_obs"][row])
            assert tensors.episode_length_buf[row] == 0
            parted += int(terminated[row])
    assert ended >= 6
    assert bool(parted) is parts


def test_a_row_s_scenarios_depend_on_seed_row_and_episode_alone() -> None:
    tensors = make(2, episode_duration=0.3, seed=7)
    arrays = AFrameHeaveVectorEnv(2, episode_duration=0.3, autoreset_mode="Disabled")
    for episode in range(3):
        scenarios = [drawn(7, row, episode) for row in range(2)]
        expected, _ = arrays.reset(options={"scenario": scenarios})
        np.testing.assert_array_equal(tensors.get_observations()[GROUP], expected)
        for action in speeds(2, 3):
            _, _, done, extras = tensors.step(torch.from_numpy(action))
            want, _, _, truncated, _ = arrays.step(action)
            np.testing.assert_array_equal(extras["final_obs"], want)
            np.testing.assert_array_equal(done, truncated)
        assert done.all()
    masses = make(5, seed=7).get_observations()[GROUP][:, 12]
    assert len(set(masses.tolist())) == 5
    assert masses[1] == np.float32(drawn(7, 1, 0).load_mass)
    assert make(5, seed=8).get_observations()[GROUP][1, 12] != masses[1]


def test_reset_of_some_rows_leaves_the_others_alone() -> None:
    tensors = make(3)
    for action in speeds(3, 4):
        tensors.step(torch.from_numpy(action))
    before = tensors.get_observations()[GROUP]
    after = tensors.reset(torch.tensor([False, True, False]))[GROUP]
    assert torch.equal(before[[0, 2]], after[[0, 2]])
    assert after[1, 12] != before[1, 12]
    assert tensors.episode_length_buf.tolist() == [4, 0, 4]
    first = tensors.reset(seed=0)[GROUP]
    assert torch.equal(first, make(3).get_observations()[GROUP])


def test_a_row_s_time_can_be_set_as_trainers_do() -> None:
    tensors = make(2, episode_duration=1.0)
    tensors.episode_length_buf = torch.tensor([9, 0])
    _, _, done, extras = tensors.step(torch.zeros(2, 1))
    assert done.tolist() == extras["time_outs"].tolist() == [True, False]


def test_rsl_rl_s_runner_takes_it() -> None:
    runners = pytest.importorskip("rsl_rl.runners", reason='rsl-rl-lib is not installed (extra "cuda")')
    network = {"class_name": "MLPModel", "hidden_dims": [8]}
    options = {
        "num_steps_per_env": 3,
        "save_interval": 10,
        "obs_groups": {"actor": [GROUP], "critic": [GROUP]},
        "actor": {**network, "distribution_cfg": {"class_name": "GaussianDistribution"}},
        "critic": network,
        "algorithm": {"class_name": "PPO"},
    }
    tensors = make(4, episode_duration=0.2)
    runner = runners.OnPolicyRunner(tensors, options, device="cpu")
    before = {name: value.clone() for name, value in runner.alg.actor.state_dict().items()}
    runner.learn(2, init_at_random_ep_len=True)
    after = runner.alg.actor.state_dict()
    assert any(not torch.equal(before[name], after[name]) for name in before)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"device": "tpu"}, "device = 'tpu': must be 'cuda', 'cuda:N' or 'cpu'"),
        ({"num_envs": 0}, "num_envs = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"episode_duration": 0.01}, "episode_duration"),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(InvalidValue, match=words.replace("(", r"\(")):
        AFrameHeaveTorchEnv(**{"num_envs": 1, "device": "cpu", **arguments})


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        (torch.zeros(3), r"must be a float tensor of shape \(3, 1\)"),
        (torch.zeros(3, 1, dtype=torch.int64), "int64"),
        (np.zeros((3, 1)), "must be a float tensor"),
        (torch.tensor([[0.0], [torch.nan], [0.0]]), r"actions\[1\] = nan rad/s: must be finite"),
    ],
)
def test_bad_actions(actions: Any, words: str) -> None:
    with pytest.raises(InvalidValue, match=words):
        make(3).step(actions)


@pytest.mark.parametrize("scenario", [None, Scenario.paper(crane=FRAGILE)], ids=["random seas", "a rope that parts"])
def test_others_go_on_from_a_state_as_these_do(scenario: Scenario | None) -> None:
    arguments = {"scenario": scenario, "episode_duration": 1.0} if scenario else {"episode_duration": 1.0}
    these, others = make(seed=7, **arguments), make(seed=8, **arguments)
    moves = [torch.from_numpy(action) for action in speeds(3, 40)]
    for action in moves[:17]:
        these.step(action)
    state = these.get_state()
    others.set_state(state)
    for env in (these, others):  # what was returned is a copy
        seen = [env.step(action) for action in moves[17:]]
        if env is these:
            expected = seen
            continue
        for (a, *mine), (b, *theirs) in zip(expected, seen, strict=True):
            assert torch.equal(a[GROUP], b[GROUP])
            assert all(torch.equal(x, y) for x, y in zip(mine[:2], theirs[:2], strict=True))
    assert sum(int(dones.sum()) for _, _, dones, _ in expected) >= 6
    others.set_state(state)
    assert torch.equal(others.step(moves[17])[0][GROUP], expected[0][0][GROUP])


def test_a_state_of_other_rows_is_refused() -> None:
    with pytest.raises(InvalidValue, match="must be those of get_state"):
        make(3).set_state(make(4).get_state())


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
@pytest.mark.parametrize("device", ["cuda", "cuda:1"])
def test_cuda_without_a_device_says_what_to_do(device: str) -> None:
    with pytest.raises(InvalidValue, match=rf"device = '{device}': no CUDA device.*device = 'cpu'"):
        AFrameHeaveTorchEnv(2, device=device)


def test_a_missing_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tensordict", None)
    with pytest.raises(DependencyNotInstalled, match=r'pip install "aframe-heave\[cuda\]"'):
        make(1)
