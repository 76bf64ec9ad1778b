"""Results of the checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from train.shared.markdown import table

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Row:
    """A figure beside its reference."""

    quantity: str
    measured: str
    reference: str
    error: str

    @classmethod
    def of_ranges(cls, column: str, here: FloatArray, there: FloatArray, error: str) -> Row:
        """Peak-to-peak of a history (k,) beside that of its reference."""
        return cls(
            quantity=f"{column}, peak-to-peak",
            measured=f"{np.ptp(here):.6g}",
            reference=f"{np.ptp(there):.6g}",
            error=error,
        )


@dataclass(frozen=True, kw_only=True)
class Check:
    """A check: the bar, the measured figures, and the verdict."""

    name: str
    bar: str
    measured: str
    passed: bool
    rows: Sequence[Row] = field(default_factory=tuple)
    note: str = ""
    """Explanation of the rows."""


def markdown(checks: Sequence[Check], heading: str, footer: str) -> str:
    """Summary table, then the figures of every check beside their references."""
    found = [(c.name, c.bar, c.measured, "yes" if c.passed else "**no**") for c in checks]
    parts = [f"# {heading}\n", table(("check", "bar", "measured", "holds"), found)]
    for check in checks:
        if check.rows:
            figures = [(r.quantity, r.measured, r.reference, r.error) for r in check.rows]
            parts += [f"## {check.name}\n", table(("figure", "here", "reference", "error"), figures)]
        if check.note:
            parts.append(f"{check.note}\n")
    return "\n".join([*parts, f"{footer}\n"])
