"""The command that draws the environment."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from rich.console import Console

from aframe_env import InvalidValue
from train.render import Options, picture, run


def test_writes_the_picture(tmp_path: Path) -> None:
    options = Options(out=tmp_path / "new" / "picture.png", time=4.0, scenario_seed=2)
    assert run(options, Console(quiet=True)) == 0
    written = np.rint(imread(options.out)[:, :, :3] * 255.0).astype(np.uint8)
    np.testing.assert_array_equal(written, picture(options))
    assert [path.name for path in options.out.parent.iterdir()] == ["picture.png"]


def test_refuses_to_overwrite_unasked(tmp_path: Path) -> None:
    mine = tmp_path / "mine.png"
    mine.write_text("mine")
    with pytest.raises(InvalidValue, match="exists; choose another, or pass --overwrite"):
        run(Options(out=mine), Console(quiet=True))
    assert mine.read_text() == "mine"


def test_writes_into_runs_by_default(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(Options(time=1.0), Console(quiet=True)) == 0
    assert [path.parent.name for path in tmp_path.rglob("*.png")] == ["runs"]


def test_refuses_a_time_before_the_start() -> None:
    with pytest.raises(InvalidValue, match="time"):
        Options(time=-1.0)
