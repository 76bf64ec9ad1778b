"""Pages of the tutorials, made of their scripts: ``python docs/site/tutorials.py`` runs them and writes the pages.

A script in ``examples/tutorials`` has cells, as notebooks have: text behind ``# %% [markdown]``, code behind ``# %%``.
Its page in ``docs/tutorials`` has the text, the code, what the code printed, and the pictures that the text shows.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).parents[2]
SCRIPTS: Final = tuple(sorted((ROOT / "examples/tutorials").glob("*.py")))
TOLERANCE: Final = 2
"""Units in its last printed digit by which a number may differ from the page's."""

_CELL: Final = re.compile(r"^# %%(.*)\n", re.MULTILINE)
_PRINTED: Final = re.compile(r"^```text\n.*?^```\n\n?", re.MULTILINE | re.DOTALL)
_PICTURE: Final = re.compile(r"!\[[^]]*\]\(([^)/]+)\)")
_NUMBER: Final = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?")


def page_of(script: Path) -> Path:
    """Where the page of a script is."""
    return ROOT / "docs/tutorials" / f"{script.stem.replace('_', '-')}.md"


def run(script: Path, folder: Path) -> str:
    """Run a script in a folder, cell by cell; return its page."""
    variables: dict[str, Any] = {"__name__": "__main__", "__file__": str(script)}
    with contextlib.chdir(folder):
        return _page(script, lambda code: _printed(code, script, variables))


def unprinted(script: Path) -> str:
    """The page of a script without what it prints, for which nothing is run."""
    return _page(script, lambda code: "")


def without_prints(page: str) -> str:
    """A page without what its script printed."""
    return _PRINTED.sub("", page)


def _page(script: Path, printed_by: Callable[[str], str]) -> str:
    source = script.read_text(encoding="utf-8")
    name = script.relative_to(ROOT).as_posix()
    parts = []
    for cell, following in pairwise([*_CELL.finditer(source), None]):
        assert cell is not None
        body = source[cell.end() : following.start() if following else len(source)].strip("\n")
        if "[markdown]" in cell[1]:
            parts.append(re.sub(r"^# ?", "", body, flags=re.MULTILINE))
            continue
        # Behind empty lines, so that an error names the script's own line.
        printed = printed_by("\n" * source.count("\n", 0, cell.end()) + body)
        parts.append(f"```python\n{body}\n```")
        if printed:
            parts.append(f"```text\n{printed}\n```")
    title, *rest = parts
    made = (
        f"[`{name}`](../../{name}) as a page: its text, its code, and what it printed. `make test-all` runs it and "
        f"compares the numbers, to {TOLERANCE} units in the last digit."
    )
    heading, _, introduction = title.partition("\n")
    return "\n\n".join(part.strip("\n") for part in (heading, introduction, made, *rest)) + "\n"


def _printed(code: str, script: Path, variables: dict[str, Any]) -> str:
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(code, script, "exec"), variables)
    return "\n".join(line.rstrip() for line in output.getvalue().strip("\n").splitlines())


def differences(page: str, other: str) -> list[tuple[str, str]]:
    """Lines that differ, in more than a few units of a number's last digit or the width of a column."""
    lines, others = page.splitlines(), other.splitlines()
    if len(lines) != len(others):
        return [(f"{len(lines)} lines", f"{len(others)} lines")]
    return [(a, b) for a, b in zip(lines, others, strict=True) if not _alike(a, b)]


def _alike(line: str, other: str) -> bool:
    if line == other:
        return True
    if _words(line) != _words(other):
        return False
    numbers = zip(_NUMBER.findall(line), _NUMBER.findall(other), strict=True)
    return all(_digits(a) == _digits(b) and _near(a, b) for a, b in numbers)


def _words(line: str) -> list[str]:
    return _NUMBER.sub("#", line).split()


def _digits(number: str) -> int:
    return len(number.partition(".")[2])


def _near(number: str, other: str) -> bool:
    difference = abs(float(number.replace(",", "")) - float(other.replace(",", "")))
    return difference <= (TOLERANCE + 1e-6) * 10.0 ** -_digits(number)


def main() -> int:
    """Run the scripts, or those named, and write their pages."""
    chosen = [Path(name).resolve() for name in sys.argv[1:]] or SCRIPTS
    sys.path.insert(0, os.getcwd())
    for script in chosen:
        page_of(script).parent.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            page = run(script, Path(folder))
            for picture in _PICTURE.findall(page):
                shutil.copy(Path(folder) / picture, page_of(script).parent)
        page_of(script).write_text(page, encoding="utf-8")
        print(page_of(script).relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
