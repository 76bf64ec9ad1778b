"""Options of the commands: typed dataclasses, from the command line by tyro, from TOML by ``--config``."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

import tomli_w
import tyro
from cattrs import Converter

from aframe_env.serialization import plain, strict_converter, structure
from aframe_env.text import read_toml
from aframe_env.validation import InvalidValue

T = TypeVar("T")


def read_options(path: Path, kind: type[T]) -> T:
    """Read options from a TOML file; keys that the command does not know are refused."""
    return structure(_converter(), read_toml(path, "config"), kind, str(path))


def to_mapping(options: Any) -> dict[str, Any]:
    """Options by name, as plain values; what is not set is left out."""
    mapping: dict[str, Any] = plain(_converter().unstructure(options))
    return mapping


def to_toml(options: Any) -> str:
    """Options as TOML; what is not set is left out."""
    return tomli_w.dumps(to_mapping(options))


def _converter() -> Converter:
    converter = strict_converter()
    converter.register_structure_hook(Path, lambda value, _: Path(converter.structure(value, str)))
    converter.register_structure_hook(
        int | Path, lambda value, _: Path(value) if isinstance(value, str) else converter.structure(value, int)
    )
    converter.register_unstructure_hook(Path, str)
    return converter


def _require_text(arg: str) -> None:
    """Raise where the bytes of an argument are no text: a run could not say how it was made."""
    try:
        arg.encode()
    except UnicodeEncodeError as error:
        raise InvalidValue(f"argument {arg!r}: must be text in UTF-8") from error


def program(command: str) -> str:
    """How the running command was called: "aframe drives", or "python -m train.drives" for "train.drives"."""
    return sys.argv[0] if sys.argv[0].startswith("aframe ") else f"python -m {command}"


def parse(kind: type[T], command: str, description: str, args: Sequence[str] | None = None) -> T:
    """Options from the command line; ``--config FILE.toml`` gives the defaults that the rest overrides.

    ``command`` is the command's name, as in "train.drives".
    """
    args = list(sys.argv[1:] if args is None else args)
    for arg in args:
        _require_text(arg)
    default: T | None = None
    for index, arg in enumerate(args):
        name, _, value = arg.partition("=")
        if name == "--config":
            if not value and index + 1 >= len(args):
                raise InvalidValue("--config needs a file")
            default = read_options(Path(value or args[index + 1]), kind)
            del args[index : index + (1 if value else 2)]
            break
    epilog = description + "\n\n--config FILE.toml reads the options from a file; the rest overrides it."
    prog = program(command)
    return (
        tyro.cli(kind, prog=prog, args=args, description=epilog, default=default)
        if default
        else tyro.cli(kind, prog=prog, args=args, description=epilog)
    )
