import os
import signal
import sqlite3
import subprocess
import sys
import time

import pytest

from agents import rollout
from train.evaluate import __main__ as evaluate
from train.evaluate import run as evaluate_run

POLICIES = ("drive-map:clock", "inverse dynamics", "feed-forward + feedback")
COMMAND = ("--policies", *POLICIES, "--scenarios", "5", "--episode-duration", "5", "--out", "out")


class Killed(BaseException):
    """What a process that is killed never sees."""


def command(monkeypatch, folder):
    folder.mkdir(exist_ok=True)
    monkeypatch.chdir(folder)
    monkeypatch.setattr("sys.argv", ["train.evaluate", *COMMAND])
    return evaluate.main()


def files(folder):
    return {path.name: path.read_bytes() for path in (folder / "out").iterdir()}


def test_an_interrupted_comparison_goes_on_and_ends_with_the_same_bytes(tmp_path, monkeypatch, capsys):
    assert command(monkeypatch, tmp_path / "whole") == 0
    # In blocks, too: they change nothing.
    monkeypatch.setattr(evaluate_run, "BLOCK", 2)
    begun = []

    def counted(*arguments, **more):
        begun.append(1)
        if len(begun) in (3, 7, 8):
            raise Killed
        return rollout.run(*arguments, **more)

    monkeypatch.setattr(evaluate_run, "run", counted)
    for _ in range(3):
        with pytest.raises(Killed):
            command(monkeypatch, tmp_path / "parts")
    assert command(monkeypatch, tmp_path / "parts") == 0
    # Four policies in three blocks each: only what was in flight ran again.
    assert len(begun) == 4 * 3 + 3
    assert files(tmp_path / "parts") == files(tmp_path / "whole")
    assert "jobs.sqlite" not in files(tmp_path / "whole")
    with pytest.raises(SystemExit):
        command(monkeypatch, tmp_path / "parts")
    assert "this run is finished; pass --overwrite to do it again" in capsys.readouterr().err


def test_a_comparison_that_is_killed_goes_on(tmp_path, start):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    line = [sys.executable, "-m", "train.evaluate", *COMMAND, "--no-report"]
    process = start(line, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 300.0
    while kept(tmp_path) < 1 and time.monotonic() < until and process.poll() is None:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait(timeout=60.0) == -signal.SIGKILL
    before = kept(tmp_path)
    again = start(line, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    said = again.communicate(timeout=300.0)[1]
    assert again.returncode == 0, said
    assert before >= 1
    assert "warning" not in said
    assert {"comparison.json", "comparison.md", "comparison.png"} <= set(files(tmp_path))
    assert "jobs.sqlite" not in files(tmp_path)


def kept(folder):
    path = folder / "out" / "jobs.sqlite"
    if not path.exists():
        return 0
    with sqlite3.connect(path, timeout=60.0) as database:
        try:
            return int(database.execute("SELECT COUNT(*) FROM results").fetchone()[0])
        except sqlite3.OperationalError:  # the table is not there yet
            return 0
