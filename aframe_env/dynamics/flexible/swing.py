"""A flexible frame that luffs: the axes that its modes are along, its servomotors' turning, and its way through angles.

The tables have lines for luffing angles a few degrees apart. Those of one are used with the deck's axes {D} turned
about y by the luffing since that angle: the frame in them is the one of its line, on a deck that luffs. What turns in
the frame is the line of the servomotors, e ∝ e_0 + τ n, with e_0 that of the line and n across it, as in
``aframe_env.rfem.luffed``. With q = Φ ζ + g s, where ζ = ΦᵀMq and g is what Φ leaves of the frame's displacement by a
servomotor 1 m longer, a stroke s = -τ n·u_N along e_0 is a force b_i s on mode i, and with the force -τ μ n across that
line the reaction along it is μ = Σ b_i (ζ_i - a_i s) + gᵀ f, b_i = a_i ω_i². Both couplings are small, and symmetric.
They are found implicitly at the step's end, but for the rope's force, which is its start's.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three, three
from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.deck import deck_at, elapsed_at, pose_lane, put_turning
from aframe_env.dynamics.flexible.frame import predict_modes
from aframe_env.dynamics.flexible.start import release
from aframe_env.dynamics.luffing import reach_of, tip_at
from aframe_env.dynamics.vector import Vector, add, difference, inner, scaled

Array = npt.NDArray[np.float64]
Four = tuple[float, float, float, float]

PASSES: Final = 6
"""Of the servomotors' forces; each gains a digit or more."""


@scalar
def lean(row: Array, frame: Array, elapsed: float, lanes: int, j: int) -> None:
    """Turn lane j's pose, ``elapsed`` s into the segment, from {D} to the axes that have luffed with the frame."""
    time = row[at.TIME * lanes + j] - row[at.CONTROL_PERIOD * lanes + j] + elapsed
    tip, speed, acceleration = tip_at(row, time, lanes, j)
    geometry, own = three(row, at.LUFFING_FRAME, lanes, j), three(frame, flex.PULLEY, lanes, j)
    share = 1.0 / (geometry.z * geometry.z)
    cosine, sine = share * (tip.z * own.z + tip.x * own.x), share * (tip.x * own.z - tip.z * own.x)
    rate, bend = share * (tip.z * speed.x - tip.x * speed.z), share * (tip.z * acceleration.x - tip.x * acceleration.z)
    frame[flex.LEAN * lanes + j], frame[(flex.LEAN + 1) * lanes + j] = cosine, sine
    for k in (0, 3, 6):
        first, last = frame[(flex.ROTATION + k) * lanes + j], frame[(flex.ROTATION + k + 2) * lanes + j]
        frame[(flex.ROTATION + k) * lanes + j] = cosine * first - sine * last
        frame[(flex.ROTATION + k + 2) * lanes + j] = sine * first + cosine * last
    put_three(frame, flex.INPUT, lanes, j, turned(three(frame, flex.INPUT, lanes, j), cosine, -sine))
    # Of the deck's own W the part that changes sign when transposed is its angular acceleration.
    w = flex.INPUT + 3
    spin = three(frame, flex.SPIN, lanes, j)
    spin_up = Vector(
        0.5 * (frame[(w + 7) * lanes + j] - frame[(w + 5) * lanes + j]) - spin.z * rate,
        0.5 * (frame[(w + 2) * lanes + j] - frame[(w + 6) * lanes + j]) + bend,
        0.5 * (frame[(w + 3) * lanes + j] - frame[(w + 1) * lanes + j]) + spin.x * rate,
    )
    spin = turned(Vector(spin.x, spin.y + rate, spin.z), cosine, -sine)
    spin_up = turned(spin_up, cosine, -sine)
    put_turning(frame, (spin.x, spin.y, spin.z), (spin_up.x, spin_up.y, spin_up.z), lanes, j)

    on_deck = three(row, at.DRUM_ON_DECK, lanes, j)
    drum = turned(on_deck, cosine, -sine)
    put_three(frame, flex.DRUM, lanes, j, drum)
    put_three(frame, flex.DRUM_RATE, lanes, j, Vector(-rate * drum.z, 0.0, rate * drum.x))
    reach, reach_rate, _ = reach_of(tip, speed, acceleration, on_deck)
    begun = difference(three(row, at.PULLEY_ON_DECK, lanes, j), on_deck)
    frame[flex.REACHED * lanes + j] = reach - np.sqrt(inner(begun, begun))
    frame[(flex.REACHED + 1) * lanes + j] = reach_rate
    height = geometry.x / geometry.z
    x, z, foot = height * own.x, height * own.z, geometry.y
    before, now = Vector(x - foot, 0.0, z), Vector(x - cosine * foot, 0.0, z - sine * foot)
    frame[flex.SLOPE * lanes + j] = (before.x * now.z - before.z * now.x) / inner(before, now)


