"""Control step of a block of rows of the full model: deck, winch, frame, rope, load."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import prange

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import nine, three
from aframe_env.dynamics.compiling import kernel, parallel_kernel, scalar
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.deck import advance_deck, deck_at
from aframe_env.dynamics.flexible.frame import correct_modes, predict_modes
from aframe_env.dynamics.flexible.heavy import start_heavy_rows, step_heavy_rope
from aframe_env.dynamics.flexible.rope import (
    Compliance,
    PaidOut,
    Pull,
    Unloaded,
    apply,
    apply_transposed,
    iterate_tension,
    unit,
)
from aframe_env.dynamics.flexible.start import start_rows
from aframe_env.dynamics.flexible.swing import pose_any, predict_any
from aframe_env.dynamics.inner_step import drum_at, plan_winch
from aframe_env.dynamics.layout import LANES, Span
from aframe_env.dynamics.luffing import swing_frame, tell_angle
from aframe_env.dynamics.step import plan_any
from aframe_env.dynamics.vector import Vector, add, difference, scaled
from aframe_env.dynamics.water import begin_water_at_node
from aframe_env.dynamics.winch import next_error

Array = npt.NDArray[np.float64]

LOAD_BETA: Final = 1.0 / 12.0
"""β of the load (Fox and Goodwin)."""


@scalar
def step_rope_and_load(row: Array, frame: Array, table: Array, index: int, span: Span) -> None:
    """Bring drum and load to the end of inner step ``index``, and find the rope's force there."""
    h, lanes = table[flex.STEP], span.stride
    give0, give1, give2 = (
        nine(table, flex.GIVE, 1, 0),
        nine(table, flex.GIVE + 9, 1, 0),
        nine(table, flex.GIVE + 18, 1, 0),
    )
    rate0, rate1, rate2 = (
        nine(table, flex.GIVE_RATE, 1, 0),
        nine(table, flex.GIVE_RATE + 9, 1, 0),
        nine(table, flex.GIVE_RATE + 18, 1, 0),
    )
    late, half = LOAD_BETA * h * h, 0.5 * h
    early = (0.5 - LOAD_BETA) * h * h
    for j in range(span.begin, span.end):
        active = frame[flex.ACTIVE * lanes + j] > 0.0
        first, decay = row[(at.WINCH + 3) * lanes + j], row[at.HALF_STEP_DECAY * lanes + j]
        error0 = row[(at.WINCH + 4) * lanes + j]
        error = next_error(next_error(error0, 2.0 * index + 1.0, first, decay), 2.0 * index + 2.0, first, decay)
        angle, speed = drum_at(row, lanes, j, (index + 1.0) * h, error)
        radius, mass = row[at.DRUM_RADIUS * lanes + j], row[at.MASS * lanes + j]
        gravity, parted = row[at.GRAVITY * lanes + j], row[at.PARTED * lanes + j]
        stiffness = row[at.AXIAL_STIFFNESS * lanes + j] * (1.0 - parted)
        damping = row[at.ROPE_DAMPING * lanes + j] * (1.0 - parted)
        length = row[at.FREE_LENGTH * lanes + j] + radius * angle

        x, v = three(row, at.LOAD_POSITION, lanes, j), three(row, at.LOAD_VELOCITY, lanes, j)
        b = three(frame, flex.LOAD_ACCELERATION, lanes, j)
        y = Vector(
            x.x + h * v.x + early * b.x, x.y + h * v.y + early * b.y, x.z + h * v.z + early * b.z - late * gravity
        )
        w = Vector(v.x + half * b.x, v.y + half * b.y, v.z + half * b.z - half * gravity)
        turned = nine(frame, flex.ROTATION, lanes, j)
        pulley = add(three(row, at.PULLEY_ON_DECK, lanes, j), three(frame, flex.TIP, lanes, j))
        unloaded = Unloaded(
            pulley,
            three(frame, flex.TIP + 3, lanes, j),
            apply_transposed(turned, difference(y, three(frame, flex.ORIGIN, lanes, j))),
            apply_transposed(turned, difference(w, three(frame, flex.ORIGIN + 3, lanes, j))),
            three(frame, flex.DRUM, lanes, j),
            three(frame, flex.SPIN, lanes, j),
        )
        _, to_load = unit(difference(unloaded.load, pulley))
        _, to_drum = unit(difference(unloaded.drum, pulley))
        compliance = Compliance(give0, give1, give2, rate0, rate1, rate2, late / mass, half / mass)
        rope = PaidOut(length, radius * speed, stiffness, damping)
        tension = row[at.TENSION * lanes + j]
        pull = Pull(tension, tension, 0.0, to_load, to_drum)
        pull = iterate_tension(pull, unloaded, compliance, rope)
        pull = iterate_tension(pull, unloaded, compliance, rope)

        force = pull.tension
        n = scaled(-force / mass, apply(turned, pull.to_load))
        z, u = add(y, scaled(late, n)), add(w, scaled(half, n))
        row[at.LOAD_POSITION * lanes + j] = z.x if active else x.x
        row[(at.LOAD_POSITION + 1) * lanes + j] = z.y if active else x.y
        row[(at.LOAD_POSITION + 2) * lanes + j] = z.z if active else x.z
        row[at.LOAD_VELOCITY * lanes + j] = u.x if active else v.x
        row[(at.LOAD_VELOCITY + 1) * lanes + j] = u.y if active else v.y
        row[(at.LOAD_VELOCITY + 2) * lanes + j] = u.z if active else v.z
        frame[flex.LOAD_ACCELERATION * lanes + j] = n.x if active else b.x
        frame[(flex.LOAD_ACCELERATION + 1) * lanes + j] = n.y if active else b.y
        frame[(flex.LOAD_ACCELERATION + 2) * lanes + j] = n.z - gravity if active else b.z
        for k in range(3):
            towards = pull.to_load[k] + pull.to_drum[k]
            for slot, part in ((flex.PULL, force), (flex.ELASTIC, pull.elastic), (flex.GROWTH, pull.growth)):
                before = frame[(slot + k) * lanes + j]
                frame[(slot + k) * lanes + j] = part * towards if active else before
        row[at.DRUM_ANGLE * lanes + j] = angle if active else row[at.DRUM_ANGLE * lanes + j]
        row[at.DRUM_SPEED * lanes + j] = speed if active else row[at.DRUM_SPEED * lanes + j]
        row[(at.WINCH + 4) * lanes + j] = error if active else error0
        row[at.TENSION * lanes + j] = force if active else row[at.TENSION * lanes + j]
        if active:
            add_cost(row, x.z, v.z, z.z, u.z, h, lanes, j)


