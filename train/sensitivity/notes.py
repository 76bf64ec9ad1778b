"""notes.md of a sensitivity study."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from train.sensitivity.analysis import Sensitivity
from train.sensitivity.factors import FACTORS
from train.shared.markdown import table

TEXT = """\
# What becomes of policies that were told wrongly
Made by `{command}`.

{scenarios} held-out random seas are assumed. Every policy that goes by the clock (the drives, and the drive map) is
told its assumed scenario in full, waves and phases included, and then meets another one; laws and agents are told the
rope's length and its stiffness, weigh the load, and measure the rest. Figures are RMS depth errors over that of the
drum left still in the assumed scenario, so that what the scenario itself does is in them too: see the drum still.

## As assumed, at both ends of each range, and over all ranges at once
Median over the assumed scenarios; the last columns are median, 95 % quantile and worst case when all factors vary
together over their ranges.

{ends}
## Sobol indices: first order / total
Shares of the variance of the decimal logarithm (mean over the assumed scenarios) when all factors vary together. A
factor whose total is well above its first order acts through others.

{indices}
"""


def notes(command: str, scenarios: int, studies: Sequence[Sensitivity]) -> str:
    """Text of notes.md."""
    ranges = [f"{factor.name} {factor.low:.3g} … {factor.high:.3g}" for factor in FACTORS]
    ends = [["policy", "as assumed", *ranges, "all: median", "95 %", "worst"]]
    indices = [["policy", *(factor.name for factor in FACTORS)]]
    for each in studies:
        middle = np.median([_at(c.values, c.left, f.assumed) for c, f in zip(each.curves, FACTORS, strict=True)])
        cells = [" … ".join(f"{np.median(c.left[end]):.3g}" for end in (0, -1)) for c in each.curves]
        ends.append(
            [each.policy, f"{middle:.3g}", *cells, f"{each.median:.3g}", f"{each.high:.3g}", f"{each.worst:.3g}"]
        )
        shares = [f"{max(0.0, index.first):.2f} / {index.total:.2f}" for index in each.indices]
        indices.append([each.policy, *shares])
    return TEXT.format(
        command=command, scenarios=scenarios, ends=table(ends[0], ends[1:]), indices=table(indices[0], indices[1:])
    )


def _at(values: Sequence[float], left: Sequence[Sequence[float]], place: float) -> float:
    return float(np.median(left[int(np.argmin(np.abs(np.array(values) - place)))]))
