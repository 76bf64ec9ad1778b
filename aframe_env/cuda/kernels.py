"""The kernels that are launched on the device: one thread a row, and as many in a block as the engine's blocks have."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from numba import cuda

from aframe_env.cuda.drawing import begin_episode, copy_row, draw_lift, draw_motion
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.layout import LANES, Span
from aframe_env.dynamics.random import draw_seed
from aframe_env.dynamics.step import control_step, lane_control_step
from aframe_env.scenario import NUMBERS
from aframe_env.task import charge_parted, clip_row, read_out

Array = Any


@scalar
def tell(
    row: Array,
    i: int,
    j: int,
    episode_duration: float,
    state: Array,
    results: Array,
    low: Array,
    high: Array,
    observation: Array,
) -> None:
    """Read row i out, lane j of its block, once it has made a step."""
    charge_parted(row, episode_duration, LANES, j)
    read_out(row, LANES, j, state, results, i)
    clip_row(state, low, high, observation, i)


def advance(
    blocks: Array,
    room: int,
    segments: int,
    records: Array,
    actions: Array,
    episode_duration: float,
    state: Array,
    results: Array,
    low: Array,
    high: Array,
    observation: Array,
) -> None:
    """Advance every row by one control step with ``actions`` (N, 1) rad/s, and read it out."""
    i, j = cuda.grid(1), cuda.threadIdx.x
    if i < actions.shape[0]:
        row = blocks[cuda.blockIdx.x]
        row[at.COMMAND * LANES + j] = actions[i, 0]
        control_step(row, room, segments, records, Span(LANES, j, j + 1))
        tell(row, i, j, episode_duration, state, results, low, high, observation)


def advance_any(
    blocks: Array,
    room: int,
    segments: int,
    records: Array,
    actions: Array,
    episode_duration: float,
    state: Array,
    results: Array,
    low: Array,
    high: Array,
    observation: Array,
) -> None:
    """Advance as ``advance`` does, rows with ropes that have mass and loads in water too: it takes long to compile."""
    i, j = cuda.grid(1), cuda.threadIdx.x
    if i < actions.shape[0]:
        row = blocks[cuda.blockIdx.x]
        row[at.COMMAND * LANES + j] = actions[i, 0]
        lane_control_step(row, room, segments, records, Span(LANES, j, j + 1))
        tell(row, i, j, episode_duration, state, results, low, high, observation)


def repeat(
    blocks: Array,
    finished: Array,
    vector: Array,
    state: Array,
    results: Array,
    low: Array,
    high: Array,
    observation: Array,
) -> None:
    """Put the rows that have ``finished`` (N,) back at the start ``vector`` (slots,) of their one scenario."""
    i, j = cuda.grid(1), cuda.threadIdx.x
    if i < finished.shape[0] and finished[i] != 0:
        row = blocks[cuda.blockIdx.x]
        copy_row(row, LANES, j, vector)
        read_out(row, LANES, j, state, results, i)
        clip_row(state, low, high, observation, i)


def draw(
    blocks: Array,
    room: int,
    components: int,
    records: Array,
    finished: Array,
    seed: int,
    episodes: Array,
    vector: Array,
    ranges: Array,
    limits: Array,
    frequency_quantiles: Array,
    direction_quantiles: Array,
    frequencies: Array,
    headings: Array,
    response: Array,
    state: Array,
    results: Array,
    low: Array,
    high: Array,
    observation: Array,
) -> None:
    """Draw new scenarios for the rows that have ``finished`` (N,); ``episodes`` (N,) counts each row's."""
    i, j = cuda.grid(1), cuda.threadIdx.x
    if i < finished.shape[0] and finished[i] != 0:
        row = blocks[cuda.blockIdx.x]
        own, first = draw_seed(seed, i), NUMBERS * episodes[i]
        episodes[i] += 1
        copy_row(row, LANES, j, vector)
        draw_lift(row, LANES, j, own, first, ranges, limits)
        draw_motion(
            row,
            LANES,
            j,
            components,
            own,
            first,
            ranges,
            limits,
            frequency_quantiles,
            direction_quantiles,
            frequencies,
            headings,
            response,
        )
        begin_episode(row, room, records, LANES, j)
        read_out(row, LANES, j, state, results, i)
        clip_row(state, low, high, observation, i)


class Kernels(NamedTuple):
    """The functions above, compiled for the device when they are first launched."""

    advance: Any
    advance_any: Any
    repeat: Any
    draw: Any


@cache
def kernels() -> Kernels:
    """Kernels for the device."""
    compiler: Callable[..., Any] = cuda.jit
    return Kernels(compiler(advance), compiler(advance_any), compiler(repeat), compiler(draw))
