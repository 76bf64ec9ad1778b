"""A rope with mass and a load in water, over a block of rows.

The rope below the pulley is a chain of up to nine equal elements, the mass of each in a lump at its middle, on the
straight line from pulley to load. Along that line every lump moves for itself; across it the rope turns as a rod does,
and the load carries its inertia and weight by the lever rule. Lump i, from the load, is at the share (i - 1/2)/n of the
unstretched length L below the pulley at all times: material passes it when the drum turns, so that
d(place)/dt = velocity - (1 + e) (i - 1/2)/n dL/dt. n + 1 springs without mass join load, lumps and drum; the uppermost
runs over the pulley as eqs. (25), (26) have it. Each pulls with max(0, E F (e + β de/dt)), or is slack.

A sixth of an element's mass is moved from the lowest lump to the load, as Simpson's rule has it: with that the load's
response to the pulley's motion is within 0.4 % of the continuous rope's where nine lumps meet waves of 4 s and longer.
A single spring without lumps, and with the rope's mass at nought, is the simplified model of ``load``.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three, three
from aframe_env.dynamics.compiling import fma, larger, scalar, select, smaller
from aframe_env.dynamics.layout import SPRINGS_MOST, Span
from aframe_env.dynamics.load import RopeEnd
from aframe_env.dynamics.vector import Vector, add, along, difference, inner, scaled

Array = npt.NDArray[np.float64]

# Places in LIFT and the stages after it.
SPEED: Final = SPRINGS_MOST
POSITION: Final = 2 * SPRINGS_MOST
VELOCITY: Final = POSITION + 3

# Places in one of ENDS.
END_VELOCITY: Final = 3
END_ACCELERATION: Final = 6
LENGTH: Final = 9
PAY_OUT: Final = 10

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
) = range(32)

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


@scalar
def current(row: Array, level: float, lanes: int, j: int) -> tuple[float, float]:
    """Current of lane j's water at a level [m]: x and y, m/s; linear between the levels given, constant beyond."""
    count = int(row[at.CURRENT_POINTS * lanes + j])
    x, y = row[(at.CURRENT + at.CURRENT_MOST) * lanes + j], row[(at.CURRENT + 2 * at.CURRENT_MOST) * lanes + j]
    for k in range(1, count):
        upper, lower = row[(at.CURRENT + k - 1) * lanes + j], row[(at.CURRENT + k) * lanes + j]
        share = smaller(larger((upper - level) / (upper - lower), 0.0), 1.0)
        x = fma(share, row[(at.CURRENT + at.CURRENT_MOST + k) * lanes + j] - x, x)
        y = fma(share, row[(at.CURRENT + 2 * at.CURRENT_MOST + k) * lanes + j] - y, y)
    return x, y


@scalar
def begin_water(row: Array, span: Span) -> None:
    """Find the current about the load, and the water's drag across the rope, at the start of a segment.

    Both belong to swings of a minute; they are held over the segment.
    """
    lanes = span.stride
    for j in range(span.begin, span.end):
        position, velocity = three(row, at.LOAD_POSITION, lanes, j), three(row, at.LOAD_VELOCITY, lanes, j)
        pulley, pulley_rate = three(row, at.PULLEY, lanes, j), three(row, at.PULLEY + 3, lanes, j)
        line, turning = difference(position, pulley), difference(velocity, pulley_rate)
        x, y = current(row, position.z, lanes, j)
        row[at.FLOW * lanes + j] = x
        row[(at.FLOW + 1) * lanes + j] = y
        push = hold = Vector(0.0, 0.0, 0.0)
        drag = row[at.ACROSS_DRAG * lanes + j]
        if drag > 0.0:
            away = math.sqrt(inner(line, line) + 1e-18)
            axis = scaled(1.0 / away, line)
            pieces = max(int(row[at.SPRINGS * lanes + j]) - 1, 1)
            for i in range(pieces):
                # The middles of equal pieces, as the lumps are but for strain.
                lever = (i + 0.5) / pieces
                x, y = current(row, fma(lever, line.z, pulley.z), lanes, j)
                through = difference(along(pulley_rate, lever, turning), Vector(x, y, 0.0))
                across = along(through, -inner(axis, through), axis)
                force = -drag * (away / pieces) * math.sqrt(inner(across, across))
                push = along(push, lever * force, across)
                hold = along(hold, (1.0 - lever) * force, across)
        put_three(row, at.PUSH, lanes, j, push)
        put_three(row, at.PUSH + 3, lanes, j, hold)