@scalar
def add_cost(row: Array, z0: float, v0: float, z1: float, v1: float, h: float, lanes: int, j: int) -> None:
    """Add an inner step of length h [s] to Ω1, Ω2 and the rope's peak: Simpson's rule, the middle on the cubic.

    Only for a lane that has made the step: what another felt before, at its start too, is no step's tension.
    """
    target = row[at.TARGET * lanes + j]
    e0, e1, middle = z0 - target, z1 - target, 0.5 * (z0 + z1) + 0.125 * h * (v0 - v1) - target
    row[at.STEP_COST * lanes + j] += h / 6.0 * (e0 * e0 + 4.0 * middle * middle + e1 * e1)
    row[at.OMEGA2 * lanes + j] = max(row[at.OMEGA2 * lanes + j], abs(e1))
    force = row[at.TENSION * lanes + j]
    row[at.PEAK_TENSION * lanes + j] = max(row[at.PEAK_TENSION * lanes + j], force)
    if force <= 0.0:
        row[at.SLACK * lanes + j] = 1.0
    if force > row[at.BREAKING_LOAD * lanes + j]:
        row[at.PARTED * lanes + j] = 1.0


@scalar
def mark_active(row: Array, frame: Array, line: float, index: int, lanes: int) -> bool:
    """Mark the rows of that frame (line of the tables) that have an inner step ``index``; return whether any has."""
    found = 0.0
    for j in range(lanes):
        own = 1.0 if frame[flex.FRAME * lanes + j] == line else 0.0
        active = own if index < row[at.SUBSTEPS * lanes + j] else 0.0
        frame[flex.ACTIVE * lanes + j] = active
        found += active
    return found > 0.0


@scalar
def step_any_rope(row: Array, frame: Array, table: Array, index: int, span: Span) -> None:
    """Do what ``step_rope_and_load`` does with ropes of either kind, lane by lane."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.SPRINGS * lanes + j] == 0.0:
            step_rope_and_load(row, frame, table, index, Span(lanes, j, j + 1))
        elif frame[flex.ACTIVE * lanes + j] > 0.0:
            step_heavy_rope(row, frame, table, index, Span(lanes, j, j + 1))


@scalar
def pose_held(row: Array, frame: Array, tables: Array, index: int, lanes: int) -> None:
    """Pose frames that hold on their deck."""
    deck_at(row, frame, index, lanes)


@scalar
def tell_nothing(row: Array, span: Span) -> None:
    """Tell nothing of frames that hold."""


@scalar
def advance_any_deck(row: Array, frame: Array, components: int, records: Array, lanes: int) -> None:
    """Advance deck and frames that luff, the water's motion over the segment being found first."""
    begin_water_at_node(row, Span(lanes, 0, lanes))
    swing_frame(row, Span(lanes, 0, lanes))
    advance_deck(row, frame, components, records, lanes)


