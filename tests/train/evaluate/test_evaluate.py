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


@pytest.mark.parametrize(
    ("model", "drives"), [("simplified", tuple(TUNED)), pytest.param("rfem", ("H-Ω1",), marks=pytest.mark.slow)]
)
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


def test_without_its_extra_the_report_is_left_out_and_said(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(evaluate, "REPORT_PACKAGES", ("jinja2", "absent_package"))
    out = tmp_path / "out"
    command(monkeypatch, "--policies", "drum still", "--scenarios", 2, "--no-report", "--out", out)
    said = " ".join(capsys.readouterr().out.split())
    assert 'no report: absent_package not installed: pip install "aframe-heave[report]"' in said
    assert (out / "comparison.md").is_file()
    with pytest.raises(SystemExit):
        command(monkeypatch, "--policies", "drum still", "--scenarios", 2, "--report", "--out", tmp_path / "none")
    assert not (tmp_path / "none").exists()


def test_the_report_is_written_beside_the_episodes(tmp_path, monkeypatch):
    out = tmp_path / "out"
    # More privileged ones than there are: all of them.
    few = ("--scenarios", 2, "--privileged", 50, "--out", out)
    assert command(monkeypatch, "--policies", "inverse dynamics", "S-Ω1 for each scenario", *few) == 0
    rows = {row["policy"]: row for row in json.loads((out / "comparison.json").read_text(encoding="utf-8"))["policies"]}
    assert rows["S-Ω1 for each scenario"]["scenarios"] == 2
    assert (out / "episodes.parquet").is_file()
    assert "--policies &#39;inverse dynamics&#39; " in (out / "report.html").read_text(encoding="utf-8")


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


SPY = """
from pathlib import Path
import numpy as np
from agents.policy import Knowledge

class Spy:
    name, knows = "spy", Knowledge.SENSORS

    def reset(self, scenarios, control_period):
        self.handed = {scenario.load_mass for scenario in scenarios}

    def act(self, observation, time):
        Path("seen.txt").write_text(f"{self.handed} {set(observation[:, 8].tolist())}")
        return np.zeros(len(observation))
"""


def test_the_comparison_keeps_the_truth_from_a_policy_that_looks_for_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("spy.py").write_text(SPY, encoding="utf-8")
    Path("wrong.toml").write_text("load_mass = 60e3\n[told]\nload_mass = 50e3\n", encoding="utf-8")
    few = ("--scenarios", "wrong.toml", "--count", 2, "--workers", 1, "--no-report", "--out", tmp_path / "out")
    assert command(monkeypatch, "--policies", "spy:Spy", *few) == 0
    assert Path("seen.txt").read_text() == "{50000.0} {50000.0}"