@scalar
def turned(v: Vector, cosine: float, sine: float) -> Vector:
    """A vector along axes that are turned about y by an angle, along those that are not."""
    return Vector(cosine * v.x + sine * v.z, v.y, cosine * v.z - sine * v.x)


@scalar
def sense(frame: Array, table: Array, lanes: int, j: int) -> Four:
    """Reactions μ of S_R and S_L, N, and displacements n·u_N across them, m, of lane j but for what TURNED adds."""
    first = int(table[flex.SWING])
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for i in range(int(table[flex.COUNT])):
        m = first + flex.SERVOMOTORS + flex.TURNED_SIZE * i
        place = frame[(flex.MODES + flex.MODE_SLOTS * i + flex.POSITION) * lanes + j]
        a, b, c, d = a + table[m] * place, b + table[m + 1] * place, c + table[m + 2] * place, d + table[m + 3] * place
    for k in range(15):
        m = first + flex.LOADED + k
        load = frame[(flex.INPUT + k if k < 12 else flex.PULL + k - 12) * lanes + j]
        a, b, c, d = a + table[m] * load, b + table[m + 15] * load, c + table[m + 30] * load, d + table[m + 45] * load
    return a, b, c, d


@scalar
def put_turned(frame: Array, table: Array, sensed: Four, m: int, lanes: int, j: int) -> None:
    """Write TURNED of lane j by what is sensed without it, and by what it adds: a 4 × 4 matrix from ``m`` on."""
    slope = frame[flex.SLOPE * lanes + j]
    a, b, c, d = sensed
    for _ in range(PASSES):
        a, b, c, d = (
            sensed[0] - slope * (table[m] * a + table[m + 1] * b + table[m + 2] * c + table[m + 3] * d),
            sensed[1] - slope * (table[m + 4] * a + table[m + 5] * b + table[m + 6] * c + table[m + 7] * d),
            sensed[2] - slope * (table[m + 8] * a + table[m + 9] * b + table[m + 10] * c + table[m + 11] * d),
            sensed[3] - slope * (table[m + 12] * a + table[m + 13] * b + table[m + 14] * c + table[m + 15] * d),
        )
    frame[flex.TURNED * lanes + j] = -slope * a
    frame[(flex.TURNED + 1) * lanes + j] = -slope * b
    frame[(flex.TURNED + 2) * lanes + j] = -slope * c
    frame[(flex.TURNED + 3) * lanes + j] = -slope * d


@scalar
def push_modes(frame: Array, table: Array, lanes: int, j: int) -> None:
    """Add TURNED to the forces on lane j's modes."""
    turned_right, turned_left = frame[flex.TURNED * lanes + j], frame[(flex.TURNED + 1) * lanes + j]
    stroke_right, stroke_left = frame[(flex.TURNED + 2) * lanes + j], frame[(flex.TURNED + 3) * lanes + j]
    for i in range(int(table[flex.COUNT])):
        c = int(table[flex.SWING]) + flex.SERVOMOTORS + flex.TURNED_SIZE * i
        force = table[c] * stroke_right + table[c + 1] * stroke_left
        force += table[c + 2] * turned_right + table[c + 3] * turned_left
        frame[(flex.MODES + flex.MODE_SLOTS * i + flex.FORCE) * lanes + j] += force


@scalar
def turn_servomotors(frame: Array, table: Array, lanes: int, j: int) -> None:
    """Add to lane j's modes and TIP, predicted for the step's end, what TURNED does there."""
    first = int(table[flex.SWING])
    pull, sensed = three(frame, flex.PULL, lanes, j), sense(frame, table, lanes, j)
    known = (
        sensed[0] + inner(three(table, first + flex.FELT, 1, 0), pull),
        sensed[1] + inner(three(table, first + flex.FELT + 3, 1, 0), pull),
        sensed[2] + inner(three(table, first + flex.FELT + 6, 1, 0), pull),
        sensed[3] + inner(three(table, first + flex.FELT + 9, 1, 0), pull),
    )
    put_turned(frame, table, known, first + flex.LOOP, lanes, j)
    push_modes(frame, table, lanes, j)
    tip, tip_rate = three(frame, flex.TIP, lanes, j), three(frame, flex.TIP + 3, lanes, j)
    for i in range(int(table[flex.COUNT])):
        place, rate, own = 0.0, 0.0, first + flex.SERVOMOTORS + flex.TURNED_SIZE * i + 4
        for k in range(4):
            force = frame[(flex.TURNED + k) * lanes + j]
            place, rate = place + table[own + k] * force, rate + table[own + 4 + k] * force
        mode = flex.MODES + flex.MODE_SLOTS * i
        frame[(mode + flex.POSITION) * lanes + j] += place
        frame[(mode + flex.RATE) * lanes + j] += rate
        shape = three(table, flex.HEAD + flex.MODE_SIZE * i + flex.SHAPE, 1, 0)
        tip, tip_rate = add(tip, scaled(place, shape)), add(tip_rate, scaled(rate, shape))
    put_three(frame, flex.TIP, lanes, j, tip)
    put_three(frame, flex.TIP + 3, lanes, j, tip_rate)


