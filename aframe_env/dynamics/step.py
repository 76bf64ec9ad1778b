"""One control step of a block of rows: deck, winch, load. The kernels that every face of the package calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import prange

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import fma, kernel, parallel_kernel, scalar
from aframe_env.dynamics.integrator import RopeEnd, rk4_step
from aframe_env.dynamics.layout import LANES, Span
from aframe_env.dynamics.motion import advance_motion, deck_coordinate, end_motion, on_path, start_motion
from aframe_env.dynamics.simplified import load_acceleration
from aframe_env.dynamics.winch import drum_state, next_error, plan

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
def rope_end(row: Array, lanes: int, j: int, elapsed: float, error: float) -> tuple[RopeEnd, float, float]:
    """Upper end of lane j's rope ``elapsed`` s into the segment, and the drum's angle and speed."""
    angle, speed = drum_at(row, lanes, j, elapsed, error)
    t = row[at.ELAPSED * lanes + j] + elapsed
    s1, d1 = on_path(row, 0, t, lanes, j)
    s2, d2 = on_path(row, 1, t, lanes, j)
    s3, d3 = on_path(row, 2, t, lanes, j)
    radius = row[at.DRUM_RADIUS * lanes + j]
    length = fma(radius, angle, row[at.FREE_LENGTH * lanes + j])
    stiffness = row[at.AXIAL_STIFFNESS * lanes + j] / length
    return (s1, s2, s3, d1, d2, d3, length, radius * speed, stiffness), angle, speed


@scalar
def inner_step(row: Array, index: int, span: Span) -> None:
    """Inner step number ``index`` of the segment, for every lane that has so many (the others stand still)."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        active = index < row[at.SUBSTEPS * lanes + j]
        full = row[at.INNER_STEP * lanes + j]
        begin = index * full
        error0 = row[(at.WINCH + 4) * lanes + j]
        first, decay = row[(at.WINCH + 3) * lanes + j], row[at.HALF_STEP_DECAY * lanes + j]
        error1 = next_error(error0, 2.0 * index + 1.0, first, decay)
        error2 = next_error(error1, 2.0 * index + 2.0, first, decay)
        radius, angle0, speed0 = (
            row[at.DRUM_RADIUS * lanes + j],
            row[at.DRUM_ANGLE * lanes + j],
            row[at.DRUM_SPEED * lanes + j],
        )
        t1, t2, t3 = row[at.PULLEY * lanes + j], row[(at.PULLEY + 1) * lanes + j], row[(at.PULLEY + 2) * lanes + j]
        t4, t5, t6 = (
            row[(at.PULLEY + 3) * lanes + j],
            row[(at.PULLEY + 4) * lanes + j],
            row[(at.PULLEY + 5) * lanes + j],
        )
        length0 = fma(radius, angle0, row[at.FREE_LENGTH * lanes + j])
        start = (t1, t2, t3, t4, t5, t6, length0, radius * speed0, row[at.AXIAL_STIFFNESS * lanes + j] / length0)
        middle, _, _ = rope_end(row, lanes, j, begin + 0.5 * full, error1)
        end, angle2, speed2 = rope_end(row, lanes, j, begin + full, error2)
        x1, x2, x3 = (
            row[at.LOAD_POSITION * lanes + j],
            row[(at.LOAD_POSITION + 1) * lanes + j],
            row[(at.LOAD_POSITION + 2) * lanes + j],
        )
        v1, v2, v3 = (
            row[at.LOAD_VELOCITY * lanes + j],
            row[(at.LOAD_VELOCITY + 1) * lanes + j],
            row[(at.LOAD_VELOCITY + 2) * lanes + j],
        )
        parted, target = row[at.PARTED * lanes + j], row[at.TARGET * lanes + j]
        intact = 1.0 - parted
        x1, x2, x3, v1, v2, v3, cost, peak = rk4_step(
            x1,
            x2,
            x3,
            v1,
            v2,
            v3,
            (*start[:8], intact * start[8]),
            (*middle[:8], intact * middle[8]),
            (*end[:8], intact * end[8]),
            full if active else 0.0,
            target,
            row[at.DRUM_TO_PULLEY * lanes + j],
            intact * row[at.ROPE_DAMPING * lanes + j],
            row[at.MASS * lanes + j],
            row[at.GRAVITY * lanes + j],
        )
        row[at.LOAD_POSITION * lanes + j] = x1
        row[(at.LOAD_POSITION + 1) * lanes + j] = x2
        row[(at.LOAD_POSITION + 2) * lanes + j] = x3
        row[at.LOAD_VELOCITY * lanes + j] = v1
        row[(at.LOAD_VELOCITY + 1) * lanes + j] = v2
        row[(at.LOAD_VELOCITY + 2) * lanes + j] = v3
        row[at.STEP_COST * lanes + j] += cost
        deviation, worst = abs(x3 - target), row[at.OMEGA2 * lanes + j]
        row[at.OMEGA2 * lanes + j] = deviation if deviation > worst else worst
        row[(at.WINCH + 4) * lanes + j] = error2 if active else error0
        row[at.DRUM_ANGLE * lanes + j] = angle2 if active else angle0
        row[at.DRUM_SPEED * lanes + j] = speed2 if active else speed0
        row[at.PULLEY * lanes + j] = end[0] if active else t1
        row[(at.PULLEY + 1) * lanes + j] = end[1] if active else t2
        row[(at.PULLEY + 2) * lanes + j] = end[2] if active else t3
        row[(at.PULLEY + 3) * lanes + j] = end[3] if active else t4
        row[(at.PULLEY + 4) * lanes + j] = end[4] if active else t5
        row[(at.PULLEY + 5) * lanes + j] = end[5] if active else t6
        # A lane that stands still has met its pulley and drum beyond the segment: what it felt there is no tension.
        row[at.SLACK * lanes + j] = 1.0 if active and peak <= 0.0 else row[at.SLACK * lanes + j]
        peak = peak if active else 0.0
        most = row[at.PEAK_TENSION * lanes + j]
        row[at.PEAK_TENSION * lanes + j] = peak if peak > most else most
        row[at.PARTED * lanes + j] = 1.0 if peak > row[at.BREAKING_LOAD * lanes + j] else parted


