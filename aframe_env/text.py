"""Text files of users and colleagues: one reader each for plain text, TOML, JSON and CSV, with one clear error.

Every reader takes UTF-8 with or without a byte order mark and any ending of lines. ``name`` is what the user calls the
file, as in "scenario". Whatever the file holds, only ``InvalidValue`` comes out, which names the file and, where there
is one, the line.
"""

from __future__ import annotations

import csv
import io
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, Final

from aframe_env.validation import InvalidValue

DATA_LIMIT: Final = 4 * 2**20
"""Largest TOML or JSON file, bytes."""
TABLE_LIMIT: Final = 128 * 2**20
"""Largest CSV file, bytes: a motion at 10 Hz over some two days."""
DEPTH: Final = 32
"""Most levels of tables and lists within each other."""
_LONG_KEY: Final = re.compile(rf"(?<![\w.-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{DEPTH}}}")
"""A dotted key of too many parts, over which tomllib would take quadratic time."""


def read_text(path: Path, name: str, limit: int = DATA_LIMIT) -> str:
    """Read a text file of at most ``limit`` bytes."""
    try:
        with path.open("rb") as file:
            data = file.read(limit + 1)
    except (OSError, ValueError) as error:  # ValueError: a path with a null character
        reason = getattr(error, "strerror", None) or error
        raise InvalidValue(f"{name} = {str(path)!r}: cannot be read: {reason}") from error
    if len(data) > limit:
        raise InvalidValue(f"{name} = {str(path)!r}: larger than {limit / 2**20:g} MiB: must be a smaller text file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InvalidValue(f"{path}, line {line}: must be text in UTF-8: {error.reason}") from error


def read_toml(path: Path, name: str) -> dict[str, Any]:
    """Read a TOML file."""
    data: dict[str, Any] = _parsed(_toml, path, name, "TOML")
    return data


def read_json(path: Path, name: str) -> Any:
    """Read a JSON file; NaN and Infinity, which are no JSON, are refused."""
    return _parsed(_json, path, name, "JSON")


def read_csv(path: Path, name: str) -> Iterator[tuple[int, list[str]]]:
    """Number and cells, quoted or not, of each line of a CSV file that has something in it.

    A comment, which ``#`` begins, is a single cell, without the quotes and empty cells that spreadsheets give it.
    """
    for number, line in enumerate(io.StringIO(read_text(path, name, TABLE_LIMIT), newline=None), start=1):
        text = line.strip()
        comment = text.lstrip('"').startswith("#")
        try:
            row = next(csv.reader([text], skipinitialspace=True, strict=not comment), [])
        except csv.Error as error:
            raise InvalidValue(f"{path}, line {number}: not CSV: {error}") from error
        cells = [cell.strip() for cell in row]
        if any(cells):
            yield number, [", ".join(cells).rstrip(", ")] if comment else cells


def _toml(text: str) -> Any:
    if _LONG_KEY.search(text):
        raise RecursionError
    return tomllib.loads(text)


def _json(text: str) -> Any:
    return json.loads(text, parse_constant=_refuse_constant)


def _refuse_constant(constant: str) -> None:
    raise ValueError(f"{constant} is no number of JSON")


def _parsed(parse: Callable[[str], Any], path: Path, name: str, kind: str) -> Any:
    text = read_text(path, name)
    try:
        data = parse(text)
        _require_shallow(data)
    except RecursionError:
        raise InvalidValue(f"{path}: nested too deeply: must be {kind} of at most {DEPTH} levels") from None
    except json.JSONDecodeError as error:
        raise InvalidValue(f"{path}, line {error.lineno}: not {kind}: {error.msg}") from error
    except ValueError as error:  # tomllib names the line itself; of an integer of too many digits nobody does
        raise InvalidValue(f"{path}: not {kind}: {error}") from error
    return data


def _require_shallow(data: Any) -> None:
    """Raise ``RecursionError`` where more than ``DEPTH`` tables and lists lie within each other."""
    level = _nested([data])
    for _ in range(DEPTH):
        level = _nested(item for each in level for item in (each.values() if isinstance(each, dict) else each))
    if level:
        raise RecursionError


def _nested(items: Iterable[Any]) -> list[dict[str, Any] | list[Any]]:
    return [item for item in items if isinstance(item, dict | list)]
