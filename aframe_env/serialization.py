"""Plain data (of TOML, JSON) and dataclasses: each made of the other, checked for types and keys; one clear error."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from cattrs import Converter, transform_error
from cattrs.errors import BaseValidationError, ForbiddenExtraKeysError

from aframe_env.validation import InvalidValue, shown

T = TypeVar("T")


def strict_converter() -> Converter:
    """A converter that refuses unknown keys and turns no type into another, but an integer into a float."""
    converter = Converter(forbid_extra_keys=True)

    def number(value: Any, _: type) -> float:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InvalidValue(f"{shown(value)}: must be a number")
        try:
            return float(value)
        except OverflowError:
            raise InvalidValue(f"{shown(value)}: must be a number within ±{sys.float_info.max:.2g}") from None

    def exactly(value: Any, kind: type) -> Any:
        if type(value) is not kind:
            raise InvalidValue(f"{shown(value)}: must be of type {kind.__name__}")
        return value

    def number_or_pair(value: Any, _: Any) -> float | tuple[float, float]:
        if isinstance(value, list | tuple):
            return converter.structure(value, tuple[float, float])
        return converter.structure(value, float)

    converter.register_structure_hook(float, number)
    converter.register_structure_hook_func(lambda kind: kind == float | tuple[float, float], number_or_pair)
    for kind in (int, bool, str):
        converter.register_structure_hook(kind, exactly)
    return converter


def structure(converter: Converter, data: Any, kind: type[T], source: str) -> T:
    """Make a ``kind`` of plain data. Raises ``InvalidValue`` that begins with ``source`` and names the key."""
    try:
        return converter.structure(data, kind)
    except (BaseValidationError, InvalidValue) as error:
        raise InvalidValue(f"{source}: {_first(error)}") from error


def plain(value: Any) -> Any:
    """Turn mappings, sequences, paths and numbers of NumPy into what JSON and TOML have.

    What is None is left out, as TOML has no null: it reads back as the default.
    """
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return str(value)
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


def _first(error: BaseException) -> str:
    """The first message of a tree of errors, with the key that it belongs to."""
    if not isinstance(error, BaseValidationError):
        return str(error)
    message, _, place = transform_error(error, "", _message)[0].rpartition(" @ ")
    key = place.removeprefix("$").strip(".")
    return f"[{key}] {message}" if key else message


def _message(error: BaseException, kind: type | None) -> str:
    if isinstance(error, AttributeError) or (isinstance(error, TypeError) and kind is not None):
        return "must be a table"
    counted = re.fullmatch(r"(?:Not enough|Too many) values in .* to structure as tuple\[(.*)\]", str(error))
    if counted:
        return f"must be {counted[1].count(',') + 1} numbers"
    if isinstance(error, ForbiddenExtraKeysError):
        known = ", ".join(sorted(name for name in getattr(error.cl, "__dataclass_fields__", {})))
        return f"unknown key {sorted(error.extra_fields)[0]!r}: must be one of {known}"
    if isinstance(error, KeyError):
        return f"key {error.args[0]!r} is missing"
    return str(error)
