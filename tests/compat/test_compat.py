"""The runner of `make compat` says how far a library came, and the page tells what was run."""

from __future__ import annotations

import re
import sys
from datetime import date
from pathlib import Path

import pytest

from compat.__main__ import (
    BEGIN,
    END,
    HEADINGS,
    PAGE,
    Environment,
    Options,
    Outcome,
    attempt,
    open_environment,
    updated,
)
from compat.catalogue import LIBRARIES, ROOT, STAGES, Library

HERE = Environment(Path(sys.executable), "3.0", {"gymnasium": "1.0", "some-library": "2.0", "aframe-heave": "0.0"})


def tried(tmp_path: Path, code: str, stages: tuple[str, ...] = STAGES, longest: float = 60.0) -> tuple[str, ...]:
    """The table's row for a script of this code."""
    script = tmp_path / "script.py"
    script.write_text(code)
    library = Library(name="some", distribution="some-library", script=script, stages=stages, remark="mind the gap")
    return attempt(library, HERE, tmp_path / "log", longest).row


def test_a_library_that_comes_through(tmp_path: Path) -> None:
    row = tried(tmp_path, "print('made\\nhello\\nstepped\\nsaved')", stages=("made", "stepped", "saved"))
    assert row[:-3] == ("some", "2.0", "3.0", "1.0", "yes", "yes", "", "yes")
    assert row[-1] == "mind the gap"
    assert (tmp_path / "log").read_text() == "made\nhello\nstepped\nsaved\n"


@pytest.mark.parametrize(
    ("code", "failure"),
    [
        ("print('made')\nraise ValueError('no such thing')", "ValueError: no such thing"),
        ("print('made')", "ended before it was done"),
        ("import time\nprint('made')\ntime.sleep(60)", "not done after 5 s"),
    ],
    ids=["raises", "ends early", "hangs"],
)
def test_a_library_that_does_not(tmp_path: Path, code: str, failure: str) -> None:
    *_, made, stepped, trained, saved, _, _, told = tried(tmp_path, code, longest=5.0)
    assert (made, stepped, trained, saved) == ("yes", "**no**", "**no**", "**no**")
    assert told == f"**{failure}**; mind the gap"


def test_a_script_sees_an_empty_folder_as_its_home_and_nothing_of_the_checkout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    code = """
import os, pathlib, sys
assert [path.name for path in pathlib.Path().iterdir()] == ["script.py"]
assert pathlib.Path.home().samefile(".")
assert "PYTHONPATH" not in os.environ
print("made")
"""
    assert tried(tmp_path, code, stages=("made",))[-1] == "mind the gap"
    assert not list(tmp_path.glob("script.p*c"))


def test_an_environment_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"there is no .*/bin/python: `make compat` makes it"):
        open_environment(tmp_path / "learners", tmp_path / "wheel.whl")


def test_words_choose_libraries() -> None:
    assert [each.name for each in Options(only=("sb3", "RLLIB")).libraries] == ["sb3-contrib", "RLlib"]
    with pytest.raises(ValueError, match="only = 'brax': no library has it in its name"):
        Options(only=("brax",))


def test_every_library_is_pinned_and_its_files_are_there() -> None:
    for library in LIBRARIES:
        assert all(path.is_file() for path in (library.script, *library.beside))
        pins = (ROOT / "compat" / f"{library.environment}.txt").read_text(encoding="utf-8").lower().replace("_", "-")
        assert re.search(rf"^{re.escape(library.distribution)}==", pins, flags=re.MULTILINE), library.name
    assert {path.name for path in (ROOT / "compat/scripts").iterdir() if path.suffix == ".py"} == {
        library.script.name for library in LIBRARIES
    }


def test_the_page_has_a_row_for_each_library_in_the_version_that_is_pinned() -> None:
    _, begin, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    text, end, _ = rest.partition(END)
    assert begin
    assert end
    heading, _, *rows = (
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")
    )
    assert tuple(heading) == HEADINGS
    for library, row in zip(LIBRARIES, rows, strict=True):
        pins = (ROOT / "compat" / f"{library.environment}.txt").read_text(encoding="utf-8").lower().replace("_", "-")
        assert row[0] == library.name
        assert f"\n{library.distribution}=={row[1]}\n" in pins
        assert row[4:8] == ["yes" if stage in library.stages else "" for stage in STAGES]
        assert row[-1] == library.remark


def test_a_library_s_row_takes_the_place_of_its_old_one(tmp_path: Path) -> None:
    library = next(each for each in LIBRARIES if each.name == "skrl")
    environment = Environment(HERE.interpreter, "3.11", {"gymnasium": "1.4", "skrl": "9.9"})
    outcome = Outcome(library, environment, STAGES, 12.3, date(2030, 1, 2))
    page = PAGE.read_text(encoding="utf-8")
    found = updated(page, [outcome])
    assert [line for line in found.splitlines() if line not in page.splitlines()] == [
        f"| skrl | 9.9 | 3.11 | 1.4 | yes | yes | yes | yes | 12 | 2030-01-02 | {library.remark} |"
    ]
    assert len(found.splitlines()) == len(page.splitlines())
    assert updated(found, []) == found
