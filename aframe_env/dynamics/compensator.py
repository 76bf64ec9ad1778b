"""What is between drum and pulley besides rope: a passive compensator.

A cylinder with a gas behind it pays rope out as the tension grows, T = F (l / (l - s))^n + c ds/dt, with s the rope
that it has given, F the gas force at mid-stroke and l the length of the gas column there.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import fma, scalar
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.lift import END_REACH, GIVEN_RATE, PAY_OUT, SPEED, STROKE, advance_slot, aim, divide

Array = npt.NDArray[np.float64]


@scalar
def give(row: Array, source: int, target: int, end: int, fraction: float, weight: float, span: Span) -> None:
    """Let passive compensators give: rope is paid out as the tension on the drum's side overcomes gas and damper.

    At the ends of the stroke the cylinder stands.
    """
    lanes = span.stride
    for j in range(span.begin, span.end):
        half_stroke = row[at.HALF_STROKE * lanes + j]
        if half_stroke > 0.0:
            stroke = row[(source + STROKE) * lanes + j]
            line, rope = aim(row, source, end, lanes, j), divide(row, source, end, lanes, j)
            springs = int(rope.springs)
            fed = row[(end + PAY_OUT) * lanes + j] - row[(end + END_REACH + 1) * lanes + j]
            place, speed = line.away, line.away_rate + line.pulley_speed
            if springs > 1:
                place, speed = row[(source + springs - 1) * lanes + j], row[(source + SPEED + springs - 1) * lanes + j]
            # The tension at the drum as it would be with the cylinder held; the loss in the rope opposes its speed.
            stiffness = rope.slide * rope.top_stiffness
            held = stiffness * fma(rope.top_loss, speed - line.pulley_speed - fed, place - rope.drum - rope.top_length)
            held += rope.slide * row[at.HALF_WEIGHT * lanes + j]
            column = row[(at.GAS + 1) * lanes + j]
            gas = row[at.GAS * lanes + j] * (column / (column - stroke)) ** row[(at.GAS + 2) * lanes + j]
            damping = row[(at.GAS + 3) * lanes + j]
            rate = (held - gas) / fma(stiffness, rope.top_loss, damping)
            if held - stiffness * rope.top_loss * rate < 0.0:
                rate = -gas / damping  # the rope is slack
            if (stroke >= half_stroke and rate > 0.0) or (stroke <= -half_stroke and rate < 0.0):
                rate = 0.0
            row[(at.STAGE + GIVEN_RATE) * lanes + j] = rate
            advance_slot(row, STROKE, rate, source, target, fraction, weight, lanes, j)
