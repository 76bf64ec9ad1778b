"""A rope with mass and a load in water, over a block of rows.

The rope below the pulley is a chain of up to nine elements with its mass at their nodes, on the straight line from pulley
to load. Along that line every node moves for itself; across it the rope turns as a rod does, and the load carries its
inertia and weight by the lever rule. Nodes are numbered from the load, which is node 0, to the pulley, and node i is at
the share i/N of the unstretched length below the pulley at all times: material passes it when the drum turns, as
d(place)/dt = velocity - (1 + e) i/N dl/dt. The uppermost element runs on over the pulley to the drum, as eqs. (25), (26)
have it; the drum's part has no mass. Every element pulls with max(0, E F (e + β de/dt)), or goes slack.

A rope of one element and no mass is the simplified model of ``load``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three, three
from aframe_env.dynamics.compiling import fma, larger, scalar, select, smaller
from aframe_env.dynamics.layout import ELEMENTS_MOST, Span
from aframe_env.dynamics.load import RopeEnd
from aframe_env.dynamics.vector import Vector, difference

Array = npt.NDArray[np.float64]

# Places in LIFT and the stages after it.
SPEED: Final = ELEMENTS_MOST
POSITION: Final = 2 * ELEMENTS_MOST
VELOCITY: Final = POSITION + 3

# Places in one of ENDS.
END_VELOCITY: Final = 3
END_ACCELERATION: Final = 6
LENGTH: Final = 9
PAY_OUT: Final = 10

# Places in STAGE.
(
    AXIS_X,
    AXIS_Y,
    AXIS_Z,
    TURN_X,
    TURN_Y,
    TURN_Z,
    AWAY_RATE,
    NEARNESS,
    PULLEY_SPEED,
    CARRIED,
    TURN_SQUARED,
    ELEMENT,
    HALF_INVERSE,
    STIFFNESS,
    TOP_STIFFNESS,
    TOP_PLACE,
    TOP_SPEED,
    NODE_RATE,
    SINKING,
    BELOW,
    BOTTOM,
    LEAST,
    TOP_ACCELERATION,
    LEVER,
    LEVER_SQUARED,
    LEVER_RATE,
    PEAK,
    SLACKEST,
    COST,
    SOFTNESS,
    LIGHTNESS,
) = range(31)


@scalar
def put_end(row: Array, slot: int, lanes: int, j: int, end: RopeEnd, acceleration: Vector) -> None:
    """Write the rope's upper end to ENDS."""
    put_three(row, slot, lanes, j, end.position)
    put_three(row, slot + END_VELOCITY, lanes, j, end.velocity)
    put_three(row, slot + END_ACCELERATION, lanes, j, acceleration)
    row[(slot + LENGTH) * lanes + j] = end.length
    row[(slot + PAY_OUT) * lanes + j] = end.pay_out_speed