def _step_of(
    advance: Callable[[Array, Array, int, Array, int], None],
    plan_winches: Callable[[Array, Span], None],
    pose: Callable[[Array, Array, Array, int, int], None],
    predict: Callable[[Array, Array, int], None],
    step_rope: Callable[[Array, Array, Array, int, Span], None],
    tell: Callable[[Array, Span], None],
) -> Callable[..., None]:
    """Control step of a block.

    By how a segment begins, winches are planned, frames posed and predicted, rope and load stepped, and how it ends.
    """

    @scalar
    def control_step(
        row: Array, frame: Array, tables: Array, components: int, segments: int, records: Array, lanes: int
    ) -> None:
        most = 0.0
        for j in range(lanes):
            row[at.STEP_COST * lanes + j] = 0.0
            row[at.PEAK_TENSION * lanes + j] = 0.0
            row[at.SLACK * lanes + j] = 0.0
            row[at.CONTACT * lanes + j] = 0.0
            most = row[at.SUBSTEPS * lanes + j] if row[at.SUBSTEPS * lanes + j] > most else most
        for _ in range(segments):
            advance(row, frame, components, records, lanes)
            plan_winches(row, Span(lanes, 0, lanes))
            for index in range(int(most)):
                pose(row, frame, tables, index, lanes)
                for line in range(tables.shape[0]):
                    if mark_active(row, frame, line, index, lanes):
                        predict(frame, tables[line], lanes)
                        step_rope(row, frame, tables[line], index, Span(lanes, 0, lanes))
                        correct_modes(frame, tables[line], lanes)
        tell(row, Span(lanes, 0, lanes))
        for j in range(lanes):
            row[at.OMEGA1 * lanes + j] += row[at.STEP_COST * lanes + j]

    return control_step


# Control step of a block by ``segments`` motion segments, the command held: with the paper's rope alone, and with ropes
# of either kind, which takes long to compile and gives the paper's rope the same bits.
control_step = _step_of(advance_deck, plan_winch, pose_held, predict_modes, step_rope_and_load, tell_nothing)
any_control_step = _step_of(advance_any_deck, plan_any, pose_any, predict_any, step_any_rope, tell_angle)


class FlexibleKernels(NamedTuple):
    """Compiled entry points for blocks of a given number of lanes.

    Blocks: (B, slots * lanes) float64; frames: (B, flexible slots * lanes); tables: (frames, size).
    """

    step: Callable[[Array, Array, Array, int, int, Array], None]
    """(blocks, frames, tables, components, segments, records): one control step, on the calling thread."""
    step_parallel: Callable[[Array, Array, Array, int, int, Array], None]
    """The same, blocks spread over the cores."""
    start: Callable[[Array, Array, Array, float], None]
    """(blocks, frames, tables, comoving): frames and loads in equilibrium, carried to where the deck is."""


@cache
def flexible_kernels(lanes: int = LANES, heavy: bool = False) -> FlexibleKernels:
    """Kernels for blocks of ``lanes`` rows (LANES for a batch, 1 for a single row).

    ``heavy``: for all that goes beyond the paper too.
    """
    # Functions of the module by name: numba's cache never finds a kernel again that closes over a compiled one.
    if not heavy:

        @parallel_kernel
        def step(blocks: Array, frames: Array, tables: Array, components: int, segments: int, records: Array) -> None:
            for block in prange(blocks.shape[0]):
                control_step(blocks[block], frames[block], tables, components, segments, records, lanes)

        @kernel
        def start(blocks: Array, frames: Array, tables: Array, comoving: float) -> None:
            for block in range(blocks.shape[0]):
                start_rows(blocks[block], frames[block], tables, comoving, lanes)
    else:

        @parallel_kernel
        def step(blocks: Array, frames: Array, tables: Array, components: int, segments: int, records: Array) -> None:
            for block in prange(blocks.shape[0]):
                any_control_step(blocks[block], frames[block], tables, components, segments, records, lanes)

        @kernel
        def start(blocks: Array, frames: Array, tables: Array, comoving: float) -> None:
            for block in range(blocks.shape[0]):
                start_heavy_rows(blocks[block], frames[block], tables, comoving, lanes)

    return FlexibleKernels(step.serial, step, start)
