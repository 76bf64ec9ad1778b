"""A training that is interrupted ends with the agent of one that was not, to the bit.

Processes that are killed are in ``tests/benchmarks/test_torture.py``.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from aframe_env.validation import InvalidValue
from agents import shipped
from agents.learned.agent import load
from train.learn import checkpoint
from train.learn.checkpoint import ARRAYS, CARD, FOLDER, SEGMENTS, Checkpoints
from train.learn.learner import LearnerSpec
from train.learn.registry import find_learner
from train.learn.run import main, train

Start = Callable[..., subprocess.Popen[str]]
PPO = {"n_envs": 3, "n_steps": 8, "batch_size": 12, "n_epochs": 2, "horizon": 2.0}
SAC = {"n_envs": 3, "learning_starts": 12, "replay": 30, "batch_size": 8, "horizon": 2.0}
START = min(shipped.RECURRENT["apg-storm"].glob("seed-*"))
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "ppo": ("ppo", {**PPO, "selected_by": 2}),
    "ppo on sensors": ("ppo", {**PPO, "observation": "sensors"}),
    "ppo, predictive, on sensors": (
        "ppo-predictive",
        {**PPO, "observation": "sensors", "practice": 0, "selected_by": 0, "critic_first": 2},
    ),
    "ppo, predictive": ("ppo-predictive", {**PPO, "practice": 4, "selected_by": 0, "horizon": 4.0}),
    "ppo, predictive, on Landing's sensors": (
        "ppo-predictive",
        {**PPO, "observation": "sensors", "task": "Landing", "practice": 2, "selected_by": 2, "horizon": 4.0},
    ),
    "ppo of rsl_rl": ("ppo-rsl", {**PPO, "device": "cpu", "drift_limit": 0.5, "selected_by": 2}),
    "ppo from a recurrent agent": (
        "ppo-recurrent",
        {**PPO, "start_from": START, "practice": 4, "selected_by": 2, "critic_first": 2, "horizon": 4.0},
    ),
    "sac": ("sac", SAC),
    "sac from a recurrent agent": (
        "sac-recurrent",
        {**SAC, "start_from": START, "learning_starts": 0, "practice": 0, "selected_by": 2, "critic_first": 60},
    ),
    "sac on sensors, speed": ("sac", {**SAC, "observation": "sensors", "action": "speed", "n_steps": 2}),
}
STEPS = 120
QUIET = Console(quiet=True)


def options_of(case: str, out: Path, **more: Any) -> tuple[LearnerSpec, Any]:
    name, few = CASES[case]
    if name == "ppo-rsl":
        pytest.importorskip("rsl_rl", reason='rsl-rl-lib is not installed (extra "cuda")')
    spec = find_learner(name)
    return spec, spec.options(**{**few, "timesteps": STEPS, "eval_scenarios": 0, "out": out, "log": (), **more})


def agent(folder: Path) -> bytes:
    return min(folder.glob("*.safetensors")).read_bytes()


LONG = ("ppo, predictive, on Landing's sensors",)


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=pytest.mark.slow) if case in LONG else case for case in CASES]
)
def test_a_stopped_training_goes_on_to_the_same_agent(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("train.learn.selection.LOOKS", 2)
    spec, options = options_of(case, tmp_path / "whole")
    assert train(spec, options, QUIET) == 0
    spec, options = options_of(case, tmp_path / "parts", checkpoint_every=0.0)
    write, written = Checkpoints.write, []

    def stops(self: Checkpoints, learner: Any) -> Path:
        written.append(write(self, learner))
        if len(written) in (1, 2, 4):
            raise checkpoint.Stopped(signal.SIGTERM)
        return written[-1]

    monkeypatch.setattr(Checkpoints, "write", stops)
    assert [train(spec, options, QUIET) for _ in range(4)] == [143, 143, 143, 0]
    assert agent(tmp_path / "parts") == agent(tmp_path / "whole")
    assert not (tmp_path / "parts" / FOLDER).exists()
    with pytest.raises(InvalidValue, match=r"this training is finished; pass --overwrite"):
        train(spec, options, QUIET)


def stopped_after(
    count: int, case: str, out: Path, monkeypatch: pytest.MonkeyPatch, **more: Any
) -> tuple[LearnerSpec, Any]:
    """A training that was stopped after so many checkpoints."""
    spec, options = options_of(case, out, checkpoint_every=0.0, **more)
    write, written = Checkpoints.write, []

    def stops(self: Checkpoints, learner: Any) -> Path:
        written.append(write(self, learner))
        if len(written) == count:
            raise checkpoint.Stopped(signal.SIGINT)
        return written[-1]

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoints, "write", stops)
        assert train(spec, options, QUIET) == 130
    return spec, options


@pytest.fixture(scope="module")
def whole_sac(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Agent of a training that was not interrupted."""
    spec, options = options_of("sac", tmp_path_factory.mktemp("whole"))
    train(spec, options, QUIET)
    return agent(options.out)


