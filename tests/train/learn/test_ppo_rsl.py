"""PPO of rsl_rl, on the processor: what it learns from, and a run from start to agent."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch

pytest.importorskip("rsl_rl", reason='rsl-rl-lib is not installed (extra "cuda")')

from aframe_env import ScenarioDistribution
from aframe_env.torch_env import GROUP, AFrameHeaveTorchEnv
from agents.learned.agent import load
from agents.learned.features import Action, FeatureConfig, Features
from agents.learned.tensor_features import TensorFeatures
from train.learn import ppo_rsl
from train.learn.ppo_rsl import Options
from train.learn.rsl_env import TrainingRows
from train.learn.run import main

TINY = ("--timesteps", 512, "--n-envs", 16, "--n-steps", 8, "--batch-size", 64, "--n-epochs", 2, "--eval-scenarios", 0)


def command(monkeypatch: pytest.MonkeyPatch, learner: str, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["train", *map(str, arguments)])
    return main(learner)


def rows(drift_limit: float = 10.0, source: ScenarioDistribution | None = None) -> TrainingRows:
    source = source or ScenarioDistribution()
    env = AFrameHeaveTorchEnv(6, scenario=source, episode_duration=5.0, device="cpu")
    features = TensorFeatures(6, source.crane, FeatureConfig(), "cpu", cuda=False)
    return TrainingRows(env, features, drift_limit=drift_limit, reward_scale=2.0, reward_knee=1.0)


def test_the_reward_is_the_shaped_root_mean_square() -> None:
    training = rows(source=ScenarioDistribution(hs=4.0, ramp=0.0))
    training.episode_length_buf.zero_()
    plain = AFrameHeaveTorchEnv(6, scenario=ScenarioDistribution(hs=4.0, ramp=0.0), episode_duration=5.0, device="cpu")
    features = TensorFeatures(6, ScenarioDistribution().crane, FeatureConfig(), "cpu", cuda=False)
    observation, none = plain.reset()[GROUP], torch.zeros(6, dtype=torch.bool)
    features.look(observation, ~none)
    generator = torch.Generator().manual_seed(0)
    for _ in range(20):
        output = torch.rand((6, 1), generator=generator) - 0.5
        _, shaped, _, _ = training.step(output)
        observations, reward, _, _ = plain.step(features.command(output))
        features.look(observations[GROUP], none)
        torch.testing.assert_close(shaped, -2.0 * torch.log1p(torch.sqrt(-reward / 0.1)), rtol=1e-4, atol=1e-6)


def test_a_drifting_row_starts_anew_with_its_value() -> None:
    training = rows(drift_limit=0.5)
    training.episode_length_buf.zero_()
    for step in range(1, 40):
        _, _, dones, extras = training.step(torch.ones(6, 1))
        assert torch.equal(dones, extras["time_outs"])
        assert (training.episode_length_buf[dones] == 0).all()
        if dones.any():
            assert step > 3
            return
    raise AssertionError("no row has drifted off")


def test_to_look_twice_is_to_look_once() -> None:
    looked, unlooked = rows(), rows()
    for training in (looked, unlooked):
        training.episode_length_buf.zero_()
    for _ in range(5):
        looked.get_observations()
        seen, want = (training.step(torch.full((6, 1), 0.2))[0][GROUP] for training in (looked, unlooked))
        assert torch.equal(seen, want)
        assert torch.equal(looked.get_observations()[GROUP], want)


@pytest.mark.parametrize("action", ["residual", "speed"])
def test_features_across_restarts_are_those_of_the_agents(action: Action) -> None:
    """Rows that drift off, and rows whose time is over, begin anew; each as the agents' own features do."""
    source = ScenarioDistribution(hs=3.0)
    config = FeatureConfig(action=action)
    env = AFrameHeaveTorchEnv(6, scenario=source, episode_duration=3.0, device="cpu", seed=4)
    features = TensorFeatures(6, source.crane, config, "cpu", cuda=False)
    training = TrainingRows(env, features, drift_limit=0.4, reward_scale=2.0, reward_knee=1.0)
    arrays = Features(6, config)
    observed = env.get_observations()[GROUP].numpy()
    want = arrays.start(observed, [source.nominal()] * 6)
    np.testing.assert_allclose(training.get_observations()[GROUP], want, rtol=1e-5, atol=1e-5)
    generator, restarts = torch.Generator().manual_seed(2), 0
    for _ in range(70):
        outputs = 2.0 * torch.rand((6, 1), generator=generator) - 0.7
        arrays.command(outputs[:, 0].double().numpy())
        seen, _, dones, _ = training.step(outputs)
        observed = env.get_observations()[GROUP].numpy()
        want = arrays.advance(observed)
        begun = np.flatnonzero(dones.numpy())
        if len(begun):
            want[begun] = arrays.start(observed[begun], [source.nominal()] * len(begun), begun)
        np.testing.assert_allclose(seen[GROUP], want, rtol=1e-5, atol=1e-5)
        restarts += len(begun)
    assert restarts > 12


