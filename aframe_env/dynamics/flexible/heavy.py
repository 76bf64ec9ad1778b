"""What goes beyond the paper, ropes with mass, water and the like, below the head of the flexible frame.

Over an inner step the head's path is a cubic through where it was and where the rope's force at the end takes it; along
it ``dynamics.heavy_rope`` makes one Runge-Kutta step. The tension that comes out, eased by what the head gives way to
it, is the next pass's force: two passes, as what is left falls to a few hundredths with each.

The head answers the force as one that goes along a straight line. On it pull the rope to the drum and that to the
load, with one tension, and what the lumps, held on the line, hand on to it across the line: weight, drag, inertia by
the lever rule. The head's own vibration has no part in that inertia: a rope, unlike a rod, would not follow it
sideways. The Coriolis force on the lumps, some 1e-4 of the tension, acts on the load alone.

Rope that goes over S as the deflected head comes nearer to the drum is written to ENDS as if the drum had paid it out;
ENDS have the distance from drum to pulley at rest, and what luffing adds to it. The end of a step in ENDS is where the
next one starts. A drum with inertia turns within the Runge-Kutta step, in each pass anew.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics import start
from aframe_env.dynamics.blocks import nine, put_three, three
from aframe_env.dynamics.compiling import larger, scalar, select
from aframe_env.dynamics.drive import exchange_drum, hold_load, settle_drum, want
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.deck import deck_now
from aframe_env.dynamics.flexible.rope import apply, apply_transposed, unit
from aframe_env.dynamics.flexible.start import put_below, release, rest
from aframe_env.dynamics.heavy_rope import lift_step, stage
from aframe_env.dynamics.inner_step import drum_at, keep_figures, meet_bed
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.lift import (
    AXIS,
    BELOW,
    COST,
    ELEMENT,
    END_ACCELERATION,
    END_OVER,
    END_REACH,
    END_TARGET,
    END_VELOCITY,
    LEVER,
    LOAD_SHARE,
    MASS_LEVER,
    MASS_LEVER_SQUARED,
    SLACKEST,
    SLIDE,
    SPEED,
    TOP_LOSS,
    TOP_STIFFNESS,
    VELOCITY,
    put_end,
)
from aframe_env.dynamics.load import RopeEnd
from aframe_env.dynamics.target import move_target
from aframe_env.dynamics.vector import Vector, add, along, cross, difference, inner, scaled
from aframe_env.dynamics.winch import middle_speed, next_error

Array = npt.NDArray[np.float64]

PASSES: Final = 2
START: Final = at.ENDS
MIDDLE: Final = at.ENDS + at.END_SIZE
END: Final = at.ENDS + 2 * at.END_SIZE

_hang_rope = scalar(start.hang_rope)


class RopeOut(NamedTuple):
    """Rope between drum and load."""

    length: float
    """Unstretched, m."""
    speed: float
    """Rate of that length, m/s."""


@scalar
def put_head(row: Array, frame: Array, shift: Vector, rate: Vector, drum: RopeOut, lanes: int, j: int) -> None:
    """Write END, with S displaced by ``shift`` [m] at ``rate`` [m/s] along {D}, and what the ``drum`` has out."""
    pulley = add(three(frame, flex.PULLEY, lanes, j), shift)
    inboard, to_drum = unit(difference(three(frame, flex.DRUM, lanes, j), pulley))
    turned = nine(frame, flex.ROTATION, lanes, j)
    place = add(three(frame, flex.ORIGIN, lanes, j), apply(turned, pulley))
    turning = add(cross(three(frame, flex.SPIN, lanes, j), pulley), rate)
    velocity = add(three(frame, flex.ORIGIN + 3, lanes, j), apply(turned, turning))
    felt = difference(apply(nine(frame, flex.INPUT + 3, lanes, j), pulley), three(frame, flex.INPUT, lanes, j))
    acceleration = add(apply(turned, felt), Vector(0.0, 0.0, -row[at.GRAVITY * lanes + j]))
    reach, reach_rate, over_rate = row[at.DRUM_TO_PULLEY * lanes + j], 0.0, inner(to_drum, rate)
    # Where no frame luffs, slots that are not read cost nothing.
    if row[at.LUFFING_POINTS * lanes + j] > 0.0:
        reach += frame[flex.REACHED * lanes + j]
        reach_rate = frame[(flex.REACHED + 1) * lanes + j]
        over_rate += reach_rate - inner(to_drum, three(frame, flex.DRUM_RATE, lanes, j))
    length, speed = drum.length + (reach - inboard), drum.speed + over_rate
    put_end(row, END, lanes, j, RopeEnd(place, velocity, length, speed, 0.0), acceleration, (reach, reach_rate))
    put_over(row, END, length - drum.length, speed - drum.speed, lanes, j)


@scalar
def put_over(row: Array, slot: int, length: float, rate: float, lanes: int, j: int) -> None:
    """Write to ENDS the rope that goes over S as the head comes nearer to the drum, m, and its rate, m/s."""
    row[(slot + END_OVER) * lanes + j] = length
    row[(slot + END_OVER + 1) * lanes + j] = rate


@scalar
def halfway(before: float, rate: float, after: float, rate_after: float, h: float) -> tuple[float, float]:
    """Value and rate in the middle of a cubic over ``h`` s."""
    return (
        0.5 * (before + after) + 0.125 * h * (rate - rate_after),
        1.5 * (after - before) / h - 0.25 * (rate + rate_after),
    )


@scalar
def put_middle(row: Array, drum: RopeOut, h: float, lanes: int, j: int) -> None:
    """Write MIDDLE between START and END; ``drum``: what the drum has out."""
    position, velocity = three(row, START, lanes, j), three(row, START + END_VELOCITY, lanes, j)
    position_after, velocity_after = three(row, END, lanes, j), three(row, END + END_VELOCITY, lanes, j)
    x, u = halfway(position.x, velocity.x, position_after.x, velocity_after.x, h)
    y, v = halfway(position.y, velocity.y, position_after.y, velocity_after.y, h)
    z, w = halfway(position.z, velocity.z, position_after.z, velocity_after.z, h)
    over, over_rate = halfway(
        row[(START + END_OVER) * lanes + j],
        row[(START + END_OVER + 1) * lanes + j],
        row[(END + END_OVER) * lanes + j],
        row[(END + END_OVER + 1) * lanes + j],
        h,
    )
    put_over(row, MIDDLE, over, over_rate, lanes, j)
    middle = RopeEnd(Vector(x, y, z), Vector(u, v, w), drum.length + over, drum.speed + over_rate, 0.0)
    both = add(three(row, START + END_ACCELERATION, lanes, j), three(row, END + END_ACCELERATION, lanes, j))
    reach = row[at.DRUM_TO_PULLEY * lanes + j], 0.0
    if row[at.LUFFING_POINTS * lanes + j] > 0.0:
        reach = halfway(
            row[(START + END_REACH) * lanes + j],
            row[(START + END_REACH + 1) * lanes + j],
            row[(END + END_REACH) * lanes + j],
            row[(END + END_REACH + 1) * lanes + j],
            h,
        )
    put_end(row, MIDDLE, lanes, j, middle, scaled(0.5, both), reach)


@scalar
def handed_up(row: Array, lanes: int, j: int) -> Vector:
    """Force across the line that the lumps hand on to the pulley, N, once a stage has been made from LIFT with END."""
    axis, lumps = three(row, at.STAGE + AXIS, lanes, j), row[at.SPRINGS * lanes + j] - 1.0
    if lumps < 1.0:
        return Vector(0.0, 0.0, 0.0)
    element = row[(at.STAGE + ELEMENT) * lanes + j]
    rope_mass = row[at.ROPE_MASS * lanes + j] * element
    # As many elements as there are lumps, but for what the load carries of the lowest.
    masses = lumps - 2.0 * LOAD_SHARE * lumps / (2.0 * lumps - 1.0)
    levers, squared = row[(at.STAGE + MASS_LEVER) * lanes + j], row[(at.STAGE + MASS_LEVER_SQUARED) * lanes + j]
    # Where a stage starts from LIFT, the load's acceleration is all of the sum.
    load, pulley = three(row, at.LIFT_SUM + VELOCITY, lanes, j), three(row, END + END_ACCELERATION, lanes, j)
    force = three(row, at.PUSH + 3, lanes, j)
    force = along(force, -rope_mass * (masses - 2.0 * levers + squared), pulley)
    force = along(force, -rope_mass * (levers - squared), load)
    weight = row[at.ROPE_WEIGHT * lanes + j] * element * (lumps - row[(at.STAGE + LEVER) * lanes + j])
    force = add(force, Vector(0.0, 0.0, -weight))
    return along(force, -inner(axis, force), axis)


@scalar
def directions(row: Array, frame: Array, shift: Vector, on_drum: float, lanes: int, j: int) -> Vector:
    """Unit vector from S to the load and ``on_drum`` times that to the drum, along {D}; S displaced by ``shift``."""
    pulley = add(three(frame, flex.PULLEY, lanes, j), shift)
    _, to_drum = unit(difference(three(frame, flex.DRUM, lanes, j), pulley))
    return add(
        apply_transposed(nine(frame, flex.ROTATION, lanes, j), three(row, at.STAGE + AXIS, lanes, j)),
        scaled(on_drum, to_drum),
    )


@scalar
def tension_beyond(row: Array, lanes: int, j: int) -> float:
    """Tension at the pulley above that of its spring: half the weight of a rope without lumps, N."""
    beyond: float = (1.0 - row[at.PARTED * lanes + j]) * row[at.HALF_WEIGHT * lanes + j]
    return beyond


@scalar
def head_force(row: Array, frame: Array, table: Array, shift: Vector, force: Vector, lanes: int, j: int) -> Vector:
    """Force on S along {D}, better than ``force``, with which S was displaced by ``shift`` in the stage just made.

    The load and the lumps stay, and S gives way: the spring over S solves its law for that.
    """
    slide = row[(at.STAGE + SLIDE) * lanes + j]
    a, pulls = directions(row, frame, shift, 1.0, lanes, j), directions(row, frame, shift, slide, lanes, j)
    stiffness, loss_time = row[(at.STAGE + TOP_STIFFNESS) * lanes + j], row[(at.STAGE + TOP_LOSS) * lanes + j]
    eased = apply_transposed(nine(table, flex.GIVE + 18, 1, 0), a)
    eased = along(eased, loss_time, apply_transposed(nine(table, flex.GIVE_RATE + 18, 1, 0), a))
    eased = scaled(stiffness, eased)
    across = apply_transposed(nine(frame, flex.ROTATION, lanes, j), handed_up(row, lanes, j))
    beyond, pull = tension_beyond(row, lanes, j), row[(at.STAGE + BELOW) * lanes + j]
    others = along(across, beyond, pulls)
    solved = (pull + inner(eased, difference(force, others))) / (1.0 + inner(eased, pulls))
    # How slack a rope is that does not pull is not known; the next pass finds it with S where nothing pulls.
    solved = select(pull > 0.0, larger(solved, 0.0), 0.0)
    row[at.TENSION * lanes + j] = slide * (solved + beyond)
    return along(others, solved, pulls)


@scalar
def step_heavy_rope(row: Array, frame: Array, table: Array, index: int, span: Span) -> None:
    """Bring drum, rope and load of the span's one lane to the end of inner step ``index``, and find the force on S."""
    h, lanes, j = table[flex.STEP], span.stride, span.begin
    springs = int(row[at.SPRINGS * lanes + j])
    tip, tip_rate = three(frame, flex.TIP, lanes, j), three(frame, flex.TIP + 3, lanes, j)
    give, give_rate = nine(table, flex.GIVE + 18, 1, 0), nine(table, flex.GIVE_RATE + 18, 1, 0)
    for k in range(at.END_SIZE):
        row[(START + k) * lanes + j] = row[(END + k) * lanes + j]
    # Where a drum has inertia, only ``want`` is told of the one that goes as it is told: stages place the real one.
    exchange_drum(row, span)
    middle, end = turn_drum(row, index, h, lanes, j)
    exchange_drum(row, span)
    for k in range(at.LIFT_SIZE):
        frame[(flex.HELD + k) * lanes + j] = row[(at.LIFT + k) * lanes + j]
    row[at.STEP_LENGTH * lanes + j] = h
    row[at.MOMENT * lanes + j] = (index + 0.5) * h
    force = three(frame, flex.PULL, lanes, j)
    shift = tip
    for _ in range(PASSES):
        for k in range(at.LIFT_SIZE):
            row[(at.LIFT + k) * lanes + j] = frame[(flex.HELD + k) * lanes + j]
        shift = add(tip, apply(give, force))
        put_head(row, frame, shift, add(tip_rate, apply(give_rate, force)), end, lanes, j)
        put_middle(row, middle, h, lanes, j)
        move_target(row, span)
        lift_step(row, springs, False, span)
        settle_drum(row, span)
        stage(row, at.LIFT, at.LIFT_A, END, 0.5, 0.0, springs, span)
        force = head_force(row, frame, table, shift, force, lanes, j)
    # The lumps stay where they are while S gives way to the last pass's force.
    given = difference(add(tip, apply(give, force)), shift)
    axis = three(row, at.STAGE + AXIS, lanes, j)
    down = inner(axis, apply(nine(frame, flex.ROTATION, lanes, j), given))
    for i in range(1, springs):
        row[(at.LIFT + i) * lanes + j] -= down
    put_head(row, frame, add(shift, given), add(tip_rate, apply(give_rate, force)), end, lanes, j)
    put_three(frame, flex.PULL, lanes, j, force)
    move_target(row, span)
    row[at.TARGET * lanes + j] = row[(END + END_TARGET) * lanes + j]
    meet_bed(row, span)
    cost = h / 6.0 * row[(at.STAGE + COST) * lanes + j]
    slack = row[(at.STAGE + SLACKEST) * lanes + j] <= 0.0
    keep_figures(row, lanes, j, True, cost, row[at.TENSION * lanes + j], slack)


