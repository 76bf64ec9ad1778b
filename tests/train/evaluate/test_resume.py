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


def test_a_comparison_that_is_killed_goes_on(tmp_path, kill_module, run_module):
    line = ("train.evaluate", *COMMAND, "--no-report")
    kill_module(tmp_path / "out" / "jobs.sqlite", 1, *line, cwd=tmp_path)
    assert "warning" not in run_module(*line, cwd=tmp_path)
    assert {"comparison.json", "comparison.md", "comparison.png"} <= set(files(tmp_path))
    assert "jobs.sqlite" not in files(tmp_path)