@scalar
def aim(row: Array, source: int, end: int, span: Span) -> None:
    """Find the line from pulley to load, its turning, and what all elements of the rope have in common."""
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
        put_three(row, at.STAGE + AXIS_X, lanes, j, axis)
        put_three(row, at.STAGE + TURN_X, lanes, j, turn)
        row[(at.STAGE + AWAY_RATE) * lanes + j] = away_rate
        row[(at.STAGE + NEARNESS) * lanes + j] = nearness
        row[(at.STAGE + PULLEY_SPEED) * lanes + j] = speed
        row[(at.STAGE + CARRIED) * lanes + j] = fma(
            turn.x, pulley_rate.x, fma(turn.y, pulley_rate.y, turn.z * pulley_rate.z)
        )
        row[(at.STAGE + TURN_SQUARED) * lanes + j] = fma(turn.x, turn.x, fma(turn.y, turn.y, turn.z * turn.z))
    for j in range(span.begin, span.end):
        length, pay_out = row[(end + LENGTH) * lanes + j], row[(end + PAY_OUT) * lanes + j]
        share = 1.0 / row[at.ELEMENTS * lanes + j]
        drum_part, axial = row[at.DRUM_PART * lanes + j], row[at.AXIAL_STIFFNESS * lanes + j]
        element = (length - drum_part) * share
        inverse = 1.0 / element
        half_weight = 0.5 * row[at.ROPE_WEIGHT * lanes + j] * element
        # The drum's part bears half an element's weight more than the middle of the element that it belongs to.
        stretched_part = row[at.DRUM_TO_PULLEY * lanes + j] * (1.0 - half_weight / axial)
        intact = 1.0 - row[at.PARTED * lanes + j]
        row[(at.STAGE + ELEMENT) * lanes + j] = element
        row[(at.STAGE + HALF_INVERSE) * lanes + j] = 0.5 * inverse
        row[(at.STAGE + STIFFNESS) * lanes + j] = axial * inverse
        row[(at.STAGE + TOP_STIFFNESS) * lanes + j] = intact * axial / (element + drum_part)
        row[(at.STAGE + TOP_PLACE) * lanes + j] = drum_part - stretched_part
        row[(at.STAGE + TOP_SPEED) * lanes + j] = row[(at.STAGE + PULLEY_SPEED) * lanes + j] + pay_out
        row[(at.STAGE + NODE_RATE) * lanes + j] = pay_out * share
        row[(at.STAGE + SOFTNESS) * lanes + j] = 1.0 / axial
        row[(at.STAGE + LIGHTNESS) * lanes + j] = 1.0 / row[at.ROPE_MASS * lanes + j]
        row[(at.STAGE + SINKING) * lanes + j] = -row[(at.STAGE + AXIS_Z) * lanes + j]
        row[(at.STAGE + LEAST) * lanes + j] = math.inf
        row[(at.STAGE + LEVER) * lanes + j] = 0.0
        row[(at.STAGE + LEVER_SQUARED) * lanes + j] = 0.0
        row[(at.STAGE + LEVER_RATE) * lanes + j] = 0.0


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


def _element(i: int) -> Callable[[Array, int, int, float, float, Span], None]:
    """Element i of the rope, from its load's end, and the node at its lower end (but for the load itself)."""

    @scalar
    def pull(row: Array, source: int, target: int, fraction: float, weight: float, span: Span) -> None:
        lanes = span.stride
        for j in range(span.begin, span.end):
            elements = row[at.ELEMENTS * lanes + j]
            inside, top = elements > i, elements == i + 1
            place, speed = row[(source + i) * lanes + j], row[(source + SPEED + i) * lanes + j]
            upper, upper_speed = row[(source + i + 1) * lanes + j], row[(source + SPEED + i + 1) * lanes + j]
            stiffness = select(
                top, row[(at.STAGE + TOP_STIFFNESS) * lanes + j], row[(at.STAGE + STIFFNESS) * lanes + j]
            )
            element = row[(at.STAGE + ELEMENT) * lanes + j]
            elongation = place - select(top, row[(at.STAGE + TOP_PLACE) * lanes + j], upper) - element
            rate = speed - select(top, row[(at.STAGE + TOP_SPEED) * lanes + j], upper_speed)
            tension = larger(stiffness * fma(row[at.LOSS_TIME * lanes + j], rate, elongation), 0.0)
            below = row[(at.STAGE + BELOW) * lanes + j]
            row[(at.STAGE + BELOW) * lanes + j] = select(inside, tension, below)
            least = row[(at.STAGE + LEAST) * lanes + j]
            row[(at.STAGE + LEAST) * lanes + j] = smaller(least, select(inside, tension, least))
            if i == 0:
                row[(at.STAGE + BOTTOM) * lanes + j] = tension
            else:
                pulley_speed = row[(at.STAGE + PULLEY_SPEED) * lanes + j]
                strain = tension * row[(at.STAGE + SOFTNESS) * lanes + j]
                passing = i * row[(at.STAGE + NODE_RATE) * lanes + j]
                half_inverse = row[(at.STAGE + HALF_INVERSE) * lanes + j]
                # At the pulley the material runs down with the pulley and with what is paid out.
                entering = fma(elements * row[(at.STAGE + NODE_RATE) * lanes + j], 1.0 + strain, pulley_speed)
                lower, lower_speed = row[(source + i - 1) * lanes + j], row[(source + SPEED + i - 1) * lanes + j]
                spacing = (lower - select(top, 0.0, upper)) * half_inverse
                gradient = (select(top, entering, upper_speed) - lower_speed) * half_inverse
                inverse_mass = row[(at.STAGE + LIGHTNESS) * lanes + j]
                own_rate = speed - pulley_speed
                heaviness = row[at.ROPE_WEIGHT * lanes + j] * row[(at.STAGE + SINKING) * lanes + j]
                drag = row[at.ROPE_DRAG * lanes + j] * abs(speed) * speed
                acceleration = inverse_mass * (fma(below - tension, 2.0 * half_inverse, heaviness) - drag)
                turning = fma(
                    place, row[(at.STAGE + TURN_SQUARED) * lanes + j], row[(at.STAGE + CARRIED) * lanes + j]
                )
                last = row[(at.STAGE + TOP_ACCELERATION) * lanes + j]
                row[(at.STAGE + TOP_ACCELERATION) * lanes + j] = select(inside, acceleration, last)
                lever = place * row[(at.STAGE + NEARNESS) * lanes + j]
                lever_rate = fma(-lever, row[(at.STAGE + AWAY_RATE) * lanes + j], own_rate)
                row[(at.STAGE + LEVER) * lanes + j] += select(inside, lever, 0.0)
                row[(at.STAGE + LEVER_SQUARED) * lanes + j] += select(inside, lever * lever, 0.0)
                row[(at.STAGE + LEVER_RATE) * lanes + j] += select(inside, lever * lever_rate, 0.0)
                place_rate = select(inside, fma(-spacing, passing, own_rate), 0.0)
                speed_rate = select(inside, fma(gradient, passing, acceleration + turning), 0.0)
                advance_slot(row, i, place_rate, source, target, fraction, weight, lanes, j)
                advance_slot(row, SPEED + i, speed_rate, source, target, fraction, weight, lanes, j)

    return pull