@scalar
def turn_drum(row: Array, index: int, h: float, lanes: int, j: int) -> tuple[RopeOut, RopeOut]:
    """Turn the drum over inner step ``index``: rope that it has out in its middle and at its end."""
    first, decay = row[(at.WINCH + 3) * lanes + j], row[at.HALF_STEP_DECAY * lanes + j]
    radius, free = row[at.DRUM_RADIUS * lanes + j], row[at.FREE_LENGTH * lanes + j]
    angle0, speed0 = row[at.DRUM_ANGLE * lanes + j], row[at.DRUM_SPEED * lanes + j]
    error1 = next_error(row[(at.WINCH + 4) * lanes + j], 2.0 * index + 1.0, first, decay)
    error2 = next_error(error1, 2.0 * index + 2.0, first, decay)
    angle1, _ = drum_at(row, lanes, j, (index + 0.5) * h, error1)
    angle2, speed2 = drum_at(row, lanes, j, (index + 1.0) * h, error2)
    row[(at.WINCH + 4) * lanes + j] = error2
    row[at.DRUM_ANGLE * lanes + j] = angle2
    row[at.DRUM_SPEED * lanes + j] = speed2
    middle = RopeOut(free + radius * angle1, radius * middle_speed(angle0, speed0, angle2, speed2, h))
    end = RopeOut(free + radius * angle2, radius * speed2)
    want(row, radius * speed0, middle.speed, end.speed, lanes, j)
    return middle, end


