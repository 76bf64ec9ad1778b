"""Inner steps of a block of rows: winch, rope, load, with the paper's rope and beyond it; what is measured of them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three, three
from aframe_env.dynamics.compiling import fma, larger, scalar, select
from aframe_env.dynamics.drive import exchange_drum, settle_drum, take_wanted
from aframe_env.dynamics.heavy_rope import lift_step, stage
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.lift import COST, END_TARGET, GROUND, PEAK, SLACKEST, put_end
from aframe_env.dynamics.load import Load, RopeEnd, load_constants, rk4_step, rope_pull
from aframe_env.dynamics.luffing import reach_on_path
from aframe_env.dynamics.motion import (
    pulley_acceleration_on_path,
    pulley_on_path,
)
from aframe_env.dynamics.target import move_target
from aframe_env.dynamics.winch import drum_state, middle_speed, next_error, plan

Array = npt.NDArray[np.float64]


@scalar
def plan_winch(row: Array, span: Span) -> None:
    """Limit the command and plan how the drum follows it over the segment."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        limit = row[at.MAX_SPEED * lanes + j]
        command = row[at.COMMAND * lanes + j]
        command = limit if command > limit else command
        command = -limit if command < -limit else command
        row[at.COMMAND * lanes + j] = command
        half_step = 0.5 * row[at.INNER_STEP * lanes + j]
        direction, ramp_time, error, first, error_there = plan(
            command,
            row[at.DRUM_SPEED * lanes + j],
            row[at.MAX_ACCELERATION * lanes + j],
            row[at.LAG * lanes + j],
            half_step,
        )
        row[at.WINCH * lanes + j] = direction
        row[(at.WINCH + 1) * lanes + j] = ramp_time
        row[(at.WINCH + 2) * lanes + j] = error
        row[(at.WINCH + 3) * lanes + j] = first
        row[(at.WINCH + 4) * lanes + j] = error_there
        row[(at.WINCH + 5) * lanes + j] = row[at.DRUM_ANGLE * lanes + j]
        row[(at.WINCH + 6) * lanes + j] = row[at.DRUM_SPEED * lanes + j]


@scalar
def drum_at(row: Array, lanes: int, j: int, elapsed: float, error: float) -> tuple[float, float]:
    """Drum angle and speed of lane j, ``elapsed`` s into the segment."""
    return drum_state(
        elapsed,
        row[(at.WINCH + 5) * lanes + j],
        row[(at.WINCH + 6) * lanes + j],
        row[at.COMMAND * lanes + j],
        row[at.MAX_ACCELERATION * lanes + j],
        row[at.LAG * lanes + j],
        row[at.WINCH * lanes + j],
        row[(at.WINCH + 1) * lanes + j],
        row[(at.WINCH + 2) * lanes + j],
        error,
        row[at.MIN_ANGLE * lanes + j],
        row[at.MAX_ANGLE * lanes + j],
    )


