"""Minari data sets: what they say is what the environment does."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import agents
from aframe_env import InvalidValue
from agents.policy import DrumStill
from agents.rollout import HELD_OUT_SEED, run
from train import dataset
from train.dataset import MOST_EPISODES, Options, begun, episode_seeds, recipes

minari = pytest.importorskip("minari", reason="needs the extra data: minari")
pytest.importorskip("h5py", reason="needs the extra data: h5py")


@pytest.fixture(autouse=True)
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


def made(**options: object) -> list:
    """Make sets, and load them."""
    asked = Options(**options)  # type: ignore[arg-type]
    assert dataset.run(asked, Console(quiet=True)) == 0
    return [minari.load_dataset(recipe.id) for recipe in recipes(asked)]


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_the_recovered_environment_does_the_same_to_the_last_bit(observation: str) -> None:
    (data,) = made(kinds=("noisy",), observations=(observation,), episodes=2, seed=3)
    env = data.recover_environment()
    seeds = [attributes["seed"] for attributes in data.storage.get_episode_metadata([0, 1])]
    assert seeds == [3_000_000, 3_000_001]
    for seed, episode in zip(seeds, data.iterate_episodes(), strict=True):
        observation, info = env.reset(seed=seed)
        assert env.observation_space.contains(episode.observations[0])
        for k, action in enumerate(episode.actions):
            np.testing.assert_array_equal(episode.observations[k], observation)
            for name, values in episode.infos.items():
                np.testing.assert_array_equal(values[k], info[name])
            observation, reward, terminated, truncated, info = env.step(action)
            assert (reward, terminated, truncated) == (
                episode.rewards[k],
                episode.terminations[k],
                episode.truncations[k],
            )
        np.testing.assert_array_equal(episode.observations[-1], observation)
        assert truncated


def test_an_expert_set_is_what_the_agent_does_in_the_rollout() -> None:
    (data,) = made(kinds=("expert",), observations=("state",), episodes=3)
    assert data.id == "aframe-heave/state-expert-v0"
    assert list(minari.list_local_datasets()) == [data.id]
    scenarios = list(begun(recipes(Options())[0].config, episode_seeds(0, 3)).scenarios)
    driven, still = (run(policy, scenarios) for policy in (agents.load("predictive-ppo"), DrumStill()))
    found = list(data.storage.get_episode_metadata(range(3)))
    for k, (attributes, episode) in enumerate(zip(found, data.iterate_episodes(), strict=True)):
        # The actions of a set are float32, those of the rollout float64.
        assert attributes["omega1"] == pytest.approx(driven.omega1[k], rel=0.02)
        assert attributes["omega1_still"] == still.omega1[k]
        assert attributes["heave_reduction"] == pytest.approx(1.0 - driven.rms[k] / still.rms[k], abs=1e-4)
        assert episode.rewards.sum() == pytest.approx(-attributes["omega1"])
    metadata = data.storage.metadata
    assert agents.load("predictive-ppo").card.sha256 in metadata["description"]
    assert metadata["algorithm_name"] == "predictive PPO"
    assert metadata["author"] == {"The aframe-heave project"}
    assert metadata["code_permalink"].startswith("https://")


def test_the_sets_differ_as_their_names_say() -> None:
    sets = made(observations=("sensors",), episodes=4)
    assert [data.id.partition("/")[2] for data in sets] == [
        f"sensors-{kind}-v0" for kind in ("expert", "medium", "noisy")
    ]
    reduction = [
        np.mean([attributes["heave_reduction"] for attributes in data.storage.get_episode_metadata(range(4))])
        for data in sets
    ]
    assert reduction[0] > reduction[2] > 0.9
    assert 0.6 < reduction[1] < 0.8
    expert, _, noisy = (next(iter(data.iterate_episodes())) for data in sets)
    np.testing.assert_array_equal(expert.observations[0], noisy.observations[0])
    # The first action answers the same observation: what differs is the noise.
    first = [next(iter(data.iterate_episodes([0]))).actions[0, 0] for data in sets]
    assert 0.0 < abs(first[2] - first[0]) < 6.0 * dataset.NOISE


def test_the_noise_is_as_strong_as_it_is_said_to_be() -> None:
    (data,) = made(policy="drum-still", noise=0.3, episodes=3)
    assert data.id == "aframe-heave/state-drum-still-v0"
    actions = np.concatenate([episode.actions for episode in data.iterate_episodes()])
    assert actions.std() == pytest.approx(0.3, rel=0.06)
    assert abs(actions.mean()) < 0.03


def test_an_own_task_and_any_policy_make_a_set(tmp_path: Path) -> None:
    mine = tmp_path.parent / "Mine 1.toml"
    mine.write_text('kind = "distribution"\nhs = 1.5\nload_mass = 40e3\n[sensors]\ndelay = 0.3\n')
    (data,) = made(policy="feed-forward + feedback", scenario=mine, episodes=1)
    assert data.id == "aframe-heave/sensors-feed-forward-feedback-mine-1-v0"
    mine.unlink()
    env = data.recover_environment()
    assert env.unwrapped.simulation.config.sensors.delay == 0.3
    np.testing.assert_array_equal(next(iter(data.iterate_episodes())).observations[0], env.reset(seed=0)[0])
    assert env.unwrapped.scenario.load_mass == 40e3


def test_no_episode_is_a_held_out_scenario() -> None:
    """A seed below 2³² is one word to NumPy; the held-out series has the words (HELD_OUT_SEED, k)."""
    series = HELD_OUT_SEED // dataset.SEED_STRIDE
    assert episode_seeds(series, MOST_EPISODES)[-1] < HELD_OUT_SEED < episode_seeds(series + 1, 1)[0]
    assert episode_seeds(dataset.MOST_SERIES, MOST_EPISODES)[-1] < 2**32
    with pytest.raises(InvalidValue, match=r"^episodes = 50001"):
        Options(episodes=MOST_EPISODES + 1)
    with pytest.raises(InvalidValue, match=rf"^seed = {dataset.MOST_SERIES + 1}"):
        Options(seed=dataset.MOST_SERIES + 1)


def test_an_episode_ends_where_the_rope_parts(tmp_path: Path) -> None:
    weak = tmp_path.parent / "weak.toml"
    weak.write_text('kind = "distribution"\nhs = 3.0\nload_mass = 60e3\n[crane.rope]\nbreaking_load = 620e3\n')
    (data,) = made(policy="drum-still", scenario=weak, episodes=3)
    env = data.recover_environment()
    episodes = list(data.iterate_episodes())
    assert any(episode.terminations[-1] for episode in episodes)
    for episode, attributes in zip(episodes, data.storage.get_episode_metadata(range(3)), strict=True):
        assert not episode.terminations[:-1].any()
        assert not episode.truncations[:-1].any()
        assert episode.truncations[-1] == (not episode.terminations[-1])
        env.reset(seed=attributes["seed"])
        done, rewards = False, []
        while not done:
            _, reward, terminated, truncated, _ = env.step(np.zeros(1, dtype=np.float32))
            rewards.append(reward)
            done = terminated or truncated
        assert rewards == episode.rewards.tolist()
        assert terminated == episode.terminations[-1]


def command(*options: str) -> list[str]:
    return [sys.executable, "-m", "train.dataset", "--kinds", "medium", "--observations", "state", *options]


def test_a_set_that_exists_is_refused_and_replaced_when_asked(root: Path) -> None:
    (before,) = made(kinds=("medium",), observations=("state",), episodes=1)
    done = subprocess.run(command("--episodes", "2"), capture_output=True, text=True)
    assert done.returncode == 2
    assert re.fullmatch(r"error: dataset = 'aframe-heave/state-medium-v0': exists in .*--overwrite.*\n", done.stderr)
    assert minari.load_dataset(before.id).total_episodes == 1
    (after,) = made(kinds=("medium",), observations=("state",), episodes=2, overwrite=True)
    assert after.total_episodes == 2
    assert [path.name for path in root.iterdir()] == ["aframe-heave"]


@pytest.mark.skipif(os.name == "nt", reason="needs Ctrl-C as a signal")
def test_an_interrupted_set_leaves_nothing(
    root: Path, start: Callable[..., subprocess.Popen[str]], interrupt: Callable[..., str]
) -> None:
    started = start(command("--episodes", "50000"), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said = interrupt(started, lambda: list(root.rglob("main_data.hdf5")))
    assert (started.returncode, said) == (130, "interrupted\n")
    assert list(root.iterdir()) == []
    assert minari.list_local_datasets() == {}


@pytest.mark.skipif(os.name == "nt", reason="needs a limit of each file's size")
@pytest.mark.parametrize("most", [40, 3000, 60_000])
def test_a_full_disk_is_one_line_and_leaves_nothing(root: Path, most: int) -> None:
    (before,) = made(kinds=("medium",), observations=("state",), episodes=1)
    code = (
        "import resource, runpy, sys\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, resource.RLIM_INFINITY))\n"
        "runpy.run_module('train.dataset', run_name='__main__', alter_sys=True)"
    )
    line = [sys.executable, "-c", code, *command("--episodes", "3", "--overwrite")[3:]]
    done = subprocess.run(line, capture_output=True, text=True)
    place = root / "aframe-heave" / "state-medium-v0"
    assert (done.returncode, done.stderr) == (2, f"error: [Errno 27] File too large: {str(place)!r}\n")
    assert [path.name for path in root.iterdir()] == ["aframe-heave"]
    assert minari.load_dataset(before.id).total_episodes == 1


def test_without_the_extra_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dataset, "find_spec", lambda name: None)
    with pytest.raises(Exception, match=r'pip install "aframe-heave\[data\]"'):
        dataset.run(Options(), Console(quiet=True))


def test_values_out_of_range_are_refused() -> None:
    for name, value in (("noise", -1.0), ("episodes", 0), ("seed", -1)):
        with pytest.raises(InvalidValue, match=f"^{name} = "):
            Options(**{name: value})  # type: ignore[arg-type]
