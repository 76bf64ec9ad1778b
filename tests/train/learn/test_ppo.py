import json
import tomllib

import pytest

from agents.learned.agent import load
from train.learn.run import main

TINY = ("--timesteps", 512, "--n-envs", 4, "--n-steps", 16, "--batch-size", 64, "--n-epochs", 1)


def command(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["train.ppo", *map(str, arguments)])
    return main("ppo")


def test_a_run_from_start_to_comparison(tmp_path, monkeypatch):
    compared = ("S-Ω1", "winch-limited optimum", "feed-forward + feedback", "S-Ω1 for each scenario")
    monkeypatch.setattr("train.evaluate.run.AFTER_TRAINING", compared)
    out = tmp_path / "run"
    assert command(monkeypatch, *TINY, "--eval-scenarios", 3, "--eval-privileged", 1, "--seed", 4, "--out", out) == 0
    assert load(out).card.seed == 4
    assert tomllib.loads((out / "config.toml").read_text())["timesteps"] == 512
    run = json.loads((out / "run.json").read_text())
    assert "-m train.ppo --timesteps 512" in run["command"]
    assert run["versions"]["torch"]
    assert json.loads((out / "metrics.json").read_text())["timesteps"] >= 512
    rows = {row["policy"]: row for row in json.loads((out / "comparison.json").read_text(encoding="utf-8"))["policies"]}
    assert list(rows) == ["drum still", "residual PPO", *compared]
    assert rows["S-Ω1"]["scenarios"] == 3
    assert rows["S-Ω1 for each scenario"]["scenarios"] == 1
    assert "privileged" in rows["S-Ω1 for each scenario"]["knows"]
    assert rows["S-Ω1 for each scenario"]["reduction"]["value"] > 0.9
    assert (out / "comparison.png").read_bytes().startswith(b"\x89PNG")
    assert list((out / "log").glob("events.out.tfevents*"))


def test_the_same_seed_gives_the_same_agent(tmp_path, monkeypatch):
    sums = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        out = tmp_path / name
        command(monkeypatch, *TINY, "--eval-scenarios", 0, "--eval-privileged", 0, "--seed", seed, "--out", out)
        sums.append(load(out).card.sha256)
    assert sums[0] == sums[1] != sums[2]


def test_a_config_file_repeats_a_run(tmp_path, monkeypatch):
    command(monkeypatch, *TINY, "--eval-scenarios", 0, "--eval-privileged", 0, "--out", tmp_path / "a")
    command(monkeypatch, "--config", tmp_path / "a" / "config.toml", "--out", tmp_path / "b")
    assert load(tmp_path / "a").card.sha256 == load(tmp_path / "b").card.sha256


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--n-envs", 0), "n_envs = 0: must be in [1, 1048576]"),
        (("--learning-rate", "nan"), "learning_rate = nan"),
        (("--batch-size", 10**9), "batch_size = 1000000000: must be in [2, 8192]"),
        (("--horizon", -1), "horizon = -1.0 s: must be in [0.1, 60] s"),
        (("--config", "absent.toml"), "cannot be read"),
    ],
)
def test_bad_options_are_one_clear_line(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        command(monkeypatch, *arguments)
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
