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

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three
from aframe_env.dynamics.compensator import give
from aframe_env.dynamics.compiling import fma, larger, scalar, select, smaller
from aframe_env.dynamics.drive import drive_drum, place_drum
from aframe_env.dynamics.layout import SPRINGS_MOST, Span
from aframe_env.dynamics.lift import (
    AXIS,
    BELOW,
    COST,
    ELEMENT,
    GROUND,
    LEVER,
    LOAD_SHARE,
    MASS_LEVER,
    MASS_LEVER_SQUARED,
    PEAK,
    SLACKEST,
    SLIDE,
    SPEED,
    TOP_LOSS,
    TOP_STIFFNESS,
    Line,
    Pull,
    Rope,
    advance_slot,
    aim,
    divide,
)
from aframe_env.dynamics.wet_load import pull_load

Array = npt.NDArray[np.float64]


@scalar
def grip(row: Array, source: int, line: Line) -> Pull:
    """What the load's end of the rope tells its lowest spring."""
    return Pull(line.away, line.away_rate + line.pulley_speed, 0.0, 0.0, 0.0, math.inf, 0.0, 0.0, 0.0, 0.0)


@scalar
def spring(
    row: Array,
    i: int,
    source: int,
    target: int,
    fraction: float,
    weight: float,
    lanes: int,
    j: int,
    line: Line,
    rope: Rope,
    below: Pull,
) -> Pull:
    """Pull with spring i of the rope, from its load's end, and move the lump at its lower end (not the load)."""
    half = 0.5 if i == 0 else 1.0
    # Strain and speed change within a spring; at a lump each of its two springs counts by the other's length.
    upper_share = 1.0 / 3.0 if i == 1 else 0.5
    top_share = 0.5 if i == 1 else 2.0 / 3.0
    inside, top = rope.springs > i, rope.springs == i + 1
    place, speed = below.place, below.speed
    next_place, next_speed = row[(source + i + 1) * lanes + j], row[(source + SPEED + i + 1) * lanes + j]
    upper = select(top, rope.drum, next_place)
    upper_speed = select(top, line.pulley_speed + rope.fed, next_speed)
    stiffness = select(top, rope.top_stiffness, rope.stiffness / half)
    elongation = place - upper - select(top, rope.top_length, half * rope.element)
    loss_time = select(top, rope.top_loss, rope.loss_time)
    tension = larger(stiffness * fma(loss_time, speed - upper_speed, elongation), 0.0)
    highest = select(inside, tension, below.tension)
    least = smaller(below.least, select(inside, tension, below.least))
    if i == 0:
        return Pull(next_place, next_speed, speed, highest, tension, least, 0.0, 0.0, 0.0, 0.0)
    # Where the pulley is, the rope goes down with it and with what is paid out.
    upper_speed = select(top, line.pulley_speed + rope.paid_out, next_speed)
    upper_speed = fma(select(top, rope.softness * tension, 0.0), rope.paid_out, upper_speed)
    share = select(top, top_share, upper_share)
    strain = rope.softness * fma(share, tension - below.tension, below.tension)
    lower_slope = (speed - below.speed_below) * rope.inverse * (2.0 if i == 1 else 1.0)
    upper_slope = (upper_speed - speed) * rope.inverse * select(top, 2.0, 1.0)
    slope = fma(share, upper_slope - lower_slope, lower_slope)
    passing = (i - 0.5) * rope.passing
    lumps = rope.springs - 1.0
    # What the load carries for the lowest lump; so the sum of mass times place stays as it is.
    mass = fma(-2.0 * LOAD_SHARE, lumps / fma(2.0, lumps, -1.0), 1.0) if i == 1 else 1.0
    own = fma(rope.weight, -line.axis.z, -rope.drag * abs(speed) * speed)
    acceleration = rope.inverse_mass * fma(rope.element, own, below.tension - tension)
    if i == 1:
        acceleration /= mass
    turning = fma(place, line.turn_squared, line.carried)
    own_rate = speed - line.pulley_speed
    lever = select(inside, place * line.nearness, 0.0)
    lever_rate = fma(-lever, line.away_rate, own_rate)
    place_rate = select(inside, fma(-passing, 1.0 + strain, own_rate), 0.0)
    speed_rate = select(inside, fma(slope, passing, acceleration + turning), 0.0)
    advance_slot(row, i, place_rate, source, target, fraction, weight, lanes, j)
    advance_slot(row, SPEED + i, speed_rate, source, target, fraction, weight, lanes, j)
    return Pull(
        next_place,
        next_speed,
        speed,
        highest,
        below.bottom,
        least,
        below.lever + lever,
        below.mass_lever + mass * lever,
        below.mass_lever_squared + mass * lever * lever,
        below.mass_lever_rate + mass * lever * lever_rate,
    )