@pytest.mark.parametrize("damage", ["card", "arrays", "segment", "card is gone", "half-written beside it"])
def test_a_damaged_checkpoint_is_passed_over(
    damage: str, whole_sac: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    spec, options = stopped_after(7, "sac", tmp_path / "parts", monkeypatch)
    options = replace(options, checkpoint_every=1e6)
    places = sorted((tmp_path / "parts" / FOLDER).glob("[0-9]*"))
    assert len(places) == 2
    newest = places[-1]
    victim = {
        "card": newest / CARD,
        "arrays": newest / ARRAYS,
        "segment": max((tmp_path / "parts" / FOLDER / SEGMENTS).iterdir()),
    }.get(damage)
    if victim is not None:
        data = bytearray(victim.read_bytes())
        data[len(data) // 2] ^= 1
        victim.write_bytes(data)
    elif damage == "card is gone":
        (newest / CARD).unlink()
    else:
        (newest.parent / f".{int(newest.name) + 3:012d}.1").mkdir()
    assert train(spec, options, QUIET) == 0
    assert agent(tmp_path / "parts") == whole_sac


def test_a_replay_is_written_once_and_what_is_overwritten_in_it_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stopped_after(30, "sac", tmp_path, monkeypatch)
    (newest,) = sorted((tmp_path / FOLDER).glob("[0-9]*"))[-1:]
    replay = json.loads(json.loads((newest / CARD).read_text())["card"])["replay"]
    spans = [(segment["from"], segment["to"]) for segment in replay["segments"]]
    assert [b for _, b in spans[:-1]] == [a for a, _ in spans[1:]]
    size = SAC["replay"] // SAC["n_envs"]
    assert spans[-1][1] == replay["added"] == 29
    assert spans[0][0] <= 29 - size < spans[0][1]
    # Those of the newest checkpoint and of the one before it.
    assert len(list((tmp_path / FOLDER / SEGMENTS).iterdir())) <= size + 1


def test_what_was_begun_with_overwrite_is_not_overwritten_by_resume(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stopped_after(3, "ppo", tmp_path, monkeypatch, overwrite=True)
    monkeypatch.setattr(sys, "argv", ["train.ppo", "--resume", str(tmp_path)])
    assert main("ppo") == 0
    assert "goes on from 48 control steps" in capsys.readouterr().out


def test_what_overwrites_a_finished_training_goes_on_as_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec, options = options_of("ppo", tmp_path / "whole", gamma=0.9)
    assert train(spec, options, QUIET) == 0
    spec, options = options_of("ppo", tmp_path / "parts")
    assert train(spec, options, QUIET) == 0
    spec, options = stopped_after(2, "ppo", tmp_path / "parts", monkeypatch, gamma=0.9, overwrite=True)
    (tmp_path / "parts" / "metrics.json").unlink()  # as if it had been killed
    assert train(spec, replace(options, overwrite=False), QUIET) == 0
    assert agent(tmp_path / "parts") == agent(tmp_path / "whole")


def test_other_options_are_not_taken_for_the_same_training(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec, options = stopped_after(3, "ppo", tmp_path, monkeypatch)
    with pytest.raises(InvalidValue, match="exists and is not empty"):
        train(spec, replace(options, gamma=0.9), QUIET)
    assert train(spec, replace(options, gamma=0.9, overwrite=True), QUIET) == 0


COMMAND = [
    *("--timesteps", "10000000", "--n-envs", "8", "--n-steps", "16", "--batch-size", "64", "--n-epochs", "2"),
    *("--eval-scenarios", "0", "--checkpoint-every", "0", "--log"),
]


def started(start: Start, out: Path, *more: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "train.ppo", *COMMAND, "--out", str(out), *more]
    return start(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def wait_for_checkpoints(out: Path, count: int) -> None:
    until = time.monotonic() + 120.0
    while len(list((out / FOLDER).glob("[0-9]*"))) < count:
        assert time.monotonic() < until
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("number", "status"), [pytest.param(signal.SIGTERM, 143, marks=pytest.mark.slow), (signal.SIGINT, 130)]
)
def test_a_signal_writes_a_checkpoint_and_says_so(number: int, status: int, tmp_path: Path, start: Start) -> None:
    process = started(start, tmp_path / "run")
    wait_for_checkpoints(tmp_path / "run", 1)
    if number == signal.SIGTERM:  # a second writer is refused meanwhile
        said = started(start, tmp_path / "run").communicate(timeout=120.0)[1]
        assert said == f"error: out = '{tmp_path / 'run'}': another process is writing into it\n"
    process.send_signal(number)
    said, errors = process.communicate(timeout=120.0)
    assert (process.returncode, errors) == (status, "")
    assert f"stopped by {signal.Signals(number).name}" in said
    metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
    assert metrics["interrupted"]
    # What was learned so far is an agent, too.
    assert load(tmp_path / "run").card.timesteps == metrics["timesteps"]
    assert len(list((tmp_path / "run" / FOLDER).glob("[0-9]*"))) == 2