@scalar
def aim(row: Array, source: int, end: int, span: Span) -> None:
    """Find the line from pulley to load, its turning, and what all springs of the rope have in common."""
    lanes = span.stride
    for j in range(span.begin, span.end):
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
        row[source * lanes + j] = away
        row[(source + SPEED) * lanes + j] = away_rate + speed
        put_three(row, at.STAGE + AXIS, lanes, j, axis)
        put_three(row, at.STAGE + TURN, lanes, j, turn)
        row[(at.STAGE + AWAY_RATE) * lanes + j] = away_rate
        row[(at.STAGE + NEARNESS) * lanes + j] = nearness
        row[(at.STAGE + PULLEY_SPEED) * lanes + j] = speed
        row[(at.STAGE + CARRIED) * lanes + j] = fma(
            turn.x, pulley_rate.x, fma(turn.y, pulley_rate.y, turn.z * pulley_rate.z)
        )
        row[(at.STAGE + TURN_SQUARED) * lanes + j] = fma(turn.x, turn.x, fma(turn.y, turn.y, turn.z * turn.z))
    for j in range(span.begin, span.end):
        length, pay_out = row[(end + LENGTH) * lanes + j], row[(end + PAY_OUT) * lanes + j]
        lumps, axial = row[at.SPRINGS * lanes + j] - 1.0, row[at.AXIAL_STIFFNESS * lanes + j]
        bare = lumps <= 0.0
        share = 1.0 / select(bare, 1.0, lumps)
        element = (length - row[at.DRUM_PART * lanes + j]) * share
        inverse = 1.0 / element
        top_length = select(bare, length, fma(0.5, element, row[at.DRUM_PART * lanes + j]))
        intact = 1.0 - row[at.PARTED * lanes + j]
        mass = select(bare, 1.0, row[at.ROPE_MASS * lanes + j] * element)
        row[(at.STAGE + ELEMENT) * lanes + j] = element
        row[(at.STAGE + INVERSE_ELEMENT) * lanes + j] = inverse
        row[(at.STAGE + STIFFNESS) * lanes + j] = axial * inverse
        row[(at.STAGE + TOP_LENGTH) * lanes + j] = top_length
        row[(at.STAGE + TOP_STIFFNESS) * lanes + j] = intact * axial / top_length
        # A single spring has the constant damping of eq. (26), the elements of a chain their material's.
        constant = row[at.ROPE_DAMPING * lanes + j] * top_length / axial
        row[(at.STAGE + TOP_LOSS) * lanes + j] = select(bare, constant, row[at.LOSS_TIME * lanes + j])
        row[(at.STAGE + PAID_OUT) * lanes + j] = pay_out
        row[(at.STAGE + PASSING) * lanes + j] = pay_out * share
        row[(at.STAGE + INVERSE_MASS) * lanes + j] = 1.0 / mass
        row[(at.STAGE + SOFTNESS) * lanes + j] = 1.0 / axial
        row[(at.STAGE + SINKING) * lanes + j] = -row[(at.STAGE + AXIS + 2) * lanes + j]
        row[(at.STAGE + LEAST) * lanes + j] = math.inf
        row[(at.STAGE + LEVER) * lanes + j] = 0.0
        row[(at.STAGE + MASS_LEVER) * lanes + j] = 0.0
        row[(at.STAGE + MASS_LEVER_SQUARED) * lanes + j] = 0.0
        row[(at.STAGE + MASS_LEVER_RATE) * lanes + j] = 0.0


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
def spring(row: Array, i: int, source: int, target: int, fraction: float, weight: float, span: Span) -> None:
    """Pull with spring i of the rope, from its load's end, and move the lump at its lower end (not the load)."""
    lanes = span.stride
    half = 0.5 if i == 0 else 1.0
    # Strain and speed change within a spring; at a lump each of its two springs counts by the other's length.
    upper_share = 1.0 / 3.0 if i == 1 else 0.5
    top_share = 0.5 if i == 1 else 2.0 / 3.0
    for j in range(span.begin, span.end):
        springs = row[at.SPRINGS * lanes + j]
        inside, top = springs > i, springs == i + 1
        place, speed = row[(source + i) * lanes + j], row[(source + SPEED + i) * lanes + j]
        pulley_speed = row[(at.STAGE + PULLEY_SPEED) * lanes + j]
        paid_out = row[(at.STAGE + PAID_OUT) * lanes + j]
        upper = select(top, -row[at.DRUM_TO_PULLEY * lanes + j], row[(source + i + 1) * lanes + j])
        upper_speed = select(top, pulley_speed + paid_out, row[(source + SPEED + i + 1) * lanes + j])
        element = row[(at.STAGE + ELEMENT) * lanes + j]
        stiffness = select(
            top, row[(at.STAGE + TOP_STIFFNESS) * lanes + j], row[(at.STAGE + STIFFNESS) * lanes + j] / half
        )
        elongation = place - upper - select(top, row[(at.STAGE + TOP_LENGTH) * lanes + j], half * element)
        loss_time = select(top, row[(at.STAGE + TOP_LOSS) * lanes + j], row[at.LOSS_TIME * lanes + j])
        tension = larger(stiffness * fma(loss_time, speed - upper_speed, elongation), 0.0)
        below = row[(at.STAGE + BELOW) * lanes + j]
        row[(at.STAGE + BELOW) * lanes + j] = select(inside, tension, below)
        least = row[(at.STAGE + LEAST) * lanes + j]
        row[(at.STAGE + LEAST) * lanes + j] = smaller(least, select(inside, tension, least))
        if i == 0:
            row[(at.STAGE + BOTTOM) * lanes + j] = tension
        else:
            softness = row[(at.STAGE + SOFTNESS) * lanes + j]
            inverse = row[(at.STAGE + INVERSE_ELEMENT) * lanes + j]
            # Where the pulley is, the rope goes down with it and with what is paid out.
            upper_speed = fma(select(top, softness * tension, 0.0), paid_out, upper_speed)
            share = select(top, top_share, upper_share)
            strain = softness * fma(share, tension - below, below)
            lower_slope = (speed - row[(source + SPEED + i - 1) * lanes + j]) * inverse * (2.0 if i == 1 else 1.0)
            upper_slope = (upper_speed - speed) * inverse * select(top, 2.0, 1.0)
            slope = fma(share, upper_slope - lower_slope, lower_slope)
            passing = (i - 0.5) * row[(at.STAGE + PASSING) * lanes + j]
            lumps = springs - 1.0
            # What the load carries for the lowest lump; so the sum of mass times place stays as it is.
            mass = fma(-2.0 * LOAD_SHARE, lumps / fma(2.0, lumps, -1.0), 1.0) if i == 1 else 1.0
            own = fma(
                row[at.ROPE_WEIGHT * lanes + j],
                row[(at.STAGE + SINKING) * lanes + j],
                -row[at.ROPE_DRAG * lanes + j] * abs(speed) * speed,
            )
            acceleration = row[(at.STAGE + INVERSE_MASS) * lanes + j] * fma(element, own, below - tension)
            if i == 1:
                acceleration /= mass
            turning = fma(place, row[(at.STAGE + TURN_SQUARED) * lanes + j], row[(at.STAGE + CARRIED) * lanes + j])
            own_rate = speed - pulley_speed
            lever = select(inside, place * row[(at.STAGE + NEARNESS) * lanes + j], 0.0)
            lever_rate = fma(-lever, row[(at.STAGE + AWAY_RATE) * lanes + j], own_rate)
            row[(at.STAGE + LEVER) * lanes + j] += lever
            row[(at.STAGE + MASS_LEVER) * lanes + j] += mass * lever
            row[(at.STAGE + MASS_LEVER_SQUARED) * lanes + j] += mass * lever * lever
            row[(at.STAGE + MASS_LEVER_RATE) * lanes + j] += mass * lever * lever_rate
            place_rate = select(inside, fma(-passing, 1.0 + strain, own_rate), 0.0)
            speed_rate = select(inside, fma(slope, passing, acceleration + turning), 0.0)
            advance_slot(row, i, place_rate, source, target, fraction, weight, lanes, j)
            advance_slot(row, SPEED + i, speed_rate, source, target, fraction, weight, lanes, j)


