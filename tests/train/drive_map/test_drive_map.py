import hashlib
import json
import sqlite3

import numpy as np
import pytest

from agents.drives import map as stored
from agents.drives.map import ideal_ratio
from train.drive_map import __main__ as drive_map

GRID = {"--amplitudes": (0.5, 3.0), "--periods": (6.0, 9.0, 14.0), "--masses": (2e4, 9e4), "--lengths": (60.0, 900.0)}


class Killed(BaseException):
    """What a process that is killed never sees."""


def killed(*arguments):
    raise Killed


def arguments(folder):
    axes = [str(item) for name, values in GRID.items() for item in (name, *values)]
    few = ["--held-out", "3", "--scenarios", "2", "--workers", "1"]
    return [*axes, *few, "--store", str(folder / "nodes.sqlite"), "--out", str(folder / "out")]


@pytest.mark.slow
def test_a_build_that_is_killed_goes_on_where_it_was(tmp_path, monkeypatch, capsys, kill_module, jobs_in):
    kept = kill_module(tmp_path / "nodes.sqlite", 2, "train.drive_map", *arguments(tmp_path))
    assert 2 <= kept < 24
    # A mark on what was finished shows that it is taken as it is.
    with sqlite3.connect(tmp_path / "nodes.sqlite") as database:
        for key, text in database.execute("SELECT key, result FROM results").fetchall():
            marked = json.dumps({**json.loads(text), "remaining": 0.125})
            digest = hashlib.sha256(f"{key} {marked}".encode()).hexdigest()
            database.execute("UPDATE results SET result = ?, digest = ? WHERE key = ?", (marked, digest, key))
    monkeypatch.setattr("sys.argv", ["train.drive_map", *arguments(tmp_path)])
    with monkeypatch.context() as patched:
        patched.setattr(drive_map, "draw", killed)
        with pytest.raises(Killed):
            drive_map.main()
    assert drive_map.main() == 0
    found = stored.load(tmp_path / "out")
    assert found.shape == (2, 3, 2, 2)
    assert int((found.remaining == 0.125).sum()) == kept
    assert jobs_in(tmp_path / "nodes.sqlite") == 24
    _the_map_is_right(found)
    notes = (tmp_path / "out" / "notes.md").read_text(encoding="utf-8")
    assert "All came from the store." in notes
    for name in ("drive map in real time", "drive map by the clock", "drive map, every wave known"):
        assert notes.count(f"\n| {name} |") == 3
    held_out = json.loads((tmp_path / "out" / "held_out.json").read_text())
    assert len(held_out) == 3
    assert all(each["remaining"] < 1e-3 for each in held_out)
    assert (tmp_path / "out" / "drive_map.png").read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "out" / "jobs.sqlite").exists()
    with pytest.raises(SystemExit):
        drive_map.main()
    assert "this run is finished; pass --overwrite to do it again" in capsys.readouterr().err


def _the_map_is_right(found):
    nodes = drive_map.Options(**{k[2:]: v for k, v in GRID.items()}).nodes
    want = [ideal_ratio(node.scenario) for node in nodes]
    np.testing.assert_allclose(found.ratio.ravel(), want, atol=1e-3)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--periods", "9.0"), "periods = (9.0,): must be at least 2 rising values"),
        (("--masses", "2e4", "1e4"), "must be at least 2 rising values"),
        (("--lengths", "-5.0", "10.0"), "lengths = -5.0 m: must be in [10, 10000] m"),
        (("--held-out", "0"), "held_out = 0"),
    ],
)
def test_bad_options_are_one_clear_line(options, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["train.drive_map", *options])
    with pytest.raises(SystemExit) as stopped:
        drive_map.main()
    assert stopped.value.code == 2
    # Refused by the options themselves, the line stands wrapped in a box.
    assert words in " ".join(capsys.readouterr().err.replace("│", " ").replace("|", " ").split())
    assert not list(tmp_path.iterdir())
