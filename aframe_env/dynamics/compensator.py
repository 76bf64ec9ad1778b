"""What is between drum and pulley besides rope: a passive compensator, and the friction of the pulley itself.

A cylinder with a gas behind it pays rope out as the tension grows, T = F (l / (l - s))^n + c ds/dt, with s the rope
that it has given, F the gas force at mid-stroke and l the length of the gas column there.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import fma, scalar
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.lift import GIVEN_RATE, LENGTH, PAY_OUT, SPEED, STROKE, advance_slot, aim

Array = npt.NDArray[np.float64]

CREEP: Final = 0.02
"""Speed of the rope at which the pulley's friction is at 70 %, m/s."""


@scalar
def slide_of(pay_out: float) -> float:
    """Way and degree to which the rope slides a pulley round: from -1, paid out, to 1, hauled in [m/s]."""
    return -pay_out / math.sqrt(fma(pay_out, pay_out, CREEP * CREEP))


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
            length, paid_out = row[(end + LENGTH) * lanes + j] + stroke, row[(end + PAY_OUT) * lanes + j]
            springs, axial = int(row[at.SPRINGS * lanes + j]), row[at.AXIAL_STIFFNESS * lanes + j]
            drum_part, loss_time = row[at.DRUM_PART * lanes + j], row[at.LOSS_TIME * lanes + j]
            top_length = length
            if springs > 1:
                top_length = fma(0.5, (length - drum_part) / (springs - 1.0), drum_part)
            else:
                loss_time = row[at.ROPE_DAMPING * lanes + j] * length / axial
            slide = row[at.SHEAVE_FRICTION * lanes + j] * slide_of(paid_out)
            stiffness = (1.0 - row[at.PARTED * lanes + j]) * axial / fma(slide, drum_part, top_length)
            line = aim(row, source, end, lanes, j)
            place, speed = line.away, line.away_rate + line.pulley_speed
            if springs > 1:
                place, speed = row[(source + springs - 1) * lanes + j], row[(source + SPEED + springs - 1) * lanes + j]
            place += row[at.DRUM_TO_PULLEY * lanes + j]
            speed -= line.pulley_speed + paid_out
            # The tension at the drum as it would be with the cylinder held; the loss in the rope opposes its speed.
            held = (1.0 + slide) * stiffness * fma(loss_time, speed, place - top_length)
            held += (1.0 + slide) * row[at.HALF_WEIGHT * lanes + j]
            column = row[(at.GAS + 1) * lanes + j]
            gas = row[at.GAS * lanes + j] * (column / (column - stroke)) ** row[(at.GAS + 2) * lanes + j]
            damping = row[(at.GAS + 3) * lanes + j]
            rate = (held - gas) / fma((1.0 + slide) * stiffness, loss_time, damping)
            if held - (1.0 + slide) * stiffness * loss_time * rate < 0.0:
                rate = -gas / damping  # the rope is slack
            if (stroke >= half_stroke and rate > 0.0) or (stroke <= -half_stroke and rate < 0.0):
                rate = 0.0
            row[(at.STAGE + GIVEN_RATE) * lanes + j] = rate
            advance_slot(row, STROKE, rate, source, target, fraction, weight, lanes, j)