@scalar
def start_heavy_rows(row: Array, frame: Array, tables: Array, comoving: float, lanes: int) -> None:
    """Do what ``start.start_rows`` does where ropes have mass or loads are in water."""
    deck_now(row, frame, lanes)
    for j in range(lanes):
        table = tables[int(frame[flex.FRAME * lanes + j])]
        deflection = rest_heavy(row, frame, table, lanes, j)
        hang(row, frame, deflection, comoving, lanes, j)
        measure(row, frame, deflection, Span(lanes, j, j + 1))
        hold_load(row, END, Span(lanes, j, j + 1))
        release(frame, table, lanes, j)


@scalar
def rest_heavy(row: Array, frame: Array, table: Array, lanes: int, j: int) -> Vector:
    """Put the modes at rest, and the rope's part from drum to pulley; return the deflection of S."""
    deflection = Vector(0.0, 0.0, 0.0)
    for _ in range(2):
        # The second time with the rope that the deflection leaves below the pulley.
        below = row[at.FREE_LENGTH * lanes + j] - row[at.DRUM_PART * lanes + j]
        chain = select(row[at.SPRINGS * lanes + j] > 1.0, row[at.ROPE_WEIGHT * lanes + j] * below, 0.0)
        tension = row[at.LOAD_WEIGHT * lanes + j] + row[at.HALF_WEIGHT * lanes + j] + chain
        deflection = rest(row, frame, table, tension, lanes, j)
        pulley = add(three(frame, flex.PULLEY, lanes, j), deflection)
        inboard, _ = unit(difference(three(frame, flex.DRUM, lanes, j), pulley))
        row[at.DRUM_PART * lanes + j] *= inboard / row[at.DRUM_TO_PULLEY * lanes + j]
        row[at.DRUM_TO_PULLEY * lanes + j] = inboard
    return deflection


