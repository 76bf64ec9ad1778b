"""One control step of a block of rows: deck, winch, load. The kernels that every face of the package calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import prange

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel, parallel_kernel, scalar, source_digest
from aframe_env.dynamics.integrator import rk4_step
from aframe_env.dynamics.layout import LANES
from aframe_env.dynamics.motion import advance_motion, on_quintic, pose_deck
from aframe_env.dynamics.rope import tension
from aframe_env.dynamics.winch import drum_state, next_error, plan

Array = npt.NDArray[np.float64]


@scalar
def plan_winch(row: Array, lanes: int) -> None:
    """Limit the command and plan how the drum follows it over the segment."""
    for j in range(lanes):
        limit = row[at.MAX_SPEED * lanes + j]
        command = row[at.COMMAND * lanes + j]
        command = limit if command > limit else command
        command = -limit if command < -limit else command
        row[at.COMMAND * lanes + j] = command
        half_step = 0.5 * row[at.CONTROL_PERIOD * lanes + j] / row[at.SUBSTEPS * lanes + j]
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
def pulley_at(row: Array, lanes: int, j: int, elapsed: float) -> tuple[float, float, float, float, float, float]:
    """Pulley position and velocity of lane j, ``elapsed`` s into the segment."""
    c = at.PATH
    s1, d1 = on_quintic(
        row[c * lanes + j],
        row[(c + 1) * lanes + j],
        row[(c + 2) * lanes + j],
        row[(c + 3) * lanes + j],
        row[(c + 4) * lanes + j],
        row[(c + 5) * lanes + j],
        elapsed,
    )
    s2, d2 = on_quintic(
        row[(c + 6) * lanes + j],
        row[(c + 7) * lanes + j],
        row[(c + 8) * lanes + j],
        row[(c + 9) * lanes + j],
        row[(c + 10) * lanes + j],
        row[(c + 11) * lanes + j],
        elapsed,
    )
    s3, d3 = on_quintic(
        row[(c + 12) * lanes + j],
        row[(c + 13) * lanes + j],
        row[(c + 14) * lanes + j],
        row[(c + 15) * lanes + j],
        row[(c + 16) * lanes + j],
        row[(c + 17) * lanes + j],
        elapsed,
    )
    return s1, s2, s3, d1, d2, d3


@scalar
def inner_step(row: Array, index: int, lanes: int) -> None:
    """Inner step number ``index`` of the segment, for every lane that has so many (the others stand still)."""
    for j in range(lanes):
        active = index < row[at.SUBSTEPS * lanes + j]
        full = row[at.CONTROL_PERIOD * lanes + j] / row[at.SUBSTEPS * lanes + j]
        begin = index * full
        h = full if active else 0.0
        error0 = row[(at.WINCH + 4) * lanes + j]
        first, decay = row[(at.WINCH + 3) * lanes + j], row[at.HALF_STEP_DECAY * lanes + j]
        error1 = next_error(error0, 2.0 * index + 1.0, first, decay)
        error2 = next_error(error1, 2.0 * index + 2.0, first, decay)
        free_length, radius = row[at.FREE_LENGTH * lanes + j], row[at.DRUM_RADIUS * lanes + j]
        angle0, speed0 = row[at.DRUM_ANGLE * lanes + j], row[at.DRUM_SPEED * lanes + j]
        angle1, speed1 = drum_at(row, lanes, j, begin + 0.5 * full, error1)
        angle2, speed2 = drum_at(row, lanes, j, begin + full, error2)
        t1, t2, t3 = row[at.TIP * lanes + j], row[(at.TIP + 1) * lanes + j], row[(at.TIP + 2) * lanes + j]
        t4, t5, t6 = (
            row[(at.TIP + 3) * lanes + j],
            row[(at.TIP + 4) * lanes + j],
            row[(at.TIP + 5) * lanes + j],
        )
        start = (t1, t2, t3, t4, t5, t6, free_length + radius * angle0, radius * speed0)
        m1, m2, m3, m4, m5, m6 = pulley_at(row, lanes, j, begin + 0.5 * full)
        middle = (m1, m2, m3, m4, m5, m6, free_length + radius * angle1, radius * speed1)
        e1, e2, e3, e4, e5, e6 = pulley_at(row, lanes, j, begin + full)
        end = (e1, e2, e3, e4, e5, e6, free_length + radius * angle2, radius * speed2)
        parted = row[at.PARTED * lanes + j]
        stiffness = row[at.AXIAL_STIFFNESS * lanes + j] * (1.0 - parted)
        damping = row[at.ROPE_DAMPING * lanes + j] * (1.0 - parted)
        x1, x2, x3, v1, v2, v3, cost, peak = rk4_step(
            row[at.LOAD_POSITION * lanes + j],
            row[(at.LOAD_POSITION + 1) * lanes + j],
            row[(at.LOAD_POSITION + 2) * lanes + j],
            row[at.LOAD_VELOCITY * lanes + j],
            row[(at.LOAD_VELOCITY + 1) * lanes + j],
            row[(at.LOAD_VELOCITY + 2) * lanes + j],
            start,
            middle,
            end,
            h,
            row[at.TARGET * lanes + j],
            row[at.DRUM_TO_PULLEY * lanes + j],
            stiffness,
            damping,
            row[at.MASS * lanes + j],
            row[at.GRAVITY * lanes + j],
        )
        (
            row[at.LOAD_POSITION * lanes + j],
            row[(at.LOAD_POSITION + 1) * lanes + j],
            row[(at.LOAD_POSITION + 2) * lanes + j],
        ) = x1, x2, x3
        (
            row[at.LOAD_VELOCITY * lanes + j],
            row[(at.LOAD_VELOCITY + 1) * lanes + j],
            row[(at.LOAD_VELOCITY + 2) * lanes + j],
        ) = v1, v2, v3
        row[at.STEP_COST * lanes + j] += cost
        deviation = abs(x3 - row[at.TARGET * lanes + j])
        row[at.OMEGA2 * lanes + j] = deviation if deviation > row[at.OMEGA2 * lanes + j] else row[at.OMEGA2 * lanes + j]
        row[(at.WINCH + 4) * lanes + j] = error2 if active else error0
        row[at.DRUM_ANGLE * lanes + j] = angle2 if active else angle0
        row[at.DRUM_SPEED * lanes + j] = speed2 if active else speed0
        row[at.TIP * lanes + j] = e1 if active else t1
        row[(at.TIP + 1) * lanes + j] = e2 if active else t2
        row[(at.TIP + 2) * lanes + j] = e3 if active else t3
        row[(at.TIP + 3) * lanes + j] = e4 if active else t4
        row[(at.TIP + 4) * lanes + j] = e5 if active else t5
        row[(at.TIP + 5) * lanes + j] = e6 if active else t6
        # A lane that stands still has met its pulley and drum beyond the segment: what it felt there is no tension.
        row[at.SLACK * lanes + j] = 1.0 if active and peak <= 0.0 else row[at.SLACK * lanes + j]
        peak = peak if active else 0.0
        row[at.PEAK_TENSION * lanes + j] = (
            peak if peak > row[at.PEAK_TENSION * lanes + j] else row[at.PEAK_TENSION * lanes + j]
        )
        row[at.PARTED * lanes + j] = 1.0 if peak > row[at.BREAKING_LOAD * lanes + j] else parted


@scalar
def measure_tension(row: Array, lanes: int) -> None:
    """Rope tension at the row's present state, and whether the rope is slack."""
    for j in range(lanes):
        u1 = row[at.PULLEY * lanes + j] - row[at.LOAD_POSITION * lanes + j]
        u2 = row[(at.PULLEY + 1) * lanes + j] - row[(at.LOAD_POSITION + 1) * lanes + j]
        u3 = row[(at.PULLEY + 2) * lanes + j] - row[(at.LOAD_POSITION + 2) * lanes + j]
        w1 = row[(at.PULLEY + 3) * lanes + j] - row[at.LOAD_VELOCITY * lanes + j]
        w2 = row[(at.PULLEY + 4) * lanes + j] - row[(at.LOAD_VELOCITY + 1) * lanes + j]
        w3 = row[(at.PULLEY + 5) * lanes + j] - row[(at.LOAD_VELOCITY + 2) * lanes + j]
        distance = np.sqrt(u1 * u1 + u2 * u2 + u3 * u3 + 1e-18)
        length = row[at.FREE_LENGTH * lanes + j] + row[at.DRUM_RADIUS * lanes + j] * row[at.DRUM_ANGLE * lanes + j]
        rate = (u1 * w1 + u2 * w2 + u3 * w3) / distance - row[at.DRUM_RADIUS * lanes + j] * row[
            at.DRUM_SPEED * lanes + j
        ]
        intact = 1.0 - row[at.PARTED * lanes + j]
        force = intact * tension(
            distance + row[at.DRUM_TO_PULLEY * lanes + j] - length,
            rate,
            length,
            row[at.AXIAL_STIFFNESS * lanes + j],
            row[at.ROPE_DAMPING * lanes + j],
        )
        row[at.TENSION * lanes + j] = force
        row[at.SLACK * lanes + j] = 1.0 if force <= 0.0 else row[at.SLACK * lanes + j]