@scalar
def pull_load(row: Array, source: int, target: int, end: int, fraction: float, weight: float, span: Span) -> None:
    """Accelerate the load by the rope's lowest spring, by weight, buoyancy and drag, and by the rope's turning."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        axis, turn = three(row, at.STAGE + AXIS, lanes, j), three(row, at.STAGE + TURN, lanes, j)
        velocity = three(row, source + VELOCITY, lanes, j)
        bare = row[at.SPRINGS * lanes + j] == 1.0
        element = select(bare, 0.0, row[(at.STAGE + ELEMENT) * lanes + j])
        rope_mass, rope_weight = row[at.ROPE_MASS * lanes + j] * element, row[at.ROPE_WEIGHT * lanes + j] * element
        # What the rope's lumps, held on the line, hand on to the load by the lever rule.
        squared = row[(at.STAGE + MASS_LEVER_SQUARED) * lanes + j]
        carried = rope_mass * (squared - row[(at.STAGE + MASS_LEVER) * lanes + j])
        spun = -2.0 * rope_mass * row[(at.STAGE + MASS_LEVER_RATE) * lanes + j]
        pulley = three(row, end + END_ACCELERATION, lanes, j)
        handed = Vector(
            fma(carried, pulley.x, spun * turn.x),
            fma(carried, pulley.y, spun * turn.y),
            fma(carried, pulley.z, spun * turn.z) - rope_weight * row[(at.STAGE + LEVER) * lanes + j],
        )
        handed = add(handed, three(row, at.PUSH, lanes, j))
        bottom = row[(at.STAGE + BOTTOM) * lanes + j]
        pull = -bottom - inner(axis, handed)
        across, down = row[at.LOAD_DRAG * lanes + j], row[(at.LOAD_DRAG + 1) * lanes + j]
        flow_x = velocity.x - row[at.FLOW * lanes + j]
        flow_y = velocity.y - row[(at.FLOW + 1) * lanes + j]
        across *= math.sqrt(fma(flow_x, flow_x, flow_y * flow_y))
        down *= abs(velocity.z)
        force = Vector(
            fma(pull, axis.x, fma(-across, flow_x, handed.x)),
            fma(pull, axis.y, fma(-across, flow_y, handed.y)),
            fma(pull, axis.z, fma(-down, velocity.z, handed.z)) - row[at.LOAD_WEIGHT * lanes + j],
        )
        # (D + J (1 - e eᵀ)) a = force, with D diagonal: Sherman and Morrison's formula.
        turned = rope_mass * squared
        own = fma(LOAD_SHARE, rope_mass, turned)
        inverse = 1.0 / (row[at.LOAD_INERTIA * lanes + j] + own)
        inverse_z = 1.0 / (row[(at.LOAD_INERTIA + 1) * lanes + j] + own)
        eased = Vector(inverse * axis.x, inverse * axis.y, inverse_z * axis.z)
        more = turned * inner(eased, force) / (1.0 - turned * inner(eased, axis))
        acceleration = Vector(
            fma(more, eased.x, inverse * force.x),
            fma(more, eased.y, inverse * force.y),
            fma(more, eased.z, inverse_z * force.z),
        )
        intact, half_weight = 1.0 - row[at.PARTED * lanes + j], row[at.HALF_WEIGHT * lanes + j]
        tension = fma(intact, half_weight, row[(at.STAGE + BELOW) * lanes + j])
        row[at.TENSION * lanes + j] = tension
        carried_too = LOAD_SHARE * rope_mass * inner(axis, acceleration)
        row[at.LOAD_TENSION * lanes + j] = larger(bottom - half_weight + carried_too, 0.0)
        row[(at.STAGE + PEAK) * lanes + j] = larger(row[(at.STAGE + PEAK) * lanes + j], tension)
        slackest = row[(at.STAGE + SLACKEST) * lanes + j]
        row[(at.STAGE + SLACKEST) * lanes + j] = smaller(slackest, row[(at.STAGE + LEAST) * lanes + j])
        error = row[(source + POSITION + 2) * lanes + j] - row[at.TARGET * lanes + j]
        row[(at.STAGE + COST) * lanes + j] = fma(weight, error * error, row[(at.STAGE + COST) * lanes + j])
        advance_slot(row, POSITION, velocity.x, source, target, fraction, weight, lanes, j)
        advance_slot(row, POSITION + 1, velocity.y, source, target, fraction, weight, lanes, j)
        advance_slot(row, POSITION + 2, velocity.z, source, target, fraction, weight, lanes, j)
        advance_slot(row, VELOCITY, acceleration.x, source, target, fraction, weight, lanes, j)
        advance_slot(row, VELOCITY + 1, acceleration.y, source, target, fraction, weight, lanes, j)
        advance_slot(row, VELOCITY + 2, acceleration.z, source, target, fraction, weight, lanes, j)


@scalar
def stage(
    row: Array,
    source: int,
    target: int,
    end: int,
    fraction: float,
    weight: float,
    most: int,
    unrolled: bool,
    span: Span,
) -> None:
    """Make one stage of the Runge-Kutta scheme: from the rates at ``source`` to the state at ``target``.

    ``unrolled``: springs by constant numbers, which the compiler vectorises over the lanes but takes long to compile.
    """
    aim(row, source, end, span)
    if unrolled:
        spring(row, 0, source, target, fraction, weight, span)
        if most > 1:
            spring(row, 1, source, target, fraction, weight, span)
            spring(row, 2, source, target, fraction, weight, span)
            spring(row, 3, source, target, fraction, weight, span)
            spring(row, 4, source, target, fraction, weight, span)
            spring(row, 5, source, target, fraction, weight, span)
            spring(row, 6, source, target, fraction, weight, span)
        if most > 7:
            spring(row, 7, source, target, fraction, weight, span)
        if most > 8:
            spring(row, 8, source, target, fraction, weight, span)
            spring(row, 9, source, target, fraction, weight, span)
    else:
        for i in range(most):
            spring(row, i, source, target, fraction, weight, span)
    pull_load(row, source, target, end, fraction, weight, span)


@scalar
def lift_step(row: Array, most: int, unrolled: bool, span: Span) -> None:
    """Make one Runge-Kutta step of STEP_LENGTH with ropes of up to ``most`` springs, whose ends are in ENDS."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        row[(at.STAGE + PEAK) * lanes + j] = 0.0
        row[(at.STAGE + SLACKEST) * lanes + j] = math.inf
        row[(at.STAGE + COST) * lanes + j] = 0.0
    start, middle, end = at.ENDS, at.ENDS + at.END_SIZE, at.ENDS + 2 * at.END_SIZE
    if unrolled:
        stage(row, at.LIFT, at.LIFT_A, start, 0.5, 1.0, most, unrolled, span)
        stage(row, at.LIFT_A, at.LIFT_B, middle, 0.5, 2.0, most, unrolled, span)
        stage(row, at.LIFT_B, at.LIFT_A, middle, 1.0, 2.0, most, unrolled, span)
        stage(row, at.LIFT_A, at.LIFT, end, 1.0, 1.0, most, unrolled, span)
    else:
        for k in range(4):
            source = at.LIFT if k == 0 else (at.LIFT_B if k == 2 else at.LIFT_A)
            target = at.LIFT if k == 3 else (at.LIFT_B if k == 1 else at.LIFT_A)
            upper = start if k == 0 else (end if k == 3 else middle)
            fraction = 0.5 if k < 2 else 1.0
            stage(row, source, target, upper, fraction, 2.0 if k == 1 or k == 2 else 1.0, most, unrolled, span)


@scalar
def springs_of(row: Array, span: Span) -> tuple[int, int]:
    """Fewest and most springs of the block's ropes; 0 is the paper's rope."""
    lanes = span.stride
    fewest, most = SPRINGS_MOST, 0
    for j in range(span.begin, span.end):
        springs = int(row[at.SPRINGS * lanes + j])
        fewest = springs if springs < fewest else fewest
        most = springs if springs > most else most
    return fewest, most
