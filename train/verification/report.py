"""What a check found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class Row:
    """One figure beside its reference."""

    quantity: str
    measured: str
    reference: str
    error: str


@dataclass(frozen=True, kw_only=True)
class Check:
    """One check: the bar, what was measured, and whether it holds."""

    name: str
    bar: str
    measured: str
    passed: bool
    rows: Sequence[Row] = field(default_factory=tuple)
    note: str = ""
    """What a reader may ask about the rows."""


def markdown(checks: Sequence[Check], heading: str, footer: str) -> str:
    """Summary table, then the figures of every check beside their references."""
    lines = [f"# {heading}", "", "| check | bar | measured | holds |", "| --- | --- | --- | --- |"]
    lines += [
        f"| {check.name} | {check.bar} | {check.measured} | {'yes' if check.passed else '**no**'} |" for check in checks
    ]
    for check in checks:
        if check.rows:
            lines += ["", f"## {check.name}", "", "| figure | here | reference | error |"]
            lines += ["| --- | --- | --- | --- |"]
            lines += [f"| {r.quantity} | {r.measured} | {r.reference} | {r.error} |" for r in check.rows]
        if check.note:
            lines += ["", check.note]
    return "\n".join([*lines, "", footer, ""])