@scalar
def control_step(row: Array, components: int, segments: int, records: Array, lanes: int) -> None:
    """Advance a block by one control step of ``segments`` motion segments, the command held."""
    most = 0.0
    for j in range(lanes):
        row[at.STEP_COST * lanes + j] = 0.0
        row[at.PEAK_TENSION * lanes + j] = 0.0
        row[at.SLACK * lanes + j] = 0.0
        most = row[at.SUBSTEPS * lanes + j] if row[at.SUBSTEPS * lanes + j] > most else most
    for _ in range(segments):
        advance_motion(row, components, records, lanes)
        plan_winch(row, lanes)
        for index in range(int(most)):
            inner_step(row, index, lanes)
    measure_tension(row, lanes)
    for j in range(lanes):
        row[at.OMEGA1 * lanes + j] += row[at.STEP_COST * lanes + j]


@scalar
def start_rows(row: Array, components: int, records: Array, lanes: int) -> None:
    """Deck, pulley and rope tension at the row's time, before the first step."""
    for j in range(lanes):
        row[at.SLACK * lanes + j] = 0.0
    pose_deck(row, components, records, lanes)
    measure_tension(row, lanes)
    for j in range(lanes):
        row[at.PEAK_TENSION * lanes + j] = row[at.TENSION * lanes + j]


