import csv
import json
import os
import sqlite3
import struct
import subprocess
import sys
from importlib.util import find_spec

import pytest
from gymnasium.error import DependencyNotInstalled
from stable_baselines3.common.logger import Logger

from train.learn.logs import Figures, open_logger, require_logs

TINY = ["--timesteps=512", "--n-envs=4", "--n-steps=16", "--batch-size=64", "--n-epochs=1", "--eval-scenarios=0"]
KEY = "rollout/heave_reduction"


def train(folder, *logs, **environment):
    """Train for a moment from within ``folder``; return where the run is, and what was said."""
    ended = subprocess.run(
        [sys.executable, "-m", "train.ppo", *TINY, "--log", *logs, "--out", "run"],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": os.getcwd()} | environment,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    return folder / "run", ended


def reductions_by_step(run):
    """Heave reductions in the CSV file, by control steps."""
    with (run / "log" / "progress.csv").open() as file:
        return {int(row["time/total_timesteps"]): float(row[KEY]) for row in csv.DictReader(file) if row[KEY]}


def records(stored):
    """Records of a run of Weights & Biases, stored as LevelDB stores its log: blocks of 32 KiB of fragments."""
    at, record, block = 7, b"", 2**15
    while at + 7 <= len(stored):
        if (rest := block - at % block) < 7:
            at += rest
            continue
        _, length, kind = struct.unpack_from("<IHB", stored, at)
        record += stored[at + 7 : at + 7 + length]
        at += 7 + length
        # 1: whole, 2: first, 3: middle, 4: last.
        if kind in (1, 4):
            yield record
            record = b""


def needs(name):
    return pytest.mark.skipif(find_spec(name) is None, reason=f"needs the extra {name}")


def test_what_is_a_number_goes_to_a_tracker_unless_it_is_kept_from_it():
    seen = []
    logger = Logger(None, [Figures("mlflow", lambda figures, step: seen.append((figures, step)))])
    logger.record("a", 2)
    logger.record("word", "calm")
    logger.record("kept", 1.0, exclude=("mlflow", "wandb"))
    logger.record("elsewhere", 0.5, exclude="tensorboard")
    logger.dump(64)
    assert seen == [({"a": 2.0, "elsewhere": 0.5}, 64)]


@pytest.mark.parametrize("names", [(), ("tensorboard",)])
def test_the_csv_file_is_there_whatever_is_named(names, tmp_path):
    with open_logger(tmp_path, names, {}) as logger:
        logger.record("a", 1.0)
        logger.dump(3)
    assert (tmp_path / "log" / "progress.csv").read_text() == "a\n1.0\n"
    assert len(list((tmp_path / "log").glob("events.out.tfevents*"))) == len(names)


def test_an_unknown_log_is_refused_in_one_sentence_before_anything_is_written(tmp_path):
    _, ended = train(tmp_path, "tensorboard", "paper")
    assert ended.returncode == 2
    assert ended.stderr == (
        "error: log = 'paper': must be among tensorboard, wandb, mlflow, as in --log tensorboard wandb\n"
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["wandb", "mlflow"])
def test_a_missing_extra_is_named_with_the_command(name, tmp_path, monkeypatch):
    if find_spec(name):
        pytest.skip(f"the extra {name} is there")
    # What an offline run of Weights & Biases leaves behind is no package.
    (tmp_path / name).mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(DependencyNotInstalled, match=rf'{name} is not installed: pip install "aframe-heave\[{name}\]"'):
        require_logs([name])


@needs("wandb")
def test_weights_and_biases_offline_has_the_figures_of_the_csv_file(tmp_path):
    from wandb.proto.wandb_internal_pb2 import Record

    run, ended = train(tmp_path, "wandb", WANDB_MODE="offline")
    assert ended.returncode == 0, ended.stderr
    (stored,) = run.glob("log/wandb/offline-run-*/run-*.wandb")
    found = {}
    for data in records(stored.read_bytes()):
        row = {item.nested_key[0]: json.loads(item.value_json) for item in Record.FromString(data).history.item}
        if KEY in row:
            found[row["_step"]] = row[KEY]
    assert found == pytest.approx(reductions_by_step(run))
    assert len(found) >= 2
    assert not list(run.glob("log/events.out.tfevents*"))


@needs("wandb")
def test_weights_and_biases_without_a_login_says_what_helps(tmp_path):
    run, ended = train(tmp_path, "wandb", WANDB_MODE="online", WANDB_API_KEY="", NETRC=str(tmp_path / "netrc"))
    assert ended.returncode == 2
    (line,) = [line for line in ended.stderr.splitlines() if line.startswith("error: ")]
    assert "wandb login" in line
    assert "WANDB_MODE=offline" in line
    assert not run.exists()


@needs("mlflow")
def test_mlflow_has_the_figures_of_the_csv_file_and_the_options(tmp_path):
    store = tmp_path / "mlflow.db"
    run, ended = train(tmp_path, "mlflow", "tensorboard", MLFLOW_TRACKING_URI=f"sqlite:///{store}")
    assert ended.returncode == 0, ended.stderr
    with sqlite3.connect(store) as database:
        found = dict(database.execute("SELECT step, value FROM metrics WHERE key = ?", (KEY,)))
        assert found == pytest.approx(reductions_by_step(run))
        assert len(found) >= 2
        assert dict(database.execute("SELECT key, value FROM params"))["n_steps"] == "16"
        assert database.execute("SELECT name, status FROM runs").fetchall() == [("run", "FINISHED")]
        assert ("aframe-heave",) in database.execute("SELECT name FROM experiments").fetchall()
    assert list(run.glob("log/events.out.tfevents*"))


@needs("mlflow")
def test_a_store_that_mlflow_does_not_know_is_refused_in_one_sentence(tmp_path):
    run, ended = train(tmp_path, "mlflow", MLFLOW_TRACKING_URI="tape://x")
    assert ended.returncode == 2
    (line,) = [line for line in ended.stderr.splitlines() if line.startswith("error: ")]
    assert "log = 'mlflow': " in line
    assert "tape://x takes no runs; set MLFLOW_TRACKING_URI=" in line
    assert not run.exists()
