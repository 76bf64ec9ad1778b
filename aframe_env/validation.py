"""Checks of user input: one clear error that names the value, the allowed range and the unit."""

from __future__ import annotations

import math
from collections.abc import Iterable
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt


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
) -> None:
    """Raise unless ``value`` is a finite real number in [low, high] (or (low, high])."""
    if type(value) is float and low < value < high:
        return
    allowed = f"{_interval(low, high, low_open)} {unit}".rstrip()
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InvalidValue(f"{name} = {value!r}: must be a number in {allowed}")
    number = float(value)
    below = number <= low if low_open else number < low
    if not math.isfinite(number) or below or number > high:
        raise InvalidValue(f"{name} = {value!r} {unit}".rstrip() + f": must be in {allowed}")


def require_integer(name: str, value: Any, *, low: int, high: int) -> None:
    """Raise unless ``value`` is an integer in [low, high]."""
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise InvalidValue(f"{name} = {value!r}: must be an integer in [{low}, {high}]")
    if not low <= int(value) <= high:
        raise InvalidValue(f"{name} = {value!r}: must be in [{low}, {high}]")


def require_vector(name: str, value: Any, unit: str, size: int = 3) -> None:
    """Raise unless ``value`` is a sequence of ``size`` finite numbers."""
    if not hasattr(value, "__len__") or len(value) != size:
        raise InvalidValue(f"{name} = {value!r}: must be {size} numbers in {unit}")
    for index, item in enumerate(value):
        require_number(f"{name}[{index}]", item, unit)


def require_numbers(name: str, value: Any, unit: str) -> npt.NDArray[np.float64]:
    """Return an array of any shape as float64. Raises where it holds what is no number."""
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidValue(f"{name} = {value!r}: must be an array of numbers, {unit}") from None


def require_known(arguments: Iterable[str], known: Iterable[str]) -> None:
    """Raise ``UnexpectedArgument`` unless every one of ``arguments`` is one of ``known``."""
    names = sorted(known)
    for name in arguments:
        if name not in names:
            raise UnexpectedArgument(f"unexpected keyword argument {name!r}: must be one of {', '.join(names)}")


def require_choice(name: str, value: Any, choices: tuple[str, ...]) -> None:
    """Raise unless ``value`` is one of ``choices``."""
    if value not in choices:
        raise InvalidValue(f"{name} = {value!r}: must be one of {', '.join(map(repr, choices))}")
