"""The trials of ``python -m benchmarks.torture``, in short; and that they tell what is lost from what survives."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from benchmarks.torture import __main__ as torture
from benchmarks.torture import full_disk, kills, studies
from benchmarks.torture.processes import start
from benchmarks.torture.trial import Outcome, Results, Trial, attempts

if sys.platform == "win32":
    pytest.skip("needs fork and signals", allow_module_level=True)

QUIET = Console(quiet=True)


@pytest.mark.slow
@pytest.mark.parametrize("learner", ["train.ppo", "train.sac"])
def test_a_training_survives_kills(learner: str, tmp_path: Path) -> None:
    options = torture.Options(kills=3, only=f"{learner}, killed", out=tmp_path / "reliability.json")
    assert torture.run(options, QUIET) == 0
    (row,) = json.loads(options.out.read_text(encoding="utf-8"))["rows"].values()
    assert (row["tried"], row["survived"], row["failures"]) == (3, 3, [])


@pytest.mark.slow
def test_a_training_survives_a_full_disk(tmp_path: Path) -> None:
    outcome = full_disk.Filled("train.ppo", mounted=False).attempt(np.random.default_rng(1), tmp_path, 1)
    assert outcome.failures == ()
    assert (outcome.survived, outcome.counts["had room enough"]) == (1, 0)


def test_damaged_and_temporary_files_are_told_from_whole_ones(tmp_path: Path) -> None:
    (tmp_path / "whole.json").write_text("{}")
    (tmp_path / "whole.toml").write_text("a = 1")
    assert list(full_disk.damaged(tmp_path)) == []
    for name in ("half.json", "half.toml", "half.safetensors", ".left.json"):
        (tmp_path / name).write_text("{")
    assert [each.split()[0] for each in full_disk.damaged(tmp_path)] == [
        ".left.json",
        "half.json",
        "half.safetensors",
        "half.toml",
    ]


def test_another_agent_is_told_from_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    killed = kills.Killed("train.ppo")
    killed.__dict__["_digest"] = "0" * 64
    outcome = killed.attempt(np.random.default_rng(0), tmp_path, 1)
    assert (outcome.survived, outcome.failures) == (0, ("another agent",))


def test_a_command_starts_in_a_folder_and_its_workers_return_what_it_defines(tmp_path: Path) -> None:
    small = ("--scenarios", 0, "--max-evaluations", 1, "--limited", 0, "--workers", 1, "--out", "out")
    process = start(tmp_path / "said", "train.optimisers", *small, folder=tmp_path)
    process.join(300.0)
    assert process.exitcode == 0, (tmp_path / "said").read_text(encoding="utf-8")
    assert len(json.loads((tmp_path / "out" / "comparison.json").read_text(encoding="utf-8"))) == 4


def test_a_study_that_fails_unkilled_is_not_the_truth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(studies.COMMANDS, "train.drives", "--duration -1 --out out")
    with pytest.raises(RuntimeError, match=r"(?s)exit status 2 unkilled: .*duration = -1"):
        studies.Killed("train.drives").attempt(np.random.default_rng(0), tmp_path, 1)


def test_all_but_measured_seconds_is_compared(tmp_path: Path) -> None:
    rows = [{"quantity": "f1, Hz", "measured": "2"}, {"quantity": "modes, s", "measured": "3"}]
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "data.json").write_text(json.dumps({"omega1": 1.0, "seconds": 2.0, "rows": rows}))
    (tmp_path / "inner" / "notes.md").write_text("2 s")
    (tmp_path / "data.json").write_text("whole")
    assert studies.contents(tmp_path, ("inner/data.json", "inner/notes.md")) == {
        "data.json": b"whole",
        "inner/data.json": {"omega1": 1.0, "rows": [rows[0], {}]},
    }


def test_an_interrupted_run_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[float] = []

    def attempt(rng: np.random.Generator, folder: Path, most: int) -> Outcome:
        assert folder.is_dir()
        assert not any(folder.iterdir())
        if len(drawn) == interrupted_after:
            raise KeyboardInterrupt
        drawn.append(rng.random())
        return Outcome(min(2, most), 1, {"odd": 1}, ("lost",))

    trial = Trial(name="a trial", what="nothing", wanted=5, attempt=attempt)
    monkeypatch.setattr(torture.Options, "trials", property(lambda _: [trial]))
    options, interrupted_after = torture.Options(out=tmp_path / "reliability.json"), 3
    assert torture.run(options, QUIET) == 1
    whole, expected = list(drawn), json.loads(options.out.read_text(encoding="utf-8"))
    drawn.clear()
    interrupted_after = 2
    with pytest.raises(KeyboardInterrupt):
        torture.run(options, QUIET)
    interrupted_after = 3
    assert torture.run(options, QUIET) == 1
    found = json.loads(options.out.read_text(encoding="utf-8"))
    assert drawn == whole
    for each in (found, expected):
        each["rows"]["a trial"].pop("seconds")
    assert found == expected
    (row,) = found["rows"].values()
    assert (row["tried"], row["survived"], row["counts"], row["failures"]) == (5, 3, {"odd": 3}, ["lost"] * 3)
    assert not list(tmp_path.glob("*.partial.json"))


def test_rows_of_other_trials_are_kept(tmp_path):
    def trial(name):
        return Trial(name=name, what="nothing", wanted=1, attempt=lambda rng, folder, most: Outcome(1, 1))

    file = tmp_path / "results.json"
    for names in (("a", "b"), ("b", "c")):
        trials = [trial(name) for name in names]
        results = Results.begin(f"try {names[0]}", 0, trials, tmp_path / "partial.json")
        for each in trials:
            assert len(list(attempts(each, results.rows[each.name], 0))) == 1
        results.beside(file).save(file)
    rows = Results.read(file).rows
    assert {name: row.command for name, row in rows.items()} == {"a": "try a", "b": "try b", "c": "try b"}
    assert all(row.survived == 1 for row in rows.values())
