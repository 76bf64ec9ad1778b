"""Options of the commands: typed dataclasses, from the command line by tyro, from TOML by ``--config``."""

from __future__ import annotations

import dataclasses
import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import tomli_w
import tyro

from aframe_env.validation import InvalidValue

T = TypeVar("T")


def read_toml(path: Path, kind: type[T]) -> T:
    """Options from a TOML file; keys that the command does not know are refused."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidValue(f"config = {str(path)!r}: cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise InvalidValue(f"{path}: not TOML: {error}") from error
    known = {f.name: f for f in dataclasses.fields(kind)}  # type: ignore[arg-type]
    for key in data:
        if key not in known:
            raise InvalidValue(f"{path}: unknown key {key!r}: must be one of {', '.join(sorted(known))}")
    defaults = dataclasses.asdict(kind())  # type: ignore[call-overload]
    for key, value in data.items():
        expected = type(defaults[key]) if defaults[key] is not None else str
        if expected is float and isinstance(value, int) and not isinstance(value, bool):
            data[key] = float(value)
        elif type(value) is not expected:
            raise InvalidValue(f"{path}: {key} = {value!r}: must be of type {expected.__name__}")
        if known[key].type in ("Path", "Path | None"):
            data[key] = Path(value)
    return kind(**data)


def to_toml(options: Any) -> str:
    """Options as TOML; what is not set is left out."""
    data = {
        key: str(value) if isinstance(value, Path) else value
        for key, value in dataclasses.asdict(options).items()
        if value is not None
    }
    return tomli_w.dumps(data)


def parse(kind: type[T], description: str, args: Sequence[str] | None = None) -> T:
    """Options from the command line; ``--config FILE.toml`` gives the defaults that the rest overrides."""
    args = list(sys.argv[1:] if args is None else args)
    default: T | None = None
    for index, arg in enumerate(args):
        name, _, value = arg.partition("=")
        if name == "--config":
            if not value and index + 1 >= len(args):
                raise InvalidValue("--config needs a file")
            default = read_toml(Path(value or args[index + 1]), kind)
            del args[index : index + (1 if value else 2)]
            break
    epilog = description + "\n\n--config FILE.toml reads the options from a file; the rest overrides it."
    return (
        tyro.cli(kind, args=args, description=epilog, default=default)
        if default
        else tyro.cli(kind, args=args, description=epilog)
    )
