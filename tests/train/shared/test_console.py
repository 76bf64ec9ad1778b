"""Consoles that lack characters, or a reader: no command loses its run to one."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from train.drives import __main__ as drives
from train.evaluate import __main__ as evaluate
from train.shared.console import PlainConsole

ROOT = Path(__file__).parents[3]
FOLDER = "of [/b] and :sea:"
COMPARE = ["--policies", "law_of_Ω:Ω", "--scenarios", "1", "--episode-duration", "2", "--no-report", "--out", FOLDER]
LAW = "def Ω(observation):\n    return 0.0 * observation[:, 0]\n"
ALONE = """
import sys
from pathlib import Path
from train.shared.console import PlainConsole
console = PlainConsole()
for _ in range(3):
    console.print("nobody reads this")
Path("reached").touch()
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "law_of_Ω.py").write_text(LAW, encoding="utf-8")
    return tmp_path


def assert_compared(folder: Path, said: bytes) -> None:
    rows = json.loads((folder / FOLDER / "comparison.json").read_text(encoding="utf-8"))["policies"]
    assert [row["policy"] for row in rows] == ["drum still", "law_of_Ω:Ω"]
    assert (folder / FOLDER / "comparison.png").is_file()
    assert b"law_of_?:?" in said
    assert FOLDER.encode() in said


def console(encoding: str, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> io.BytesIO:
    monkeypatch.setattr("sys.argv", ["command", *arguments])
    raw = io.BytesIO()
    monkeypatch.setattr("sys.stdout", io.TextIOWrapper(raw, encoding=encoding, write_through=True))
    return raw


def test_a_comparison_is_written_and_said_on_a_console_of_windows(folder: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "train.evaluate", *COMPARE],
        env=os.environ | {"PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "cp1252"},
        cwd=folder,
        capture_output=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr.decode()
    assert_compared(folder, ended.stdout)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp437"])
def test_a_comparison_is_written_and_said_whatever_the_console_can_print(
    encoding: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    raw = console(encoding, monkeypatch, *COMPARE)
    assert evaluate.main() == 0
    assert_compared(folder, raw.getvalue().replace("Ω".encode(encoding, "replace"), b"?"))


def test_help_can_be_read_on_any_console(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = console("ascii", monkeypatch, "--help")
    with pytest.raises(SystemExit, match="0"):
        drives.main()
    assert b"?" in raw.getvalue()
    assert b"--scenario" in raw.getvalue()


@pytest.mark.skipif(sys.platform == "win32", reason="needs pipes of POSIX")
def test_a_command_goes_on_when_nobody_reads_what_it_says(tmp_path: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    try:
        ended = subprocess.run(
            [sys.executable, "-c", ALONE],
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            cwd=tmp_path,
            stdout=write,
            stderr=subprocess.PIPE,
            check=False,
        )
    finally:
        os.close(write)
    assert ended.returncode == 0, ended.stderr.decode()
    assert (tmp_path / "reached").exists()


def test_an_argument_that_is_no_text_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", ["command", "--out", os.fsdecode(b"\xff")])
    with pytest.raises(SystemExit, match="2"):
        evaluate.main()
    assert "must be text in UTF-8" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_a_sentence_in_a_file_is_one_line_however_long(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = console("utf-8", monkeypatch)
    sentence = f"agent: {'/long/folder' * 20} with words " + "after it " * 20 + "ends"
    PlainConsole().print(sentence, "and a second one", sep="\n")
    assert raw.getvalue().decode() == f"{sentence}\nand a second one\n"