@scalar
def hang(row: Array, frame: Array, deflection: Vector, comoving: float, lanes: int, j: int) -> None:
    """Hang lumps and load below S by the rope that their weight stretches, at rest or with the velocity of S."""
    springs = int(row[at.SPRINGS * lanes + j])
    _hang_rope(row, lanes, j, False)
    unstretched = row[at.FREE_LENGTH * lanes + j]
    above = -row[at.DRUM_TO_PULLEY * lanes + j]
    if springs > 1:
        unstretched = 0.5 * (unstretched - row[at.DRUM_PART * lanes + j]) / (springs - 1)
        above = row[(at.LIFT + 1) * lanes + j]
    strain = row[at.LOAD_WEIGHT * lanes + j] / row[at.AXIAL_STIFFNESS * lanes + j]
    pulley = add(three(frame, flex.PULLEY, lanes, j), deflection)
    velocity = put_below(row, frame, pulley, above + unstretched * (1.0 + strain), comoving, lanes, j)
    for i in range(1, springs):
        row[(at.LIFT + SPEED + i) * lanes + j] = -comoving * velocity.z


@scalar
def measure(row: Array, frame: Array, deflection: Vector, span: Span) -> None:
    """Measure the rope's tensions and its force on S at the start, in the span's one lane."""
    lanes, j = span.stride, span.begin
    springs = int(row[at.SPRINGS * lanes + j])
    put_head(row, frame, deflection, Vector(0.0, 0.0, 0.0), RopeOut(row[at.FREE_LENGTH * lanes + j], 0.0), lanes, j)
    row[at.STEP_LENGTH * lanes + j] = 0.0
    row[(at.STAGE + SLACKEST) * lanes + j] = 1.0
    stage(row, at.LIFT, at.LIFT_A, END, 0.5, 0.0, springs, span)
    tension = row[at.TENSION * lanes + j]
    across = apply_transposed(nine(frame, flex.ROTATION, lanes, j), handed_up(row, lanes, j))
    put_three(frame, flex.PULL, lanes, j, along(across, tension, directions(row, frame, deflection, 1.0, lanes, j)))
    row[at.PEAK_TENSION * lanes + j] = tension
    row[at.SLACK * lanes + j] = 1.0 if row[(at.STAGE + SLACKEST) * lanes + j] <= 0.0 else 0.0
