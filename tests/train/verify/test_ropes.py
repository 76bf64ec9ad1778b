"""Heavy ropes and loads in water: every check holds, and a case from a file is the reference's."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from aframe_env.validation import InvalidValue
from train.verify.__main__ import WATER_CHECKS, main
from train.verify.rope_cases import COLUMNS, rope_case

LONG = ("snap", "resonance")
REFERENCE = files("aframe_env") / "data" / "reference" / "water"


@pytest.mark.parametrize(
    "check",
    [pytest.param(check, marks=pytest.mark.slow if check.__name__ in LONG else ()) for check in WATER_CHECKS],
    ids=lambda check: check.__name__,
)
def test_every_check_holds(check) -> None:  # type: ignore[no-untyped-def]
    found = check()
    for one in found if isinstance(found, list) else [found]:
        assert one.passed, f"{one.name}: {one.measured}, bar {one.bar}"


def test_a_case_of_the_reference_as_a_file(tmp_path: Path) -> None:
    """Every key of cases.json is taken, those that follow from the rest included."""
    written = json.loads((REFERENCE / "cases.json").read_text(encoding="utf-8"))
    data = {**written["cases"]["e2"], "common": written["common"], "duration_s": 40.0}
    (tmp_path / "case.toml").write_text(tomli_w.dumps(data), encoding="utf-8")
    assert main(["--rope-case", str(tmp_path / "case.toml"), "--out", str(tmp_path / "run.json")]) == 0
    found = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert tuple(found) == COLUMNS
    lines = (REFERENCE / "case_e2.csv").read_text(encoding="utf-8").splitlines()
    there = np.array([[float(item) for item in line.split(",")] for line in lines[1:82]])
    here = np.array([found[column] for column in COLUMNS]).T[::10]
    assert here.shape == there.shape
    assert here[:, :4] == pytest.approx(there[:, :4], abs=3e-4)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"load": {}}, r"rope.toml: \[load.m_kg\] key 'm_kg' is missing"),
        ({"load": {"m_kg": 1e4, "volume": 2.0}}, r"rope.toml: \[load\] unknown key 'volume'"),
        ({"duration_s": 0.0}, r"duration_s = 0.0 s: must be in \[0.05, 100000\] s"),
        ({"common": {"z_S0_m": 12.0}}, r"z_S0_m = 12.0 m, the reference crane's: must be in"),
        ({"heave": {"harmonics_T_a_phase": [[8.0, 1.0]]}}, "must be 3 numbers"),
    ],
)
def test_bad_input_is_named(changes: dict[str, object], words: str) -> None:
    data = {"L0_unstretched_below_S_m": 500.0, "load": {"m_kg": 1e4}, "duration_s": 10.0} | changes
    with pytest.raises(InvalidValue, match=words):
        rope_case(data, "rope.toml")
