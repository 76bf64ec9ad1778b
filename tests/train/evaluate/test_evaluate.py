import json
from pathlib import Path

import pytest

from agents.drives.tuned import TUNED
from train.evaluate import __main__ as evaluate

RESULTS = Path(__file__).parents[3] / "results"
AGENT, MAP = RESULTS / "agents" / "ppo" / "seed-0", f"{RESULTS / 'drive-map'}:clock"


def command(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["train.evaluate", *map(str, arguments)])
    return evaluate.main()


@pytest.mark.parametrize(("model", "drives"), [("simplified", tuple(TUNED)), ("rfem", ("H-Ω1",))])
def test_the_committed_agent_is_as_good_as_the_results_say(model, drives, tmp_path, monkeypatch):
    out = tmp_path / "out"
    few = ("--scenarios", 12, "--privileged", 0, "--no-report", "--out", out)
    assert command(monkeypatch, "--policies", AGENT, MAP, "output zero", *drives, "--model", model, *few) == 0
    rows = {row["policy"]: row for row in json.loads((out / "comparison.json").read_text(encoding="utf-8"))["policies"]}
    # Better than the hand-written base alone: something was learned.
    assert rows["residual PPO"]["reduction"]["value"] > rows["output zero"]["reduction"]["value"] + 0.001
    assert rows["residual PPO"]["worse_than_still"] == 0
    assert {*drives, "drive map by the clock"} <= set(rows)
    assert all(
        row["knows"] == "clock"
        for name, row in rows.items()
        if name not in ("residual PPO", "output zero", "drum still")
    )
    assert json.loads((out / "run.json").read_text())["command"].startswith("python -m train.evaluate --policies")


def test_the_report_is_written_beside_the_episodes(tmp_path, monkeypatch):
    out = tmp_path / "out"
    assert (
        command(monkeypatch, "--policies", "inverse dynamics", "--scenarios", 2, "--privileged", 0, "--out", out) == 0
    )
    assert (out / "episodes.parquet").is_file()
    assert "--policies &#39;inverse dynamics&#39; --scenarios 2" in (out / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--policies", "absent"), "policy = 'absent': must be one of 'drum still'"),
        (("--scenarios", 0), "scenarios = 0: must be in [1, 20000]"),
        (("--rfem-modes", 5), "rfem_modes"),
    ],
)
def test_bad_options_are_one_clear_line(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        command(monkeypatch, *arguments)
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