@scalar
def predict_any(frame: Array, table: Array, lanes: int) -> None:
    """Do what ``predict_modes`` does with a frame that may luff."""
    predict_modes(frame, table, lanes)
    if table[flex.SWING] > 0.0:
        for j in range(lanes):
            if frame[flex.ACTIVE * lanes + j] > 0.0:
                turn_servomotors(frame, table, lanes, j)


@scalar
def pose_any(row: Array, frame: Array, tables: Array, index: int, lanes: int) -> None:
    """Do what ``deck_at`` does with frames that may luff, and have them use the tables of the nearest luffing angle."""
    for j in range(lanes):
        if row[at.LUFFING_POINTS * lanes + j] > 0.0 and index < row[at.SUBSTEPS * lanes + j]:
            go_on(row, frame, tables, index, lanes, j)
    deck_at(row, frame, index, lanes)
    for j in range(lanes):
        if row[at.LUFFING_POINTS * lanes + j] > 0.0:
            lean(row, frame, elapsed_at(row, index + 1.0, lanes, j), lanes, j)


@scalar
def go_on(row: Array, frame: Array, tables: Array, index: int, lanes: int, j: int) -> None:
    """Take lane j to another line at the start of inner step ``index`` where it has come half way there."""
    table, sine = tables[int(frame[flex.FRAME * lanes + j])], frame[(flex.LEAN + 1) * lanes + j]
    first = int(table[flex.SWING])
    if first > 0 and sine > table[first + flex.HALFWAY]:
        go_over(row, frame, tables, 0, index, lanes, j)
    elif first > 0 and -sine > table[first + flex.HALFWAY + 1]:
        go_over(row, frame, tables, 1, index, lanes, j)


@scalar
def go_over(row: Array, frame: Array, tables: Array, way: int, index: int, lanes: int, j: int) -> None:
    """Take lane j to the line of the next luffing angle up or down, at the start of inner step ``index``."""
    old = tables[int(frame[flex.FRAME * lanes + j])]
    first = int(old[flex.SWING])
    line = old[first + flex.NEIGHBOUR + way]
    new = tables[int(line)]
    passage, modes = int(old[first + flex.PASSAGE + way]), int(old[flex.COUNT])
    for i in range(int(new[flex.COUNT])):
        place, rate = 0.0, 0.0
        for k in range(modes):
            factor, other = old[passage + (modes + 4) * i + k], flex.MODES + flex.MODE_SLOTS * k
            place += factor * frame[(other + flex.POSITION) * lanes + j]
            rate += factor * frame[(other + flex.RATE) * lanes + j]
        for k in range(4):
            place += old[passage + (modes + 4) * i + modes + k] * frame[(flex.TURNED + k) * lanes + j]
        mode = flex.MODES + flex.MODE_SLOTS * i + flex.NEXT
        frame[mode * lanes + j], frame[(mode + 1) * lanes + j] = place, rate
    for i in range(int(new[flex.COUNT])):
        mode = flex.MODES + flex.MODE_SLOTS * i
        frame[(mode + flex.POSITION) * lanes + j] = frame[(mode + flex.NEXT) * lanes + j]
        frame[(mode + flex.RATE) * lanes + j] = frame[(mode + flex.NEXT + 1) * lanes + j]
    before, after = three(frame, flex.PULLEY, lanes, j), three(new, int(new[flex.SWING]) + flex.OWN_PULLEY, 1, 0)
    share = 1.0 / inner(before, before)
    cosine, sine = share * inner(before, after), share * (after.x * before.z - after.z * before.x)
    put_three(frame, flex.PULL, lanes, j, turned(three(frame, flex.PULL, lanes, j), cosine, sine))
    put_three(frame, flex.PULLEY, lanes, j, after)
    frame[flex.FRAME * lanes + j] = line
    elapsed = elapsed_at(row, 1.0 * index, lanes, j)
    pose_lane(row, frame, elapsed, lanes, j)
    lean(row, frame, elapsed, lanes, j)
    release(frame, new, lanes, j)
    put_turned(frame, new, sense(frame, new, lanes, j), int(new[flex.SWING]) + flex.FEED, lanes, j)
    push_modes(frame, new, lanes, j)
    for i in range(int(new[flex.COUNT])):
        at_once, own = 0.0, int(new[flex.SWING]) + flex.SERVOMOTORS + flex.TURNED_SIZE * i + 12
        for k in range(4):
            at_once += new[own + k] * frame[(flex.TURNED + k) * lanes + j]
        frame[(flex.MODES + flex.MODE_SLOTS * i + flex.POSITION) * lanes + j] -= at_once
