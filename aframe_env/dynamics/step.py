"""Control step of a block of rows: deck, winch, load. The kernels that every face of the package calls."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import prange

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel, parallel_kernel, scalar
from aframe_env.dynamics.drive import begin_drive, exchange_drum, hold_load
from aframe_env.dynamics.drum import limit_drum
from aframe_env.dynamics.heavy_rope import springs_of
from aframe_env.dynamics.inner_step import (
    begin_load,
    heavy_inner_step,
    inner_step,
    measure_heavy,
    measure_tension,
    plan_winch,
)
from aframe_env.dynamics.layout import LANES, Span
from aframe_env.dynamics.luffing import swing_frame, tell_angle
from aframe_env.dynamics.motion import (
    advance_motion,
    deck_coordinate,
    end_motion,
    start_motion,
)
from aframe_env.dynamics.water import begin_water, begin_water_at_node

Array = npt.NDArray[np.float64]


@scalar
def advance_any(row: Array, components: int, records: Array, span: Span) -> None:
    """Begin a motion segment of lanes whose frames may luff."""
    swing_frame(row, span)
    advance_motion(row, components, records, span)


@scalar
def plan_any(row: Array, span: Span) -> None:
    """Plan the winches of lanes with ropes of either kind, by what power and torque allow, or what a drive wants."""
    limit_drum(row, span)
    begin_drive(row, span)
    exchange_drum(row, span)
    plan_winch(row, span)
    exchange_drum(row, span)


@scalar
def measure_any(row: Array, span: Span) -> None:
    """Measure tension and slackness of lanes with ropes of either kind, and the angle of frames that luff."""
    tell_angle(row, span)
    for j in range(span.begin, span.end):
        own = Span(span.stride, j, j + 1)
        springs = int(row[at.SPRINGS * span.stride + j])
        if springs == 0:
            measure_tension(row, own)
        else:
            measure_heavy(row, springs, own)


@scalar
def start_any(row: Array, span: Span) -> None:
    """Meet the water, and measure tension and slackness of lanes with ropes of either kind, at the start."""
    begin_water_at_node(row, span)
    measure_any(row, span)
    hold_load(row, at.ENDS, span)


@scalar
def light_steps(row: Array, count: int, span: Span) -> None:
    """Make the inner steps of a segment, ``count`` at most, with the paper's rope."""
    for index in range(count):
        inner_step(row, index, span)


@scalar
def lane_steps(row: Array, count: int, span: Span) -> None:
    """Make the inner steps of a segment, ``count`` at most, with ropes of either kind, lane by lane."""
    begin_water(row, span)
    for j in range(span.begin, span.end):
        own = Span(span.stride, j, j + 1)
        springs = int(row[at.SPRINGS * span.stride + j])
        for index in range(int(row[at.SUBSTEPS * span.stride + j])):
            if springs == 0:
                inner_step(row, index, own)
            else:
                heavy_inner_step(row, index, springs, False, own)


@scalar
def block_steps(row: Array, count: int, span: Span) -> None:
    """Make the inner steps of a segment with ropes of either kind; in a mixed block lane by lane."""
    fewest, most = springs_of(row, span)
    if most == 0:
        light_steps(row, count, span)
    elif fewest > 0:
        begin_water(row, span)
        for index in range(count):
            heavy_inner_step(row, index, most, True, span)
    else:
        lane_steps(row, count, span)


def _step_of(
    advance: Callable[[Array, int, Array, Span], None],
    plan_winches: Callable[[Array, Span], None],
    inner_steps: Callable[[Array, int, Span], None],
    measure: Callable[[Array, Span], None],
    measure_start: Callable[[Array, Span], None],
) -> tuple[Callable[..., None], Callable[..., None]]:
    """Control step and start of a block.

    By how the motion is advanced, winches are planned, inner steps made, and tensions measured.
    """

    @scalar
    def control_step(row: Array, components: int, segments: int, records: Array, span: Span) -> None:
        lanes = span.stride
        most = 0.0
        for j in range(span.begin, span.end):
            row[at.STEP_COST * lanes + j] = 0.0
            row[at.PEAK_TENSION * lanes + j] = 0.0
            row[at.SLACK * lanes + j] = 0.0
            row[at.CONTACT * lanes + j] = 0.0
            most = row[at.SUBSTEPS * lanes + j] if row[at.SUBSTEPS * lanes + j] > most else most
        for _ in range(segments):
            advance(row, components, records, span)
            plan_winches(row, span)
            begin_load(row, span)
            inner_steps(row, int(most), span)
            end_motion(row, span)
        measure(row, span)
        for j in range(span.begin, span.end):
            row[at.OMEGA1 * lanes + j] += row[at.STEP_COST * lanes + j]

    @scalar
    def start_rows(row: Array, components: int, records: Array, span: Span) -> None:
        lanes = span.stride
        for j in range(span.begin, span.end):
            row[at.SLACK * lanes + j] = 0.0
        start_motion(row, components, records, span)
        measure_start(row, span)
        for j in range(span.begin, span.end):
            row[at.PEAK_TENSION * lanes + j] = row[at.TENSION * lanes + j]

    return control_step, start_rows


# Control step of a block by ``segments`` motion segments, the command held; and pose of deck and pulley with the rope's
# tension at the rows' time, before the first step. With the paper's rope alone; and with ropes of either kind, which
# takes long to compile and gives the paper's rope the same bits: lane by lane, and in whole blocks.
control_step, start_rows = _step_of(advance_motion, plan_winch, light_steps, measure_tension, measure_tension)
lane_control_step, any_start_rows = _step_of(advance_any, plan_any, lane_steps, measure_any, start_any)
block_control_step, _ = _step_of(advance_any, plan_any, block_steps, measure_any, start_any)


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
def step_kernels(lanes: int = LANES, heavy: bool = False) -> StepKernels:
    """Kernels for blocks of ``lanes`` rows (LANES for a batch, 1 for a single row).

    ``heavy``: for ropes with mass and loads in water too.
    """
    span = Span(lanes, 0, lanes)
    # Functions of the module by name: numba's cache never finds a kernel again that closes over a compiled one.
    if not heavy:

        @parallel_kernel
        def step(blocks: Array, components: int, segments: int, records: Array) -> None:
            for block in prange(blocks.shape[0]):
                control_step(blocks[block], components, segments, records, span)

        @kernel
        def start(blocks: Array, components: int, records: Array) -> None:
            for block in range(blocks.shape[0]):
                start_rows(blocks[block], components, records, span)
    else:
        if lanes == 1:

            @parallel_kernel
            def step(blocks: Array, components: int, segments: int, records: Array) -> None:
                for block in prange(blocks.shape[0]):
                    lane_control_step(blocks[block], components, segments, records, span)
        else:

            @parallel_kernel
            def step(blocks: Array, components: int, segments: int, records: Array) -> None:
                for block in prange(blocks.shape[0]):
                    block_control_step(blocks[block], components, segments, records, span)

        @kernel
        def start(blocks: Array, components: int, records: Array) -> None:
            for block in range(blocks.shape[0]):
                any_start_rows(blocks[block], components, records, span)

    @kernel
    def deck(blocks: Array, coordinates: Array) -> None:
        for i in range(coordinates.shape[0]):
            for dof in range(6):
                coordinates[i, dof] = deck_coordinate(blocks[i // lanes], dof, lanes, i % lanes)

    return StepKernels(step.serial, step, start, deck)