_e0, _e1, _e2, _e3, _e4, _e5, _e6, _e7, _e8 = (_element(i) for i in range(ELEMENTS_MOST))


@scalar
def pull_load(row: Array, source: int, target: int, end: int, fraction: float, weight: float, span: Span) -> None:
    """Accelerate the load by the rope's lowest element, by weight, buoyancy and drag, and by the rope's turning."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        axis, turn = three(row, at.STAGE + AXIS_X, lanes, j), three(row, at.STAGE + TURN_X, lanes, j)
        velocity = three(row, source + VELOCITY, lanes, j)
        speed = row[(source + SPEED) * lanes + j]
        element = row[(at.STAGE + ELEMENT) * lanes + j]
        rope_mass = row[at.ROPE_MASS * lanes + j] * element
        rope_weight = row[at.ROPE_WEIGHT * lanes + j] * element
        bottom = row[(at.STAGE + BOTTOM) * lanes + j]
        pull = -bottom - 0.5 * row[at.ROPE_DRAG * lanes + j] * element * abs(speed) * speed
        # What the rope's nodes, held on the line, hand on to the load by the lever rule.
        lever, lever_squared = row[(at.STAGE + LEVER) * lanes + j], row[(at.STAGE + LEVER_SQUARED) * lanes + j]
        pulley = three(row, end + END_ACCELERATION, lanes, j)
        carried, spun = -rope_mass * (lever - lever_squared), -2.0 * rope_mass * row[(at.STAGE + LEVER_RATE) * lanes + j]
        handed = Vector(
            fma(carried, pulley.x, spun * turn.x),
            fma(carried, pulley.y, spun * turn.y),
            fma(carried, pulley.z, spun * turn.z) - rope_weight * lever,
        )
        pull -= fma(axis.x, handed.x, fma(axis.y, handed.y, axis.z * handed.z))
        drag, drag_z = row[at.LOAD_DRAG * lanes + j], row[(at.LOAD_DRAG + 1) * lanes + j]
        drag = drag * math.sqrt(fma(velocity.x, velocity.x, velocity.y * velocity.y))
        drag_z = drag_z * abs(velocity.z)
        force = Vector(
            fma(pull, axis.x, fma(-drag, velocity.x, handed.x)),
            fma(pull, axis.y, fma(-drag, velocity.y, handed.y)),
            fma(pull, axis.z, fma(-drag_z, velocity.z, handed.z)) - row[at.LOAD_WEIGHT * lanes + j] - 0.5 * rope_weight,
        )
        # (D + J (1 - e eᵀ)) a = force, with D diagonal: Sherman and Morrison's formula.
        turned = rope_mass * lever_squared
        own = row[at.END_SHARE * lanes + j] * rope_mass + turned
        inverse = 1.0 / (row[at.LOAD_INERTIA * lanes + j] + own)
        inverse_z = 1.0 / (row[(at.LOAD_INERTIA + 1) * lanes + j] + own)
        eased = Vector(inverse * axis.x, inverse * axis.y, inverse_z * axis.z)
        along_axis = fma(eased.x, force.x, fma(eased.y, force.y, eased.z * force.z))
        held = fma(eased.x, axis.x, fma(eased.y, axis.y, eased.z * axis.z))
        more = turned * along_axis / (1.0 - turned * held)
        acceleration = Vector(
            fma(more, eased.x, inverse * force.x),
            fma(more, eased.y, inverse * force.y),
            fma(more, eased.z, inverse_z * force.z),
        )
        sinking = row[(at.STAGE + SINKING) * lanes + j]
        outward = fma(axis.x, acceleration.x, fma(axis.y, acceleration.y, axis.z * acceleration.z))
        last = select(row[at.ELEMENTS * lanes + j] == 1.0, outward, row[(at.STAGE + TOP_ACCELERATION) * lanes + j])
        mass = select(row[at.ELEMENTS * lanes + j] == 1.0, row[at.END_SHARE * lanes + j], 0.5) * rope_mass
        half = 0.5 * rope_weight * sinking
        intact = 1.0 - row[at.PARTED * lanes + j]
        top = larger(row[(at.STAGE + BELOW) * lanes + j] + intact * (half - mass * last), 0.0)
        row[at.TENSION * lanes + j] = top
        row[at.LOAD_TENSION * lanes + j] = larger(fma(0.5 * rope_mass, outward, bottom - half), 0.0)
        row[(at.STAGE + PEAK) * lanes + j] = larger(row[(at.STAGE + PEAK) * lanes + j], top)
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
    row: Array, source: int, target: int, end: int, fraction: float, weight: float, most: int, span: Span
) -> None:
    """Make one stage of the Runge-Kutta scheme: from the rates at ``source`` to the state at ``target``."""
    aim(row, source, end, span)
    _e0(row, source, target, fraction, weight, span)
    if most > 1:
        _e1(row, source, target, fraction, weight, span)
    if most > 2:
        _e2(row, source, target, fraction, weight, span)
    if most > 3:
        _e3(row, source, target, fraction, weight, span)
    if most > 4:
        _e4(row, source, target, fraction, weight, span)
        _e5(row, source, target, fraction, weight, span)
    if most > 6:
        _e6(row, source, target, fraction, weight, span)
        _e7(row, source, target, fraction, weight, span)
        _e8(row, source, target, fraction, weight, span)
    pull_load(row, source, target, end, fraction, weight, span)


@scalar
def lift_step(row: Array, most: int, span: Span) -> None:
    """Make one Runge-Kutta step of STEP_LENGTH with ropes of up to ``most`` elements, whose ends are in ENDS."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        row[(at.STAGE + PEAK) * lanes + j] = 0.0
        row[(at.STAGE + SLACKEST) * lanes + j] = math.inf
        row[(at.STAGE + COST) * lanes + j] = 0.0
    start, middle, end = at.ENDS, at.ENDS + at.END_SIZE, at.ENDS + 2 * at.END_SIZE
    stage(row, at.LIFT, at.LIFT_A, start, 0.5, 1.0, most, span)
    stage(row, at.LIFT_A, at.LIFT_B, middle, 0.5, 2.0, most, span)
    stage(row, at.LIFT_B, at.LIFT_A, middle, 1.0, 2.0, most, span)
    stage(row, at.LIFT_A, at.LIFT, end, 1.0, 1.0, most, span)


@scalar
def elements_of(row: Array, span: Span) -> tuple[int, int]:
    """Fewest and most elements of the block's ropes."""
    lanes = span.stride
    fewest, most = ELEMENTS_MOST, 0
    for j in range(span.begin, span.end):
        elements = int(row[at.ELEMENTS * lanes + j])
        fewest = elements if elements < fewest else fewest
        most = elements if elements > most else most
    return fewest, most
