"""Checks of user input: one clear error that names the value, the allowed range and the unit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

_INTEGERS: Final = (int, np.integer)
_NUMBERS: Final = (float, np.float32, *_INTEGERS)
"""What arithmetic with floats takes without loss: a half-precision 60000 times 9.81 is infinite."""
_SHOWN: Final = 160
"""Most characters of a value in a message."""


class SmallRotationWarning(UserWarning):
    """An rfe of the full model has turned by more than the linear kinematics of eq. (10) can take."""


class ResponseTableWarning(UserWarning):
    """A vessel's table was written in other units or with other signs, going by its longest wave."""


class SeaBeyondTableWarning(UserWarning):
    """A notable part of a sea has frequencies for which the vessel's table says nothing."""


class RecordNoiseWarning(UserWarning):
    """The rounding or noise of a recorded motion is a notable part of its acceleration."""


class InvalidValue(ValueError):
    """A value outside what the model can take. The message names it, its range and its unit."""


class UnexpectedArgument(InvalidValue, TypeError):
    """A keyword argument that there is not; a ``TypeError`` as Python's own is, which libraries go by."""


def shown(value: object) -> str:
    """Return a value as a message shows it: on one line, cut where it is long."""
    try:
        text = " ".join(repr(value).split())
    except (ValueError, RecursionError):  # Python prints no integer of more than 4300 digits
        return f"a {type(value).__name__} too long to print"
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 20]}...{text[-10:]}"


def _is_one_of(kinds: tuple[type, ...], value: object) -> bool:
    # Python counts True among the integers, NumPy spans of time.
    return isinstance(value, kinds) and not isinstance(value, bool | np.timedelta64)


def _interval(low: float, high: float, low_open: bool) -> str:
    left = "(" if low_open or math.isinf(low) else "["
    right = ")" if math.isinf(high) else "]"
    return f"{left}{low:g}, {high:g}{right}"


def require_number(
    name: str,
    value: Any,
    unit: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    low_open: bool = False,
    or_zero: bool = False,
) -> None:
    """Raise unless ``value`` is a finite real number in [low, high] (or (low, high]), or 0 where ``or_zero``."""
    if type(value) is float and low < value < high:
        return
    allowed, must_be = f"{_interval(low, high, low_open)} {unit}".rstrip(), "must be 0, or" if or_zero else "must be"
    if not _is_one_of(_NUMBERS, value):
        raise InvalidValue(f"{name} = {shown(value)}: {must_be} a number in {allowed}")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if or_zero and number == 0.0:
        return
    below = number <= low if low_open else number < low
    if not math.isfinite(number) or below or number > high:
        raise InvalidValue(f"{name} = {shown(value)} {unit}".rstrip() + f": {must_be} in {allowed}")


def require_integer(name: str, value: Any, *, low: int, high: int) -> None:
    """Raise unless ``value`` is an integer in [low, high]."""
    if not _is_one_of(_INTEGERS, value):
        raise InvalidValue(f"{name} = {shown(value)}: must be an integer in [{low}, {high}]")
    if not low <= int(value) <= high:
        raise InvalidValue(f"{name} = {shown(value)}: must be in [{low}, {high}]")


def require_instance(name: str, value: Any, kind: type) -> None:
    """Raise unless ``value`` is a ``kind``."""
    if not isinstance(value, kind):
        raise InvalidValue(f"{name} = {shown(value)}: must be a {kind.__name__}")


def require_vector(
    name: str, value: Any, unit: str, size: int = 3, *, low: float = -math.inf, high: float = math.inf
) -> None:
    """Raise unless ``value`` is a sequence of ``size`` finite numbers in [low, high]."""
    listed = isinstance(value, Sequence) or (isinstance(value, np.ndarray) and value.ndim == 1)
    if not listed or len(value) != size:
        raise InvalidValue(f"{name} = {shown(value)}: must be {size} numbers in {unit}")
    for index, item in enumerate(value):
        require_number(f"{name}[{index}]", item, unit, low=low, high=high)


def require_numbers(name: str, value: Any, unit: str) -> npt.NDArray[np.float64]:
    """Return an array of any shape as float64. Raises where it holds what is no number."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        array = np.array(None)
    if array.dtype.kind not in "iuf":
        raise InvalidValue(f"{name} = {shown(value)}: must be an array of numbers, {unit}")
    return array.astype(np.float64, copy=False)


def require_known(arguments: Iterable[str], known: Iterable[str]) -> None:
    """Raise ``UnexpectedArgument`` unless every one of ``arguments`` is one of ``known``."""
    names = sorted(known)
    for name in arguments:
        if name not in names:
            raise UnexpectedArgument(f"unexpected keyword argument {name!r}: must be one of {', '.join(names)}")


def require_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    """Raise unless ``value`` is one of ``choices``."""
    if not isinstance(value, str) or value not in choices:
        raise InvalidValue(f"{name} = {shown(value)}: must be one of {', '.join(map(repr, choices))}")