@scalar
def measure_tension(row: Array, span: Span) -> None:
    """Rope tension at the row's present state, and whether the rope is slack."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        radius = row[at.DRUM_RADIUS * lanes + j]
        length = fma(radius, row[at.DRUM_ANGLE * lanes + j], row[at.FREE_LENGTH * lanes + j])
        intact = 1.0 - row[at.PARTED * lanes + j]
        _, _, _, force = load_acceleration(
            row[at.LOAD_POSITION * lanes + j],
            row[(at.LOAD_POSITION + 1) * lanes + j],
            row[(at.LOAD_POSITION + 2) * lanes + j],
            row[at.LOAD_VELOCITY * lanes + j],
            row[(at.LOAD_VELOCITY + 1) * lanes + j],
            row[(at.LOAD_VELOCITY + 2) * lanes + j],
            row[at.PULLEY * lanes + j],
            row[(at.PULLEY + 1) * lanes + j],
            row[(at.PULLEY + 2) * lanes + j],
            row[(at.PULLEY + 3) * lanes + j],
            row[(at.PULLEY + 4) * lanes + j],
            row[(at.PULLEY + 5) * lanes + j],
            length,
            radius * row[at.DRUM_SPEED * lanes + j],
            intact * row[at.AXIAL_STIFFNESS * lanes + j] / length,
            row[at.DRUM_TO_PULLEY * lanes + j],
            intact * row[at.ROPE_DAMPING * lanes + j],
            1.0,
            0.0,
        )
        row[at.TENSION * lanes + j] = force
        row[at.SLACK * lanes + j] = 1.0 if force <= 0.0 else row[at.SLACK * lanes + j]


@scalar
def control_step(row: Array, components: int, segments: int, records: Array, span: Span) -> None:
    """Advance a block by one control step of ``segments`` motion segments, the command held."""
    lanes = span.stride
    most = 0.0
    for j in range(span.begin, span.end):
        row[at.STEP_COST * lanes + j] = 0.0
        row[at.PEAK_TENSION * lanes + j] = 0.0
        row[at.SLACK * lanes + j] = 0.0
        most = row[at.SUBSTEPS * lanes + j] if row[at.SUBSTEPS * lanes + j] > most else most
    for _ in range(segments):
        advance_motion(row, components, records, span)
        plan_winch(row, span)
        for index in range(int(most)):
            inner_step(row, index, span)
        end_motion(row, span)
    measure_tension(row, span)
    for j in range(span.begin, span.end):
        row[at.OMEGA1 * lanes + j] += row[at.STEP_COST * lanes + j]


@scalar
def start_rows(row: Array, components: int, records: Array, span: Span) -> None:
    """Deck, pulley and rope tension at the row's time, before the first step."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        row[at.SLACK * lanes + j] = 0.0
    start_motion(row, components, records, span)
    measure_tension(row, span)
    for j in range(span.begin, span.end):
        row[at.PEAK_TENSION * lanes + j] = row[at.TENSION * lanes + j]


class StepKernels(NamedTuple):
    """Compiled entry points for blocks of a given number of lanes. Blocks: (B, slots * lanes) float64."""

    step: Callable[[Array, int, int, Array], None]
    """(blocks, components, segments, records): one control step, on the calling thread."""
    step_parallel: Callable[[Array, int, int, Array], None]
    """The same, blocks spread over the cores."""
    start: Callable[[Array, int, Array], None]
    """(blocks, components, records): pose the deck and measure the rope at the rows' start."""
    deck: Callable[[Array, Array], None]
    """(blocks, coordinates (N, 6)): read out surge, sway, heave, roll, pitch and yaw of the first N rows."""


@cache
def step_kernels(lanes: int = LANES) -> StepKernels:
    """Kernels for blocks of ``lanes`` rows (LANES for a batch, 1 for a single row)."""
    span = Span(lanes, 0, lanes)

    @kernel
    def step(blocks: Array, components: int, segments: int, records: Array) -> None:
        for block in range(blocks.shape[0]):
            control_step(blocks[block], components, segments, records, span)

    @parallel_kernel
    def step_parallel(blocks: Array, components: int, segments: int, records: Array) -> None:
        for block in prange(blocks.shape[0]):
            control_step(blocks[block], components, segments, records, span)

    @kernel
    def start(blocks: Array, components: int, records: Array) -> None:
        for block in range(blocks.shape[0]):
            start_rows(blocks[block], components, records, span)

    @kernel
    def deck(blocks: Array, coordinates: Array) -> None:
        for i in range(coordinates.shape[0]):
            for dof in range(6):
                coordinates[i, dof] = deck_coordinate(blocks[i // lanes], dof, lanes, i % lanes)

    return StepKernels(step, step_parallel, start, deck)
