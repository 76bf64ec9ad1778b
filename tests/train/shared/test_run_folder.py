import json

import pytest

from aframe_env import InvalidValue
from train.shared.run_folder import (
    RunOptions,
    new_file,
    new_folder,
    open_run,
    user_errors,
    write_atomically,
    write_json,
    write_text,
)


def test_a_write_that_fails_keeps_the_old_file_and_leaves_nothing_else(tmp_path):
    path = tmp_path / "result.json"
    write_text(path, "old")

    def full_disk(temporary):
        temporary.write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match=r"No space left on device: '.*/result\.json'$"):
        write_atomically(path, full_disk)
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]
    assert path.read_text() == "old"


def test_an_interrupted_write_keeps_the_old_file(tmp_path):
    path = tmp_path / "result.json"
    write_text(path, "old")

    def interrupted(temporary):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, interrupted)
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]


def test_nan_is_no_json(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "x.json", {"a": float("nan")})
    assert not list(tmp_path.iterdir())
    write_json(tmp_path / "x.json", {"Ω": 1.0})
    assert json.loads((tmp_path / "x.json").read_text(encoding="utf-8")) == {"Ω": 1.0}


def test_folders(tmp_path):
    folder = new_folder(tmp_path / "a" / "b")
    assert new_folder(folder) == folder  # empty: nothing can be lost
    (folder / "x").write_text("mine")
    with pytest.raises(InvalidValue, match="exists and is not empty"):
        new_folder(folder)
    assert new_folder(folder, overwrite=True) == folder
    with pytest.raises(InvalidValue, match="is a file"):
        new_folder(folder / "x")


def test_a_run_that_was_killed_before_it_was_recorded_begins_anew(tmp_path):
    options = RunOptions(out=tmp_path / "run")
    options.out.mkdir()
    (options.out / "run.json").write_text("{}")
    (options.out / ".run.1abc.json").write_text("{")
    assert not open_run(options, "train.drives", goes_on=True).taken_up
    (options.out / "mine").write_text("mine")
    with pytest.raises(InvalidValue, match="exists and is not empty"):
        open_run(options, "train.drives", goes_on=True)


def test_a_run_that_goes_on_sweeps_up_what_a_kill_left_half_written(tmp_path):
    options = RunOptions(out=tmp_path / "run")
    open_run(options, "train.drives", goes_on=True).record(options)
    (tmp_path / "run" / "swell").mkdir()
    for name in (".summary.k3_x9q1z.json", "swell/.summary.k3_x9q1z.json", "mine.json", ".hidden", "swell/mine.json"):
        (tmp_path / "run" / name).write_text("{")
    assert open_run(options, "train.drives", goes_on=True).taken_up
    left = {path.relative_to(tmp_path / "run").as_posix() for path in (tmp_path / "run").rglob("*")}
    assert left == {"config.toml", "run.json", "mine.json", ".hidden", "swell", "swell/mine.json"}


def test_files(tmp_path):
    path = tmp_path / "x.json"
    assert new_file(path) == path
    path.write_text("mine")
    with pytest.raises(InvalidValue, match="exists; choose another, or pass --overwrite"):
        new_file(path)
    assert new_file(path, overwrite=True) == path
    with pytest.raises(InvalidValue, match="is a folder"):
        new_file(tmp_path, overwrite=True)


@pytest.mark.parametrize("error", [InvalidValue("mass = -1 kg"), OSError(28, "No space left on device")])
def test_users_see_one_line(error, capsys):
    with pytest.raises(SystemExit) as stopped, user_errors():
        raise error
    assert stopped.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_an_interrupt_is_told_in_a_word(capsys):
    with pytest.raises(SystemExit) as stopped, user_errors():
        raise KeyboardInterrupt
    assert stopped.value.code == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_mistakes_of_the_program_are_not_hidden():
    with pytest.raises(KeyError), user_errors():
        raise KeyError("bug")
