import csv
import json
import math
import tomllib

import numpy as np
import pytest

from aframe_env import Scenario
from aframe_env.scenario.file import read_scenario, scenario_text
from agents.drives.functions import HarmonicDrive, SplineDrive
from train.drives import __main__ as drives

KEYS = ["drive", "objective", "omega1", "omega2", "rms", "amplitude", "evaluations", "seconds"]


def command(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["train.drives", *map(str, arguments)])
    return drives.main()


def test_paper_case_writes_the_sources_experiment(tmp_path, monkeypatch):
    out = tmp_path / "paper"
    assert command(monkeypatch, "--case", "paper", "--out", out) == 0
    rows = json.loads((out / "summary.json").read_text())
    assert [list(row) for row in rows] == [KEYS] * 5
    names = [(row["drive"], row["objective"]) for row in rows]
    pairs = [(drive, objective) for drive in ("spline", "harmonic") for objective in ("omega1", "omega2")]
    assert names == [("still", None), *pairs]
    still, spline, _, harmonic, _ = rows
    assert still["amplitude"] > 2.0
    assert all(row["amplitude"] <= (0.040 if row["drive"] == "spline" else 0.005) for row in rows[1:])
    assert spline["amplitude"] > 4.0 * harmonic["amplitude"]
    for row in rows:
        assert row["rms"] == pytest.approx(math.sqrt(row["omega1"] / 36.0))
    assert {p.name for p in out.glob("*.png")} == {
        "load_drum_still.png", "drum_drives.png", "load_spline.png", "load_harmonic.png", "amplitudes.png"
    }  # fmt: skip
    for picture in out.glob("*.png"):
        assert picture.read_bytes().startswith(b"\x89PNG")
    assert "differs from the paper" in (out / "notes.md").read_text(encoding="utf-8")
    with (out / "summary.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 5
    _histories_hold_what_the_summary_says(out, rows)


def _histories_hold_what_the_summary_says(out, rows):
    with (out / "histories.csv").open(encoding="utf-8") as file:
        table = list(csv.DictReader(file))
    time = np.array([float(line["time_s"]) for line in table])
    assert time[[0, -1]] == pytest.approx([0.0, 36.0])
    still = np.array([float(line["drum_still_depth_error_m"]) for line in table])
    assert np.abs(still).max() == pytest.approx(rows[0]["amplitude"], rel=1e-3)
    found = json.loads((out / "drives.json").read_text())
    for entry in found:
        family = SplineDrive if entry["drive"] == "spline" else HarmonicDrive
        drive = family.from_variables(entry["variables"], entry["duration"])
        label = f"{entry['drive'][0].upper()}-Ω{entry['objective'][-1]}"
        angle = [float(line[f"{label}_drum_angle_rad"]) for line in table]
        assert angle == pytest.approx(drive.angle(time).tolist(), abs=1e-7)


def test_any_scenario_from_a_file(tmp_path, monkeypatch):
    path = tmp_path / "mine.toml"
    path.write_text('load_mass = 40e3\ntarget_level = -120.0\ninitial = "rest"\nrope_damping = 1e4\n')
    out = tmp_path / "out"
    arguments = ("--drive", "harmonic", "--objective", "omega1", "--harmonics", 2, "--duration", 24, "--out", out)
    assert command(monkeypatch, "--scenario", path, *arguments) == 0
    rows = json.loads((out / "summary.json").read_text())
    assert [row["drive"] for row in rows] == ["still", "harmonic"]
    assert rows[1]["rms"] < 0.01 * rows[0]["rms"]
    assert read_scenario(out / "scenario.toml") == read_scenario(path)
    assert "differs from the paper" not in (out / "notes.md").read_text(encoding="utf-8")


def test_drives_hold_the_load_in_the_full_model_too(tmp_path, monkeypatch):
    path, out = tmp_path / "paper.toml", tmp_path / "out"
    path.write_text(scenario_text(drives.paper_case()))
    arguments = ("--drive", "harmonic", "--objective", "omega1", "--duration", 14, "--out", out)
    assert command(monkeypatch, "--scenario", path, "--check", "rfem", *arguments) == 0
    still, harmonic = json.loads((out / "summary.json").read_text())
    assert still["swing_rfem"] > 2.0
    assert harmonic["swing_rfem"] < 0.01
    # The frame sags by some centimetres under 100 t: no drive of the simplified model knows.
    assert 0.02 < harmonic["amplitude_rfem"] < 0.05
    assert harmonic["omega1_rfem"] <= 14.0 * harmonic["amplitude_rfem"] ** 2
    assert (out / "full_model.png").read_bytes().startswith(b"\x89PNG")
    assert "in the full model" in (out / "notes.md").read_text(encoding="utf-8")


def test_the_same_seed_gives_the_same_drives(tmp_path, monkeypatch):
    texts = []
    for name in ("a", "b"):
        arguments = ("--objective", "omega2", "--drive", "spline", "--max-evaluations", 1500, "--seed", 3)
        path = tmp_path / "paper.toml"
        path.write_text(scenario_text(Scenario.paper()))
        assert command(monkeypatch, "--scenario", path, *arguments, "--out", tmp_path / name) == 0
        texts.append((tmp_path / name / "drives.json").read_text())
    assert texts[0] == texts[1]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--intervals", "2"], "intervals = 2: must be in [3, 500]"),
        (["--duration", "-3"], "duration = -3.0 s: must be in [0.1, 3600] s"),
        (["--case", "paper", "--scenario", "x.toml"], "give one of the two"),
        (["--scenario", "absent.toml"], "cannot be read"),
    ],
)
def test_bad_options_are_one_clear_line(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stopped:
        command(monkeypatch, *arguments)
    assert stopped.value.code == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_a_folder_with_something_in_it_is_kept(tmp_path, monkeypatch, capsys):
    (tmp_path / "kept.txt").write_text("mine")
    with pytest.raises(SystemExit):
        command(monkeypatch, "--out", tmp_path)
    assert "exists and is not empty" in capsys.readouterr().err
    assert [p.name for p in tmp_path.iterdir()] == ["kept.txt"]


def test_ctrl_c_leaves_nothing_half_written(tmp_path, monkeypatch):
    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr("train.drives.experiment.optimise", interrupted)
    out = tmp_path / "out"
    assert command(monkeypatch, "--out", out) == 130
    assert {path.name for path in out.iterdir()} == {"config.toml", "jobs.sqlite", "run.json"}


def test_gauss_newton_finds_omega1_and_leaves_omega2_to_nelder_mead(tmp_path, monkeypatch):
    rows = {}
    for optimiser in ("nelder-mead", "gauss-newton"):
        out = tmp_path / optimiser
        options = ("--drive", "harmonic", "--duration", 12, "--optimiser", optimiser, "--out", out)
        assert command(monkeypatch, *options) == 0
        rows[optimiser] = json.loads((out / "summary.json").read_text())[1:]
    for plain, quick in zip(rows["nelder-mead"], rows["gauss-newton"], strict=True):
        assert quick[quick["objective"]] <= 1.02 * plain[plain["objective"]]
    assert rows["gauss-newton"][0]["evaluations"] < 0.5 * rows["nelder-mead"][0]["evaluations"]


def test_run_records_command_and_versions(tmp_path, monkeypatch):
    out = tmp_path / "out"
    command(monkeypatch, "--drive", "harmonic", "--objective", "omega1", "--out", out)
    run = json.loads((out / "run.json").read_text())
    assert "-m train.drives --drive harmonic" in run["command"]
    assert {"numpy", "scipy", "numba"} <= set(run["versions"])
    assert tomllib.loads((out / "scenario.toml").read_text(encoding="utf-8"))["load_mass"] == 1e5
