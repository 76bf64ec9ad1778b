"""The examples run, and a short training is no worse than the hand-written base by much."""

import inspect
import re
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from agents.learned.features import SENSED_FEATURES
from examples import learn_cleanrl, learn_sb3
from train.learn import ppo, sac

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/learners.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("example", [learn_sb3, learn_cleanrl], ids=["sb3", "cleanrl"])
@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_an_example_learns(example, observation):
    assert example.learn(8192, observation, scenarios=4) > 0.8


def test_the_example_of_stable_baselines_is_short():
    assert len(inspect.getsource(learn_sb3).splitlines()) <= 50


def test_the_page_names_every_feature():
    """Those of the full state are among them."""
    assert sorted(re.findall(r"^\| `(\w+)` \|", PAGE, flags=re.MULTILINE)) == sorted(SENSED_FEATURES)


@pytest.mark.parametrize(
    ("algorithm", "options", "names"),
    [
        ("ppo", ppo.Options(), ("n_steps", "n_epochs", "gae_lambda", "clip_range", "reward_scale", "reward_knee")),
        ("sac", sac.Options(), ("gradient_steps", "tau", "target_entropy", "learning_starts", "reward_scale")),
    ],
    ids=["ppo", "sac"],
)
def test_the_settings_for_rl_zoo3_are_the_options_defaults(algorithm, options, names):
    text = (ROOT / "examples/rl_zoo3" / f"{algorithm}.yml").read_text(encoding="utf-8")
    said = dict(re.findall(r"^ +(?:- )?(\w+): (\S+)$", text, flags=re.MULTILINE))
    assert said["learning_rate"] == f"lin_{options.learning_rate}"
    assert said["n_timesteps"] == str(options.timesteps)
    for name in ("n_envs", "batch_size", "gamma", "drift_limit", "horizon", *names):
        assert float(said[name]) == getattr(options, name), name


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_a_clone_is_worth_something(observation, tmp_path, monkeypatch):
    """An output of zero is a drum that stands still here: it removes nothing."""
    pytest.importorskip("minari", reason="needs the extra data: minari")
    pytest.importorskip("h5py", reason="needs the extra data: h5py")
    from examples import behaviour_cloning
    from train import dataset

    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    few = dataset.Options(kinds=("noisy",), observations=(observation,), episodes=24)
    assert dataset.run(few, Console(quiet=True)) == 0
    found = behaviour_cloning.clone(f"aframe-heave/{observation}-noisy-v0", "features", scenarios=6)
    assert np.median(found["clone"]) > 0.8
    assert np.median(found["expert"]) > np.median(found["clone"])
    assert (found["still"] == 0.0).all()


def test_the_example_of_cloning_is_short():
    source = Path(__file__).parents[2] / "examples/behaviour_cloning.py"
    assert len(source.read_text(encoding="utf-8").splitlines()) <= 80