def test_rows_start_at_random_times_of_their_episode() -> None:
    training = rows()
    assert len(set(training.episode_length_buf.tolist())) > 2
    assert training.episode_length_buf.max() < training.max_episode_length


def test_a_run_from_start_to_an_agent_that_steps_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sums = []
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        out = tmp_path / name
        assert command(monkeypatch, "ppo-rsl", *TINY, "--device", "cpu", "--seed", seed, "--out", out) == 0
        sums.append(load(out).card.sha256)
    assert sums[0] == sums[1] != sums[2]
    assert json.loads((tmp_path / "a" / "metrics.json").read_text())["timesteps"] == 512
    log = (tmp_path / "a" / "log" / "progress.csv").read_text().splitlines()
    assert len(log) == 1 + 512 // (16 * 8)
    assert "train/surrogate" in log[0]
    agent = load(tmp_path / "a")
    assert (agent.card.algorithm, agent.card.seed, agent.card.timesteps) == ("residual PPO", 3, 512)
    env = gymnasium.make("AFrameHeave-v0")
    observation, _ = env.reset(seed=0)
    memory = None
    for _ in range(3):
        action, memory = agent.predict(observation, memory)
        assert env.action_space.contains(action)
        observation, reward, _, _, _ = env.step(action)
        assert np.isfinite(reward)


def test_the_agent_is_the_learner_s_mean_action() -> None:
    options = Options(device="cpu", n_envs=16, n_steps=4, batch_size=32, n_epochs=1, timesteps=64)
    learner = ppo_rsl.build(options)
    learner.model.learn(64)
    model = learner.model
    assert isinstance(model, ppo_rsl.RslPPO)
    observations = learner.rows.get_observations()  # type: ignore[attr-defined]
    with torch.no_grad():
        mean = model._learner.actor(observations)
        output = learner.to_actor()(observations[GROUP])
    torch.testing.assert_close(output, torch.clip(mean, -1.0, 1.0))


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
def test_cuda_without_a_device_is_one_clear_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        command(monkeypatch, "ppo", "--device", "cuda", "--out", tmp_path / "run")
    assert stopped.value.code == 2
    assert "no CUDA device" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_a_missing_extra_is_one_clear_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.delitem(sys.modules, "train.learn.ppo_rsl")
    monkeypatch.delattr("train.learn.ppo_rsl")
    monkeypatch.setitem(sys.modules, "rsl_rl.algorithms", None)
    with pytest.raises(SystemExit) as stopped:
        command(monkeypatch, "ppo", "--device", "cuda")
    assert stopped.value.code == 2
    assert 'pip install "aframe-heave[cuda]"' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [(("--observation", "sensors"), "observation = 'sensors'"), (("--batch-size", 10**9), "batch_size = 1000000000")],
)
def test_bad_options(
    arguments: tuple[object, ...],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit):
        command(monkeypatch, "ppo-rsl", *arguments)
    assert words in capsys.readouterr().err
