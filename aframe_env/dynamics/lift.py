"""Load and rope on their way through a Runge-Kutta step: where the parts of a stage find what they tell each other."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three
from aframe_env.dynamics.compiling import fma, scalar
from aframe_env.dynamics.layout import SPRINGS_MOST
from aframe_env.dynamics.load import RopeEnd
from aframe_env.dynamics.vector import Vector

Array = npt.NDArray[np.float64]

# Places in LIFT and the stages after it.
SPEED: Final = SPRINGS_MOST
POSITION: Final = 2 * SPRINGS_MOST
VELOCITY: Final = POSITION + 3
STROKE: Final = POSITION + 6

# Places in one of ENDS.
END_VELOCITY: Final = 3
END_ACCELERATION: Final = 6
LENGTH: Final = 9
PAY_OUT: Final = 10
END_TARGET: Final = 11

# Places in STAGE.
(
    AXIS,
    _,
    _,
    TURN,
    _,
    _,
    AWAY_RATE,
    NEARNESS,
    PULLEY_SPEED,
    CARRIED,
    TURN_SQUARED,
    SINKING,
    ELEMENT,
    INVERSE_ELEMENT,
    STIFFNESS,
    TOP_LENGTH,
    TOP_STIFFNESS,
    TOP_LOSS,
    PAID_OUT,
    PASSING,
    INVERSE_MASS,
    SOFTNESS,
    BELOW,
    BOTTOM,
    LEAST,
    LEVER,
    MASS_LEVER,
    MASS_LEVER_SQUARED,
    MASS_LEVER_RATE,
    PEAK,
    SLACKEST,
    COST,
    SLIDE,
    GIVEN_RATE,
    GROUND,
) = range(35)

LOAD_SHARE: Final = 1.0 / 6.0
"""Share of an element's mass that the load carries for the lowest lump."""


@scalar
def put_end(row: Array, slot: int, lanes: int, j: int, end: RopeEnd, acceleration: Vector) -> None:
    """Write the rope's upper end to ENDS."""
    put_three(row, slot, lanes, j, end.position)
    put_three(row, slot + END_VELOCITY, lanes, j, end.velocity)
    put_three(row, slot + END_ACCELERATION, lanes, j, acceleration)
    row[(slot + LENGTH) * lanes + j] = end.length
    row[(slot + PAY_OUT) * lanes + j] = end.pay_out_speed
    row[(slot + END_TARGET) * lanes + j] = row[at.TARGET * lanes + j]


@scalar
def advance_slot(
    row: Array, slot: int, rate: float, source: int, target: int, fraction: float, weight: float, lanes: int, j: int
) -> None:
    """Carry one quantity of LIFT over to ``target``, its rate at this stage being known.

    The stages before the last look ahead from LIFT by ``fraction`` of the step; the last, which has LIFT itself for
    its target, adds all of their rates up.
    """
    h = row[at.STEP_LENGTH * lanes + j]
    state = row[(at.LIFT + slot) * lanes + j]
    if source == at.LIFT:
        row[(at.LIFT_SUM + slot) * lanes + j] = rate
        row[(target + slot) * lanes + j] = fma(fraction * h, rate, state)
    elif target == at.LIFT:
        total = row[(at.LIFT_SUM + slot) * lanes + j] + rate
        row[(at.LIFT + slot) * lanes + j] = fma(h * (1.0 / 6.0), total, state)
    else:
        row[(at.LIFT_SUM + slot) * lanes + j] = fma(weight, rate, row[(at.LIFT_SUM + slot) * lanes + j])
        row[(target + slot) * lanes + j] = fma(fraction * h, rate, state)
