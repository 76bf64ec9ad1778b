import errno
import json
import os

import pytest

from aframe_env.rfem.reference import static_cases, time_series
from aframe_env.validation import InvalidValue
from train.verify.__main__ import main
from train.verify.cases import dynamic_case, release_case, static_case


def test_load_case_from_file(tmp_path):
    case, out = tmp_path / "case.toml", tmp_path / "out.json"
    case.write_text("own_weight = false\n[forces]\nS = [0, 0, -981e3]\n")
    assert main(["--load-case", str(case), "--out", str(out)]) == 0
    found, reference = json.loads(out.read_text()), static_cases()["V"]
    assert set(reference) <= set(found)
    assert found["u_S_D"] == pytest.approx(reference["u_S_D"], rel=1e-4, abs=1e-12)
    assert found["S_R_tension"] == pytest.approx(reference["S_R_tension"], rel=1e-6)
    assert len(found["along"]) > 70
    assert list(tmp_path.iterdir()).__len__() == 2


def test_release_has_the_reference_columns():
    columns = release_case({"rfes": [5, 2], "rope_tension": 1e5, "ramp": 0.1, "duration": 0.02, "step": 1e-3})
    assert list(columns) == list(time_series("release_ramp"))
    assert len(columns["t_s"]) == 5


def test_dynamic_case_has_the_reference_columns():
    harmonic = {"coordinate": "heave", "amplitude": 1.0, "period": 9.0}
    motion = {"kind": "harmonic", "harmonics": [harmonic]}
    columns = dynamic_case(
        {"rfes": [5, 2], "motion": motion, "duration": 0.2, "initial": "rest", "rope_damping": 1e4, "ramp": 2.0}
    )
    assert set(columns) == set(time_series("paper_flexible"))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"own_wieght": True}, "own_wieght: unknown key; must be one of"),
        ({"own_weight": 1}, "own_weight.*true or false"),
        ({"rfes": [5]}, "rfes"),
        ({"rfes": [5, 3]}, "even"),
        ({"forces": {"Q": [0, 0, 1]}}, "forces.Q"),
        ({"forces": {"S": "down"}}, "forces.S"),
        ({"rope_tension": -5}, r"rope_tension = -5 N: must be in \[0, inf\) N"),
        ({"servomotors": "soft"}, "servomotors.*'rigid', 'elastic'"),
        ({"servomotors": "elastic"}, "servomotor_stiffness.*N/m"),
        ({"servomotor_stiffness": 1e8}, "elastic"),
        ({"frame": {"luffing_angle": 9.0}}, "luffing_angle.*rad"),
        ({"layout": "two"}, "layout"),
    ],
)
def test_bad_keys_are_named(data, words):
    with pytest.raises(InvalidValue, match=words):
        static_case(data)


def test_errors_reach_the_user_without_a_traceback(tmp_path, capsys):
    case = tmp_path / "case.toml"
    case.write_text("own_weight = maybe\n")
    out = str(tmp_path / "out.json")
    for arguments, words in (
        (["--load-case", str(case)], "not TOML"),
        (["--release", str(tmp_path / "none.toml")], "cannot be read"),
    ):
        with pytest.raises(SystemExit, match="2"):
            main([*arguments, "--out", out])
        assert words in capsys.readouterr().err


def test_a_case_is_printed_or_written_but_not_over_another(tmp_path, capsys):
    case, out = tmp_path / "case.toml", tmp_path / "out.json"
    case.write_text("rfes = [2, 2]\n")
    assert main(["--load-case", str(case)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert main(["--load-case", str(case), "--out", str(out)]) == 0
    assert str(out) in capsys.readouterr().out
    assert json.loads(out.read_text()) == printed
    out.write_text("mine")
    with pytest.raises(SystemExit, match="2"):
        main(["--load-case", str(case), "--out", str(out)])
    assert "--overwrite" in capsys.readouterr().err
    assert out.read_text() == "mine"
    assert main(["--load-case", str(case), "--out", str(out), "--overwrite"]) == 0
    assert json.loads(out.read_text()) == printed


def test_a_folder_with_something_in_it_is_refused_before_the_checks_run(tmp_path, capsys):
    (tmp_path / "mine").touch()
    with pytest.raises(SystemExit, match="2"):
        main(["--folder", str(tmp_path)])
    assert "--overwrite" in capsys.readouterr().err


def test_full_disk_is_one_line(tmp_path, capsys, monkeypatch):
    def full(path, data):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr("train.verify.__main__.write_json", full)
    case = tmp_path / "case.toml"
    case.write_text("rfes = [2, 2]\n")
    with pytest.raises(SystemExit, match="2"):
        main(["--load-case", str(case), "--out", str(tmp_path / "out.json")])
    assert capsys.readouterr().err.count("\n") == 1


def test_dynamic_case_finds_files_beside_its_own(tmp_path):
    lines = [f"{0.1 * k:.1f},0,0,{0.01 * k},0,0,0" for k in range(12)]
    (tmp_path / "ship.csv").write_text("\n".join(["time_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg", *lines]))
    case, out = tmp_path / "case.toml", tmp_path / "out.json"
    case.write_text('rfes = [2, 2]\nduration = 0.5\n[motion]\nkind = "recorded"\nfile = "ship.csv"\n')
    assert main(["--dynamic", str(case), "--out", str(out)]) == 0
    assert json.loads(out.read_text())["t_s"][-1] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"required_height": -200.0}, "required_height: unknown key; must be one of"),
        ({"crane": {"frame": {"hieght": 9.0}}}, r"\[crane.frame\] unknown key 'hieght'"),
        (
            {"motion": {"kind": "harmonic", "harmonics": [{"coordinate": "heave", "amplitude": 1.0}]}},
            "'period'.*missing",
        ),
        ({"target_level": 20.0}, "target_level.*below the pulley"),
        ({"duration": "long"}, "duration"),
        ({"rfes": [5, 3]}, "even"),
    ],
)
def test_bad_keys_of_a_dynamic_case_are_named(data, words):
    with pytest.raises(InvalidValue, match=words):
        dynamic_case(data)