@scalar
def tell(row: Array, lanes: int, j: int, line: Line, rope: Rope, pull: Pull) -> None:
    """Write what the full model asks of a stage."""
    put_three(row, at.STAGE + AXIS, lanes, j, line.axis)
    row[(at.STAGE + ELEMENT) * lanes + j] = rope.element
    row[(at.STAGE + TOP_STIFFNESS) * lanes + j] = rope.top_stiffness
    row[(at.STAGE + TOP_LOSS) * lanes + j] = rope.top_loss
    row[(at.STAGE + SLIDE) * lanes + j] = rope.slide
    row[(at.STAGE + BELOW) * lanes + j] = pull.tension
    row[(at.STAGE + LEVER) * lanes + j] = pull.lever
    row[(at.STAGE + MASS_LEVER) * lanes + j] = pull.mass_lever
    row[(at.STAGE + MASS_LEVER_SQUARED) * lanes + j] = pull.mass_lever_squared


@scalar
def stage(
    row: Array,
    source: int,
    target: int,
    end: int,
    fraction: float,
    weight: float,
    most: int,
    span: Span,
) -> None:
    """Make one stage of the Runge-Kutta scheme: from the rates at ``source`` to the state at ``target``.

    Springs go by a loop within each lane, which is quick to compile.
    """
    lanes = span.stride
    place_drum(row, source, end, span)
    give(row, source, target, end, fraction, weight, span)
    for j in range(span.begin, span.end):
        line, rope = aim(row, source, end, lanes, j), divide(row, source, end, lanes, j)
        pull = grip(row, source, line)
        for i in range(most):
            pull = spring(row, i, source, target, fraction, weight, lanes, j, line, rope, pull)
        tell(row, lanes, j, line, rope, pull)
        pull_load(row, source, target, end, fraction, weight, lanes, j, line, rope, pull)
    drive_drum(row, source, target, end, fraction, weight, span)


@scalar
def wide_stage(
    row: Array, source: int, target: int, end: int, fraction: float, weight: float, most: int, span: Span
) -> None:
    """Do what ``stage`` does with springs by constant numbers: vectorised over the lanes, it takes long to compile.

    A spring beyond a rope's top does nothing; most ropes are chains of nine lumps or single springs.
    """
    lanes, s, t, f, w = span.stride, source, target, fraction, weight
    place_drum(row, source, end, span)
    give(row, source, target, end, fraction, weight, span)
    if most == 1:
        for j in range(span.begin, span.end):
            line, rope = aim(row, source, end, lanes, j), divide(row, source, end, lanes, j)
            pull = spring(row, 0, s, t, f, w, lanes, j, line, rope, grip(row, source, line))
            pull_load(row, source, target, end, fraction, weight, lanes, j, line, rope, pull)
    else:
        for j in range(span.begin, span.end):
            line, rope = aim(row, source, end, lanes, j), divide(row, source, end, lanes, j)
            pull = spring(row, 0, s, t, f, w, lanes, j, line, rope, grip(row, source, line))
            pull = spring(row, 1, s, t, f, w, lanes, j, line, rope, pull)
            pull = spring(row, 2, s, t, f, w, lanes, j, line, rope, pull)
            pull = spring(row, 3, s, t, f, w, lanes, j, line, rope, pull)
            pull = spring(row, 4, s, t, f, w, lanes, j, line, rope, pull)
            pull = spring(row, 5, s, t, f, w, lanes, j, line, rope, pull)
            pull = spring(row, 6, s, t, f, w, lanes, j, line, rope, pull)
            pull = spring(row, 7, s, t, f, w, lanes, j, line, rope, pull)
            pull = spring(row, 8, s, t, f, w, lanes, j, line, rope, pull)
            pull = spring(row, 9, s, t, f, w, lanes, j, line, rope, pull)
            pull_load(row, source, target, end, fraction, weight, lanes, j, line, rope, pull)
    drive_drum(row, source, target, end, fraction, weight, span)


@scalar
def lift_step(row: Array, most: int, wide: bool, span: Span) -> None:
    """Make one Runge-Kutta step of STEP_LENGTH with ropes of up to ``most`` springs, whose ends are in ENDS.

    ``wide``: all lanes of a block side by side.
    """
    lanes = span.stride
    for j in range(span.begin, span.end):
        row[(at.STAGE + PEAK) * lanes + j] = 0.0
        row[(at.STAGE + SLACKEST) * lanes + j] = math.inf
        row[(at.STAGE + COST) * lanes + j] = 0.0
        row[(at.STAGE + GROUND) * lanes + j] = 0.0
    start, middle, end = at.ENDS, at.ENDS + at.END_SIZE, at.ENDS + 2 * at.END_SIZE
    if wide:
        wide_stage(row, at.LIFT, at.LIFT_A, start, 0.5, 1.0, most, span)
        wide_stage(row, at.LIFT_A, at.LIFT_B, middle, 0.5, 2.0, most, span)
        wide_stage(row, at.LIFT_B, at.LIFT_A, middle, 1.0, 2.0, most, span)
        wide_stage(row, at.LIFT_A, at.LIFT, end, 1.0, 1.0, most, span)
    else:
        for k in range(4):
            source = at.LIFT if k == 0 else (at.LIFT_B if k == 2 else at.LIFT_A)
            target = at.LIFT if k == 3 else (at.LIFT_B if k == 1 else at.LIFT_A)
            upper = start if k == 0 else (end if k == 3 else middle)
            fraction = 0.5 if k < 2 else 1.0
            stage(row, source, target, upper, fraction, 2.0 if k == 1 or k == 2 else 1.0, most, span)


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
