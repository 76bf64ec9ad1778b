"""My crane in my seas: ``--scenarios FILE.toml`` on every command, and a period of one's own."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from aframe_env import InvalidValue, TaskConfig, find_task
from agents.control.expected_waves import ExpectedWaves
from agents.learned.agent import load
from agents.policy import DrumStill
from agents.rollout import run as run_policy
from train.learn.options import LearningOptions
from train.learn.run import main as learn
from train.shared.scenarios import ScenarioOptions

OWN = """\
kind = "distribution"
hs = [1.0, 2.0]
tp = 8.0
load_mass = 40e3
rope_length = [80.0, 120.0]
[crane.winch]
max_rope_speed = 1.2
[sensors]
delay = 0.3
"""
TINY = ("--timesteps", 256, "--n-envs", 4, "--n-steps", 16, "--batch-size", 32, "--n-epochs", 1)


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "mine.toml"
    path.write_text(OWN)
    return path


def command(monkeypatch: pytest.MonkeyPatch, module: str, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", [module, *map(str, arguments)])
    status: int = import_module(module).main()
    return status


def test_train_and_compare_on_ones_own(own, tmp_path, monkeypatch):
    out = tmp_path / "agent"
    few = ("--observation", "sensors", "--eval-scenarios", 0, "--out", out)
    monkeypatch.setattr("sys.argv", ["train.ppo", *map(str, (*TINY, "--scenarios", own, *few))])
    assert learn("ppo") == 0
    assert load(out).card.sensors.delay == 0.3
    compared = tmp_path / "compared"
    policies = ("--policies", out, "feed-forward + feedback", "predictive control")
    few = ("--count", 4, "--privileged", 0, "--out", compared)
    assert command(monkeypatch, "train.evaluate.__main__", "--scenarios", own, *policies, *few) == 0
    rows = {
        row["policy"]: row for row in json.loads((compared / "comparison.json").read_text(encoding="utf-8"))["policies"]
    }
    assert rows["feed-forward + feedback"]["scenarios"] == 4
    parquet = pytest.importorskip("pyarrow.parquet").read_table(compared / "episodes.parquet").to_pydict()
    assert set(parquet["load_mass"]) == {40e3}
    assert set(parquet["tp"]) == {8.0}


def test_a_period_of_ones_own_is_compared_at_it(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("train.evaluate.run.AFTER_TRAINING", ("feed-forward + feedback",))
    out = tmp_path / "agent"
    few = ("--eval-scenarios", 1, "--eval-privileged", 0, "--out", out)
    monkeypatch.setattr("sys.argv", ["train.ppo", *map(str, (*TINY, "--control-period", 0.2, *few))])
    assert learn("ppo") == 0
    assert load(out).card.control_period == 0.2
    assert (out / "comparison.json").exists()
    compared = tmp_path / "compared"
    options = ("--policies", out, "--scenarios", 2, "--privileged", 0, "--no-report", "--out", compared)
    assert command(monkeypatch, "train.evaluate.__main__", *options, "--control-period", 0.2) == 0
    assert "control_period = 0.2" in (compared / "config.toml").read_text()
    with pytest.raises(SystemExit):
        command(monkeypatch, "train.evaluate.__main__", *options[:-1], tmp_path / "another")
    assert (
        "control_period = 0.1 s: residual PPO was trained at 0.2 s, as by --control-period 0.2"
        in capsys.readouterr().err
    )
    assert not (tmp_path / "another").exists()


def test_train_and_compare_on_a_task_of_the_suite(tmp_path, monkeypatch):
    monkeypatch.setattr("train.evaluate.run.AFTER_TRAINING", ("winch-limited optimum",))
    out = tmp_path / "agent"
    few = ("--task", "unknown", "--observation", "sensors", "--eval-scenarios", 2, "--out", out)
    monkeypatch.setattr("sys.argv", ["train.ppo", *map(str, (*TINY, *few))])
    assert learn("ppo") == 0
    task = find_task("Unknown")
    card = load(out).card
    assert card.sensors == task.distribution.sensors
    assert card.waves == ExpectedWaves.of(task.distribution)
    still, *_ = json.loads((out / "comparison.json").read_text(encoding="utf-8"))["policies"]
    validation = run_policy(DrumStill(), task.scenarios("validation", 2), TaskConfig(**task.arguments))
    assert still["rms"]["value"] == pytest.approx(np.median(validation.rms))


def test_what_does_not_go_with_a_task_is_refused():
    with pytest.raises(InvalidValue, match=r"scenarios = 'mine.toml': must not be given beside --task Storm"):
        LearningOptions(task="Storm", scenarios=Path("mine.toml"))
    with pytest.raises(InvalidValue, match=r"control_period = 0.2 s: must be 0.1 s, the task's"):
        LearningOptions(task="Storm", control_period=0.2)
    with pytest.raises(InvalidValue, match=r"task = 'Calm': must be one of"):
        LearningOptions(task="Calm")


@pytest.mark.slow
def test_optimisers_and_sensitivity_on_ones_own(own, tmp_path, monkeypatch):
    out = tmp_path / "optimisers"
    few = (
        "--count",
        1,
        "--max-evaluations",
        60,
        "--limited",
        1,
        "--limited-evaluations",
        2,
        "--workers",
        1,
        "--out",
        out,
    )
    assert command(monkeypatch, "train.optimisers", "--scenarios", own, *few) == 0
    mine = [row for row in json.loads((out / "comparison.json").read_text()) if row["search"]["scenario"] == 0]
    assert len(mine) == 4

    out = tmp_path / "sensitivity"
    few = ("--count", 1, "--points", 2, "--samples", 2, "--workers", 1, "--out", out)
    policies = ("--policies", "drum still", "feed-forward + feedback")
    assert command(monkeypatch, "train.sensitivity.__main__", "--scenarios", own, *policies, *few) == 0
    assert len(json.loads((out / "sensitivity.json").read_text())) == 2


def test_tuning_on_ones_own(own, tmp_path, monkeypatch):
    out = tmp_path / "control"
    few = ("--count", 2, "--evaluations", 3, "--policies", "sensors", "--out", out)
    assert command(monkeypatch, "train.tune_control", "--scenarios", own, *few) == 0
    assert len((out / "trials.csv").read_text().splitlines()) == 4

    out = tmp_path / "tune"
    few = ("--count", 2, "--timesteps", 256, "--trials", 1, "--out", out)
    assert command(monkeypatch, "train.learn.tune", "--scenarios", own, *few) == 0
    assert (out / "study.md").exists()


def test_a_drive_map_for_ones_own_crane(own, tmp_path, monkeypatch):
    from agents.drives.map import load as load_map

    own.write_text("target_level = -100.0\nload_mass = 40e3\n[crane.rope]\naxial_stiffness = 2e7\n")
    out = tmp_path / "map"
    grid = ("--amplitudes", 0.5, 1.0, "--periods", 8, 10, "--masses", 20e3, 60e3, "--lengths", 60, 150)
    few = ("--count", 2, "--held-out", 1, "--workers", 1, "--store", tmp_path / "store.sqlite", "--out", out)
    assert command(monkeypatch, "train.drive_map.__main__", "--scenarios", own, *grid, *few) == 0
    # The softer the rope, the more of the heave its stretch under the load's weight takes up.
    wanted = 1.0 / (1.0 + np.array([20e3, 60e3]) * 9.81 / 2e7)
    np.testing.assert_allclose(load_map(out).ratio.real.mean(axis=(0, 1, 3)), wanted, rtol=0.01)


def test_a_file_with_one_scenario_is_one_unless_asked_for_more(own):
    assert ScenarioOptions(scenarios=own).number == 200
    own.write_text("load_mass = 40e3\n")
    assert ScenarioOptions(scenarios=own).number == 1
    assert ScenarioOptions(scenarios=own, count=5).number == 5


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"scenarios": 3, "count": 4}, "count = 4: goes with a file, as in --scenarios FILE.toml --count 100"),
        ({"scenarios": 0}, "scenarios = 0: must be in [1, 1000000]"),
        ({"scenarios": Path("x.toml"), "count": 0}, "count = 0: must be in [1, 1000000]"),
    ],
)
def test_bad_options(options, words):
    with pytest.raises(ValueError, match="^" + words.replace("[", r"\[")):
        ScenarioOptions(**options)


def test_a_wrong_file_is_one_line_before_anything_is_written(own, tmp_path, monkeypatch, capsys):
    own.write_text(OWN + "wind = 3\n")
    out = tmp_path / "run"
    for run in (
        lambda: command(monkeypatch, "train.evaluate.__main__", "--scenarios", own, "--out", out),
        lambda: command(monkeypatch, "train.tune_control", "--scenarios", own, "--out", out),
        lambda: command(monkeypatch, "train.sensitivity.__main__", "--scenarios", own, "--out", out),
        lambda: command(monkeypatch, "train.drive_map.__main__", "--scenarios", own, "--out", out),
        lambda: command(monkeypatch, "train.optimisers", "--scenarios", own, "--out", out),
        lambda: command(monkeypatch, "train.learn.tune", "--scenarios", own, "--out", out),
    ):
        with pytest.raises(SystemExit) as stopped:
            run()
        assert stopped.value.code == 2
        error = capsys.readouterr().err
        assert "mine.toml" in error
        assert "unknown key 'wind'" in error
    assert not out.exists()
