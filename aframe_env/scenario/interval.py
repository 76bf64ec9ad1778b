"""Intervals that numbers are drawn from."""

from __future__ import annotations

from typing import Any

from aframe_env.validation import InvalidValue, require_number, shown

Range = float | tuple[float, float]
"""One exact value, or the interval that a value is drawn from uniformly."""


def require_range(name: str, value: Any, unit: str, low: float, high: float, low_open: bool = False) -> None:
    """Raise where a value is no number in the range, nor an interval of such."""
    if isinstance(value, tuple):
        if len(value) != 2:
            raise InvalidValue(f"{name} = {shown(value)}: must be a number or a tuple (low, high) in {unit}")
        for part, item in zip(("low", "high"), value, strict=True):
            require_number(f"{name} ({part})", item, unit, low=low, high=high, low_open=low_open)
        if value[0] > value[1]:
            raise InvalidValue(f"{name} = {shown(value)} {unit}".rstrip() + ": the low end is above the high end")
    elif isinstance(value, list):
        raise InvalidValue(f"{name} = {shown(value)}: must be a number or a tuple (low, high) in {unit}")
    else:
        require_number(name, value, unit, low=low, high=high, low_open=low_open)


def highest(value: Range) -> float:
    """Return the greatest number."""
    return value[1] if isinstance(value, tuple) else value


def within(value: Range, uniform: float) -> float:
    """Return the number that a ``uniform`` one in [0, 1) stands for."""
    return value[0] + (value[1] - value[0]) * uniform if isinstance(value, tuple) else value


def uniform_of(value: Range, drawn: float) -> float:
    """Return the number in [0, 1] at which ``within`` is nearest to what is ``drawn``."""
    low, high = value if isinstance(value, tuple) else (value, value)
    return min(max((drawn - low) / (high - low), 0.0), 1.0) if high > low else 0.0


def factor(error: float, uniform: float) -> float:
    """Return the factor within 1 ± ``error`` that a ``uniform`` number in [0, 1) stands for."""
    return 1.0 + error * (2.0 * uniform - 1.0)
