"""Load and rope on their way through a Runge-Kutta step: where the parts of a stage find what they tell each other."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three, three
from aframe_env.dynamics.compiling import fma, scalar, select
from aframe_env.dynamics.layout import SPRINGS_MOST
from aframe_env.dynamics.load import RopeEnd
from aframe_env.dynamics.vector import Vector, difference

Array = npt.NDArray[np.float64]

# Places in LIFT and the stages after it.
SPEED: Final = SPRINGS_MOST
POSITION: Final = 2 * SPRINGS_MOST
VELOCITY: Final = POSITION + 3
STROKE: Final = POSITION + 6
TURN: Final = STROKE + 1
TURN_RATE: Final = STROKE + 2
INTEGRAL: Final = STROKE + 3
FILTERED: Final = STROKE + 4

# Places in one of ENDS.
END_VELOCITY: Final = 3
END_ACCELERATION: Final = 6
LENGTH: Final = 9
PAY_OUT: Final = 10
END_TARGET: Final = 11
END_REACH: Final = 12
END_OVER: Final = 14

# Places in STAGE: what is summed up over an inner step, and what the full model asks of a stage.
(
    PEAK,
    SLACKEST,
    COST,
    GROUND,
    GIVEN_RATE,
    AXIS,
    _,
    _,
    ELEMENT,
    TOP_STIFFNESS,
    TOP_LOSS,
    SLIDE,
    BELOW,
    LEVER,
    MASS_LEVER,
    MASS_LEVER_SQUARED,
) = range(16)


class Line(NamedTuple):
    """The line from pulley to load in a stage."""

    axis: Vector
    turn: Vector
    """Rate of the axis, 1/s."""
    away: float
    """Its length, m."""
    away_rate: float
    nearness: float
    """1 / ``away``."""
    pulley_speed: float
    """Speed of the pulley along it, downwards, m/s."""
    carried: float
    """Product of the pulley's velocity and ``turn``, m/s²."""
    turn_squared: float


class Rope(NamedTuple):
    """What the springs of a rope have in common in a stage."""

    springs: float
    element: float
    """Unstretched length of an element, m."""
    inverse: float
    """1 / ``element``."""
    stiffness: float
    """Of an element, N/m."""
    loss_time: float
    top_length: float
    """Unstretched length of the uppermost spring, to the drum, m."""
    top_stiffness: float
    top_loss: float
    drum: float
    """Place of the drum along the line, the pulley being at 0: above it, m."""
    fed: float
    """Speed of the rope at the drum, towards the pulley and as seen from there, m/s."""
    paid_out: float
    """Rate of the rope's unstretched length below the pulley, m/s."""
    passing: float
    """The same for an element."""
    inverse_mass: float
    """1 / the mass of an element, 1/kg."""
    softness: float
    """1 / E F, 1/N."""
    weight: float
    """N/m."""
    drag: float
    slide: float
    """Tension on the drum's side of the pulley over that on the load's."""


class Pull(NamedTuple):
    """What a spring tells the one above it, and the sums over the springs so far."""

    place: float
    """Place of the lump above it along the line, m below the pulley."""
    speed: float
    speed_below: float
    """Speed of the lump below that, m/s."""
    tension: float
    bottom: float
    """Tension of the lowest spring, N."""
    least: float
    """Least tension so far, N."""
    lever: float
    """Sum of the lumps' levers about the pulley, shares of the line."""
    mass_lever: float
    mass_lever_squared: float
    mass_lever_rate: float


CREEP: Final = 0.02
"""Speed of the rope at which the pulley's friction is at 70 %, m/s."""
LOAD_SHARE: Final = 1.0 / 6.0
"""Share of an element's mass that the load carries for the lowest lump."""


@scalar
def put_end(
    row: Array, slot: int, lanes: int, j: int, end: RopeEnd, acceleration: Vector, reach: tuple[float, float]
) -> None:
    """Write the rope's upper end to ENDS; ``reach``: \\|SH\\| [m] and its rate [m/s]."""
    put_three(row, slot, lanes, j, end.position)
    put_three(row, slot + END_VELOCITY, lanes, j, end.velocity)
    put_three(row, slot + END_ACCELERATION, lanes, j, acceleration)
    row[(slot + LENGTH) * lanes + j] = end.length
    row[(slot + PAY_OUT) * lanes + j] = end.pay_out_speed
    row[(slot + END_TARGET) * lanes + j] = row[at.TARGET * lanes + j]
    row[(slot + END_REACH) * lanes + j] = reach[0]
    row[(slot + END_REACH + 1) * lanes + j] = reach[1]


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