@scalar
def begin_load(row: Array, span: Span) -> None:
    """Write the constants of load and rope for the inner steps of a segment."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        row[at.INVERSE_MASS * lanes + j] = 1.0 / row[at.MASS * lanes + j]
        length = fma(row[at.DRUM_RADIUS * lanes + j], row[at.DRUM_ANGLE * lanes + j], row[at.FREE_LENGTH * lanes + j])
        row[at.STIFFNESS * lanes + j] = row[at.AXIAL_STIFFNESS * lanes + j] / length


@scalar
def rope_ends(row: Array, index: int, active: bool, lanes: int, j: int) -> tuple[RopeEnd, RopeEnd, RopeEnd]:
    """Turn lane j's drum over inner step ``index``: the rope's upper end at its start, middle and end."""
    full = row[at.INNER_STEP * lanes + j]
    # A lane whose segment is over finds drum and pulley where they are.
    place = select(active, index, row[at.SUBSTEPS * lanes + j] - 1.0)
    middle, end = (place + 0.5) * full, place * full + full
    error0 = row[(at.WINCH + 4) * lanes + j]
    first, decay = row[(at.WINCH + 3) * lanes + j], row[at.HALF_STEP_DECAY * lanes + j]
    error1 = next_error(error0, 2.0 * index + 1.0, first, decay)
    error2 = select(active, next_error(error1, 2.0 * index + 2.0, first, decay), error0)
    radius, free_length = row[at.DRUM_RADIUS * lanes + j], row[at.FREE_LENGTH * lanes + j]
    angle0, speed0 = row[at.DRUM_ANGLE * lanes + j], row[at.DRUM_SPEED * lanes + j]
    angle1, _ = drum_at(row, lanes, j, middle, error1)
    angle2, speed2 = drum_at(row, lanes, j, end, error2)
    speed1 = middle_speed(angle0, speed0, angle2, speed2, full)
    row[(at.WINCH + 4) * lanes + j] = error2
    row[at.DRUM_ANGLE * lanes + j] = angle2
    row[at.DRUM_SPEED * lanes + j] = speed2
    length0 = fma(radius, angle0, free_length)
    length1, length2 = fma(radius, angle1, free_length), fma(radius, angle2, free_length)
    # One division for both; the stiffness at the start is the end's of the inner step before.
    share = row[at.AXIAL_STIFFNESS * lanes + j] / (length1 * length2)
    stiffness0, stiffness1, stiffness2 = row[at.STIFFNESS * lanes + j], share * length2, share * length1
    row[at.STIFFNESS * lanes + j] = stiffness2
    intact = 1.0 - row[at.PARTED * lanes + j]
    since_node = row[at.ELAPSED * lanes + j]
    pulley1, pulley_rate1 = pulley_on_path(row, since_node + middle, lanes, j)
    pulley2, pulley_rate2 = pulley_on_path(row, since_node + end, lanes, j)
    pulley0, pulley_rate0 = three(row, at.PULLEY, lanes, j), three(row, at.PULLEY + 3, lanes, j)
    put_three(row, at.PULLEY, lanes, j, pulley2)
    put_three(row, at.PULLEY + 3, lanes, j, pulley_rate2)
    return (
        RopeEnd(pulley0, pulley_rate0, length0, radius * speed0, intact * stiffness0),
        RopeEnd(pulley1, pulley_rate1, length1, radius * speed1, intact * stiffness1),
        RopeEnd(pulley2, pulley_rate2, length2, radius * speed2, intact * stiffness2),
    )


@scalar
def keep_figures(row: Array, lanes: int, j: int, active: bool, cost: float, peak: float, slack: bool) -> None:
    """Add an inner step to lane j's figures: its cost, how far off the load is, peak tension, slackness, parting."""
    row[at.STEP_COST * lanes + j] += cost
    # What is never negative is taken by its magnitude, PARTED through its complement: these are the same numbers,
    # but the compiler would see that a store changes nothing and leave it out in some lanes, as in ``select``.
    error = row[(at.LOAD_POSITION + 2) * lanes + j] - row[at.TARGET * lanes + j]
    row[at.OMEGA2 * lanes + j] = larger(abs(error), abs(row[at.OMEGA2 * lanes + j]))
    # A lane that stands still has met its pulley and drum beyond the segment: what it felt there is no tension.
    row[at.SLACK * lanes + j] = larger(select(active & slack, 1.0, 0.0), abs(row[at.SLACK * lanes + j]))
    peak = select(active, peak, 0.0)
    row[at.PEAK_TENSION * lanes + j] = larger(peak, abs(row[at.PEAK_TENSION * lanes + j]))
    intact = 1.0 - row[at.PARTED * lanes + j]
    row[at.PARTED * lanes + j] = 1.0 - select(peak > row[at.BREAKING_LOAD * lanes + j], 0.0, intact)


@scalar
def inner_step(row: Array, index: int, span: Span) -> None:
    """Make inner step ``index`` of the segment in every lane that has so many (the others stand still)."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        active = index < row[at.SUBSTEPS * lanes + j]
        start, middle, end = rope_ends(row, index, active, lanes, j)
        target, intact = row[at.TARGET * lanes + j], 1.0 - row[at.PARTED * lanes + j]
        load, cost, peak = rk4_step(
            Load(three(row, at.LOAD_POSITION, lanes, j), three(row, at.LOAD_VELOCITY, lanes, j)),
            start,
            middle,
            end,
            select(active, row[at.INNER_STEP * lanes + j], 0.0),
            target,
            load_constants(row, intact, lanes, j),
        )
        put_three(row, at.LOAD_POSITION, lanes, j, load.position)
        put_three(row, at.LOAD_VELOCITY, lanes, j, load.velocity)
        keep_figures(row, lanes, j, active, cost, peak, peak <= 0.0)


@scalar
def meet_bed(row: Array, span: Span) -> None:
    """Count landings and lift-offs of an inner step that has been made, and keep the seabed's greatest force."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        force = select(row[at.STEP_LENGTH * lanes + j] > 0.0, row[(at.STAGE + GROUND) * lanes + j], 0.0)
        row[at.CONTACT * lanes + j] = larger(force, abs(row[at.CONTACT * lanes + j]))
        bottom = row[(at.LOAD_POSITION + 2) * lanes + j] - row[at.HALF_HEIGHT * lanes + j]
        before, now = row[at.ON_BED * lanes + j], select(bottom < row[at.BED * lanes + j], 1.0, 0.0)
        landed = now > before
        row[at.LANDINGS * lanes + j] += select(landed, 1.0, 0.0)
        row[at.LIFT_OFFS * lanes + j] += select(now < before, 1.0, 0.0)
        speed = select(landed, -row[(at.LOAD_VELOCITY + 2) * lanes + j], 0.0)
        row[at.LANDING_SPEED * lanes + j] = larger(speed, abs(row[at.LANDING_SPEED * lanes + j]))
        row[at.ON_BED * lanes + j] = now