class StepKernels(NamedTuple):
    """Compiled entry points for blocks of a given number of lanes. Blocks: (B, slots * lanes) float64."""

    step: Callable[[Array, int, int, Array], None]
    """(blocks, components, segments, records): one control step, on the calling thread."""
    step_parallel: Callable[[Array, int, int, Array], None]
    """The same, blocks spread over the cores."""
    start: Callable[[Array, int, Array], None]
    """(blocks, components, records): pose the deck and measure the rope at the rows' times."""


@cache
def step_kernels(lanes: int = LANES) -> StepKernels:
    """Kernels for blocks of ``lanes`` rows (LANES for a batch, 1 for a single row)."""
    source: Any = source_digest()

    @kernel
    def step(blocks: Array, components: int, segments: int, records: Array) -> None:
        source  # noqa: B018  (a changed digest makes a new cache entry)
        for block in range(blocks.shape[0]):
            control_step(blocks[block], components, segments, records, lanes)

    @parallel_kernel
    def step_parallel(blocks: Array, components: int, segments: int, records: Array) -> None:
        source  # noqa: B018
        for block in prange(blocks.shape[0]):
            control_step(blocks[block], components, segments, records, lanes)

    @kernel
    def start(blocks: Array, components: int, records: Array) -> None:
        source  # noqa: B018
        for block in range(blocks.shape[0]):
            start_rows(blocks[block], components, records, lanes)

    return StepKernels(step, step_parallel, start)