@scalar
def aim(row: Array, source: int, end: int, lanes: int, j: int) -> Line:
    """Find the line from pulley to load, and its turning."""
    position, velocity = three(row, source + POSITION, lanes, j), three(row, source + VELOCITY, lanes, j)
    pulley_rate = three(row, end + END_VELOCITY, lanes, j)
    u = difference(position, three(row, end, lanes, j))
    du = difference(velocity, pulley_rate)
    # A load at the very pulley has no rope direction; 1 nm stands in for it.
    away = math.sqrt(fma(u.x, u.x, fma(u.y, u.y, fma(u.z, u.z, 1e-18))))
    nearness = 1.0 / away
    axis = Vector(u.x * nearness, u.y * nearness, u.z * nearness)
    away_rate = fma(axis.x, du.x, fma(axis.y, du.y, axis.z * du.z))
    turn = Vector(
        fma(-away_rate, axis.x, du.x) * nearness,
        fma(-away_rate, axis.y, du.y) * nearness,
        fma(-away_rate, axis.z, du.z) * nearness,
    )
    speed = fma(axis.x, pulley_rate.x, fma(axis.y, pulley_rate.y, axis.z * pulley_rate.z))
    carried = fma(turn.x, pulley_rate.x, fma(turn.y, pulley_rate.y, turn.z * pulley_rate.z))
    squared = fma(turn.x, turn.x, fma(turn.y, turn.y, turn.z * turn.z))
    return Line(axis, turn, away, away_rate, nearness, speed, carried, squared)


@scalar
def slide_of(pay_out: float) -> float:
    """Way and degree to which the rope slides a pulley round: from -1, paid out, to 1, hauled in [m/s]."""
    return -pay_out / math.sqrt(fma(pay_out, pay_out, CREEP * CREEP))


@scalar
def divide(row: Array, source: int, end: int, lanes: int, j: int) -> Rope:
    """Find what all springs of the rope have in common."""
    # What a compensator gives is paid out as the drum's rope is.
    length = row[(end + LENGTH) * lanes + j] + row[(source + STROKE) * lanes + j]
    turned, given = row[(end + PAY_OUT) * lanes + j], row[(at.STAGE + GIVEN_RATE) * lanes + j]
    springs, axial = row[at.SPRINGS * lanes + j], row[at.AXIAL_STIFFNESS * lanes + j]
    # Where a frame luffs, the rope between drum and pulley takes up what it needs at its strain at the start.
    reach, reach_rate = row[(end + END_REACH) * lanes + j], row[(end + END_REACH + 1) * lanes + j]
    whole, part = row[at.DRUM_TO_PULLEY * lanes + j], row[at.DRUM_PART * lanes + j]
    drum_part, taken_up = part * (reach / whole), part * (reach_rate / whole)
    pay_out, loss_time = turned + given - taken_up, row[at.LOSS_TIME * lanes + j]
    lumps = springs - 1.0
    bare = lumps <= 0.0
    share = 1.0 / select(bare, 1.0, lumps)
    element = (length - drum_part) * share
    inverse = 1.0 / element
    top_length = select(bare, length, fma(0.5, element, drum_part))
    intact = 1.0 - row[at.PARTED * lanes + j]
    mass = select(bare, 1.0, row[at.ROPE_MASS * lanes + j] * element)
    slide = row[at.SHEAVE_FRICTION * lanes + j] * slide_of(turned - taken_up)
    # A single spring has the constant damping of eq. (26), the elements of a chain their material's.
    constant = row[at.ROPE_DAMPING * lanes + j] * top_length / axial
    return Rope(
        springs,
        element,
        inverse,
        axial * inverse,
        loss_time,
        top_length,
        intact * axial / fma(slide, drum_part, top_length),
        select(bare, constant, loss_time),
        -reach,
        turned + given - reach_rate,
        pay_out,
        pay_out * share,
        1.0 / mass,
        1.0 / axial,
        row[at.ROPE_WEIGHT * lanes + j],
        row[at.ROPE_DRAG * lanes + j],
        1.0 + slide,
    )