@scalar
def put_end_on_path(row: Array, slot: int, lanes: int, j: int, end: RopeEnd, since_node: float) -> None:
    """Write the rope's upper ``end`` to ENDS, and what goes with it ``since_node`` s after the node before."""
    acceleration = pulley_acceleration_on_path(row, since_node, lanes, j)
    put_end(row, slot, lanes, j, end, acceleration, reach_on_path(row, since_node, lanes, j))


@scalar
def heavy_inner_step(row: Array, index: int, most: int, wide: bool, span: Span) -> None:
    """Make inner step ``index`` in lanes whose ropes have mass or whose loads are in water, as ``inner_step`` does."""
    lanes = span.stride
    exchange_drum(row, span)
    for j in range(span.begin, span.end):
        active = index < row[at.SUBSTEPS * lanes + j]
        full, since_node = row[at.INNER_STEP * lanes + j], row[at.ELAPSED * lanes + j]
        place = since_node + full * select(active, index, row[at.SUBSTEPS * lanes + j] - 1.0)
        start, middle, end = rope_ends(row, index, active, lanes, j)
        put_end_on_path(row, at.ENDS, lanes, j, start, place)
        put_end_on_path(row, at.ENDS + at.END_SIZE, lanes, j, middle, place + 0.5 * full)
        put_end_on_path(row, at.ENDS + 2 * at.END_SIZE, lanes, j, end, place + full)
        row[at.STEP_LENGTH * lanes + j] = select(active, full, 0.0)
        row[at.MOMENT * lanes + j] = place + 0.5 * full - since_node
    take_wanted(row, span)
    exchange_drum(row, span)
    move_target(row, span)
    lift_step(row, most, wide, span)
    settle_drum(row, span)
    meet_bed(row, span)
    for j in range(span.begin, span.end):
        step = row[at.STEP_LENGTH * lanes + j]
        row[at.TARGET * lanes + j] = row[(at.ENDS + 2 * at.END_SIZE + END_TARGET) * lanes + j]
        cost = step * (1.0 / 6.0) * row[(at.STAGE + COST) * lanes + j]
        slack = row[(at.STAGE + SLACKEST) * lanes + j] <= 0.0
        keep_figures(row, lanes, j, step > 0.0, cost, row[(at.STAGE + PEAK) * lanes + j], slack)


@scalar
def measure_heavy(row: Array, most: int, span: Span) -> None:
    """Measure tensions and slackness of lanes whose ropes have mass at their present state."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        radius = row[at.DRUM_RADIUS * lanes + j]
        length = fma(radius, row[at.DRUM_ANGLE * lanes + j], row[at.FREE_LENGTH * lanes + j])
        position, velocity = three(row, at.PULLEY, lanes, j), three(row, at.PULLEY + 3, lanes, j)
        end = RopeEnd(position, velocity, length, radius * row[at.DRUM_SPEED * lanes + j], 0.0)
        since_node = row[at.ELAPSED * lanes + j] + row[at.CONTROL_PERIOD * lanes + j]
        reach = reach_on_path(row, since_node, lanes, j)
        put_end(row, at.ENDS, lanes, j, end, three(row, at.PULLEY + 6, lanes, j), reach)
        row[at.WANTED * lanes + j] = row[at.SET_SPEED * lanes + j]
        row[at.STEP_LENGTH * lanes + j] = 0.0
        row[(at.STAGE + SLACKEST) * lanes + j] = 1.0
        # What the water does has been followed to the middle of the last inner step; it goes on to its end.
        row[at.MOMENT * lanes + j] = select(row[at.MOMENT * lanes + j] > 0.0, row[at.CONTROL_PERIOD * lanes + j], 0.0)
    stage(row, at.LIFT, at.LIFT_A, at.ENDS, 0.5, 1.0, most, span)
    for j in range(span.begin, span.end):
        slack = row[(at.STAGE + SLACKEST) * lanes + j] <= 0.0
        row[at.SLACK * lanes + j] = 1.0 if slack else row[at.SLACK * lanes + j]


@scalar
def measure_tension(row: Array, span: Span) -> None:
    """Measure the rope tension at the row's present state, and whether the rope is slack."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        radius = row[at.DRUM_RADIUS * lanes + j]
        length = fma(radius, row[at.DRUM_ANGLE * lanes + j], row[at.FREE_LENGTH * lanes + j])
        intact = 1.0 - row[at.PARTED * lanes + j]
        pull = rope_pull(
            Load(three(row, at.LOAD_POSITION, lanes, j), three(row, at.LOAD_VELOCITY, lanes, j)),
            RopeEnd(
                three(row, at.PULLEY, lanes, j),
                three(row, at.PULLEY + 3, lanes, j),
                length,
                radius * row[at.DRUM_SPEED * lanes + j],
                intact * row[at.AXIAL_STIFFNESS * lanes + j] / length,
            ),
            load_constants(row, intact, lanes, j),
        ).force
        row[at.TENSION * lanes + j] = larger(pull, 0.0)
        row[at.SLACK * lanes + j] = 1.0 if pull <= 0.0 else row[at.SLACK * lanes + j]
