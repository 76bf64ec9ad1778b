"""Trainings of several seeds, trials and policies' runs in other processes are those of this one, to the byte."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.console import Console

from aframe_env.validation import InvalidValue
from train.evaluate.run import HeldOut, run_all, write
from train.learn.ppo import Options
from train.learn.registry import find_learner
from train.learn.run import train
from train.shared.jobs import Where

QUIET = Console(quiet=True)
FEW = {"timesteps": 64, "n_envs": 4, "n_steps": 8, "batch_size": 16, "n_epochs": 1, "eval_scenarios": 0, "log": ()}
TWO = Where(workers=2)


def test_seeds_learn_side_by_side(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    assert train(find_learner("ppo"), Options(**FEW, seeds=2, out=one), QUIET) == 0
    options = Options(**FEW, seeds=2, workers=2, out=two)
    assert train(find_learner("ppo"), options, QUIET) == 0
    names = sorted(path.relative_to(one) for path in one.rglob("agent.*"))
    assert len(names) == 4
    for name in names:
        assert (two / name).read_bytes() == (one / name).read_bytes()
    before = {path: path.stat().st_mtime_ns for path in two.rglob("agent.*")}
    assert train(find_learner("ppo"), options, QUIET) == 0
    assert {path: path.stat().st_mtime_ns for path in two.rglob("agent.*")} == before


def test_policies_run_side_by_side(tmp_path: Path) -> None:
    from agents.registry import choose_all

    specs = choose_all(["output zero on sensors", "feed-forward + feedback", "drive-map"])
    held_out = HeldOut(scenarios=3, privileged=0)
    for name, where in (("one", Where()), ("two", TWO)):
        (tmp_path / name).mkdir()
        write(tmp_path / name, run_all(specs, held_out, QUIET, where=where), QUIET)
    for name in ("comparison.csv", "comparison.json", "comparison.md"):
        assert (tmp_path / "two" / name).read_bytes() == (tmp_path / "one" / name).read_bytes()


@pytest.mark.slow
def test_trials_run_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("optuna", reason="needs the extra tune")
    from train.learn import tune

    for name, workers in (("one", "1"), ("two", "2")):
        few = f"--algorithm sac --timesteps 64 --scenarios 3 --trials 2 --at-once 2 --workers {workers}".split()
        monkeypatch.setattr("sys.argv", ["train.tune", *few, "--out", str(tmp_path / name)])
        assert tune.main() == 0
    for name in ("trials.csv", "study.md"):
        assert (tmp_path / "two" / name).read_bytes() == (tmp_path / "one" / name).read_bytes()


def test_one_training_is_not_for_a_cluster() -> None:
    with pytest.raises(InvalidValue, match="cluster = 'auto': goes with --seeds, for one training is one job"):
        Options(cluster="auto")
