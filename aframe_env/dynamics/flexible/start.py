"""Start of an episode: frame, rope and load in static equilibrium on the level deck, carried to where the deck is."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.blocks import nine, three
from aframe_env.dynamics.flexible.deck import deck_now
from aframe_env.dynamics.flexible.frame import deck_force, slots_of, write_carried
from aframe_env.dynamics.flexible.rope import apply, apply_transposed, sweep, unit

Array = npt.NDArray[np.float64]

ITERATIONS: Final = 30
"""Of the deflection of S, which turns the rope's second leg; each gains three digits or so."""
NOTHING: Final = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@scalar
def start_rows(row: Array, frame: Array, tables: Array, comoving: float, lanes: int) -> None:
    """Fill the block's frames and place its loads; the deck's coordinates are in the rows already.

    ``comoving`` is 1 where the load starts with the velocity of S, 0 where it starts at rest.
    """
    deck_now(row, frame, lanes)
    for j in range(lanes):
        table = tables[int(frame[flex.FRAME * lanes + j])]
        deflection = rest(row, frame, table, lanes, j)
        place_load(row, frame, deflection, comoving, lanes, j)
        release(row, frame, table, deflection, lanes, j)


@scalar
def rest(row: Array, frame: Array, table: Array, lanes: int, j: int) -> tuple[float, float, float]:
    """Put the modes at rest under own weight and the load's; return the deflection of S."""
    modes = int(table[flex.COUNT])
    gravity, weight = row[at.GRAVITY * lanes + j], row[at.GRAVITY * lanes + j] * row[at.MASS * lanes + j]
    w1, w2, w3 = 0.0, 0.0, 0.0
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        place = -gravity * table[c + flex.FIELD + 2] / table[c + flex.SQUARE]
        w1 += table[c + flex.SHAPE] * place
        w2 += table[c + flex.SHAPE + 1] * place
        w3 += table[c + flex.SHAPE + 2] * place
    s1, s2, s3 = three(row, at.PULLEY_ON_DECK, lanes, j)
    h1, h2, h3 = three(frame, flex.DRUM, lanes, j)
    give = nine(table, flex.REST, 1, 0)
    u1, u2, u3 = w1, w2, w3
    f1, f2, f3 = 0.0, 0.0, 0.0
    for _ in range(ITERATIONS):
        _, d1, d2, d3 = unit(h1 - s1 - u1, h2 - s2 - u2, h3 - s3 - u3)
        f1, f2, f3 = weight * d1, weight * d2, weight * (d3 - 1.0)
        r1, r2, r3 = apply(give, f1, f2, f3)
        u1, u2, u3 = w1 + r1, w2 + r2, w3 + r3
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = flex.MODES + flex.MODE_SLOTS * i
        force = table[c + flex.SHAPE] * f1 + table[c + flex.SHAPE + 1] * f2 + table[c + flex.SHAPE + 2] * f3
        force -= gravity * table[c + flex.FIELD + 2]
        frame[(mode + flex.POSITION) * lanes + j] = force / table[c + flex.SQUARE]
        frame[(mode + flex.RATE) * lanes + j] = 0.0
    return u1, u2, u3


@scalar
def place_load(
    row: Array, frame: Array, deflection: tuple[float, float, float], comoving: float, lanes: int, j: int
) -> None:
    """Hang the load below S by the rope that its weight stretches, at rest or with the velocity of S."""
    p1, p2, p3 = three(row, at.PULLEY_ON_DECK, lanes, j)
    s1, s2, s3 = p1 + deflection[0], p2 + deflection[1], p3 + deflection[2]
    h1, h2, h3 = three(frame, flex.DRUM, lanes, j)
    inboard, _, _, _ = unit(h1 - s1, h2 - s2, h3 - s3)
    weight = row[at.GRAVITY * lanes + j] * row[at.MASS * lanes + j]
    hanging = row[at.FREE_LENGTH * lanes + j] * (1.0 + weight / row[at.AXIAL_STIFFNESS * lanes + j]) - inboard
    turned = nine(frame, flex.ROTATION, lanes, j)
    o1, o2, o3 = three(frame, flex.ORIGIN, lanes, j)
    v1, v2, v3 = three(frame, flex.ORIGIN + 3, lanes, j)
    x, y, z = three(frame, flex.SPIN, lanes, j)
    r1, r2, r3 = apply(turned, s1, s2, s3)
    w1, w2, w3 = apply(turned, y * s3 - z * s2, z * s1 - x * s3, x * s2 - y * s1)
    row[at.LOAD_POSITION * lanes + j] = o1 + r1
    row[(at.LOAD_POSITION + 1) * lanes + j] = o2 + r2
    row[(at.LOAD_POSITION + 2) * lanes + j] = o3 + r3 - hanging
    row[at.LOAD_VELOCITY * lanes + j] = comoving * (v1 + w1)
    row[(at.LOAD_VELOCITY + 1) * lanes + j] = comoving * (v2 + w2)
    row[(at.LOAD_VELOCITY + 2) * lanes + j] = comoving * (v3 + w3)
    row[at.OMEGA2 * lanes + j] = abs(row[(at.LOAD_POSITION + 2) * lanes + j] - row[at.TARGET * lanes + j])


@scalar
def release(row: Array, frame: Array, table: Array, deflection: tuple[float, float, float], lanes: int, j: int) -> None:
    """Rope force at the start, and the accelerations of load and modes that follow from it."""
    p1, p2, p3 = three(row, at.PULLEY_ON_DECK, lanes, j)
    pulley = (p1 + deflection[0], p2 + deflection[1], p3 + deflection[2])
    turned, spin = nine(frame, flex.ROTATION, lanes, j), three(frame, flex.SPIN, lanes, j)
    drum = three(frame, flex.DRUM, lanes, j)
    x1, x2, x3 = three(row, at.LOAD_POSITION, lanes, j)
    v1, v2, v3 = three(row, at.LOAD_VELOCITY, lanes, j)
    o1, o2, o3 = three(frame, flex.ORIGIN, lanes, j)
    q1, q2, q3 = three(frame, flex.ORIGIN + 3, lanes, j)
    mass, gravity = row[at.MASS * lanes + j], row[at.GRAVITY * lanes + j]
    still = (0.0, 0.0, 0.0)
    force, to_load, to_drum = sweep(
        0.0,
        still,
        still,
        pulley,
        still,
        apply_transposed(turned, x1 - o1, x2 - o2, x3 - o3),
        apply_transposed(turned, v1 - q1, v2 - q2, v3 - q3),
        drum,
        spin,
        NOTHING,
        NOTHING,
        0.0,
        0.0,
        row[at.FREE_LENGTH * lanes + j],
        0.0,
        row[at.AXIAL_STIFFNESS * lanes + j],
        row[at.ROPE_DAMPING * lanes + j],
    )
    n1, n2, n3 = apply(turned, to_load[0], to_load[1], to_load[2])
    frame[flex.LOAD_ACCELERATION * lanes + j] = -force / mass * n1
    frame[(flex.LOAD_ACCELERATION + 1) * lanes + j] = -force / mass * n2
    frame[(flex.LOAD_ACCELERATION + 2) * lanes + j] = -force / mass * n3 - gravity
    for k in range(3):
        frame[(flex.PULL + k) * lanes + j] = force * (to_load[k] + to_drum[k])
    row[at.TENSION * lanes + j] = force
    row[at.PEAK_TENSION * lanes + j] = force
    row[at.SLACK * lanes + j] = 1.0 if force <= 0.0 else 0.0
    modes, carried = int(table[flex.COUNT]), int(table[flex.CARRIED_COUNT])
    for b in range(carried):
        place = frame[(flex.MODES + flex.MODE_SLOTS * b + flex.POSITION) * lanes + j]
        write_carried(frame, slots_of(frame, flex.CARRIED + 9 * b, 9, lanes), place, 0.0, lanes, j)
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = flex.MODES + flex.MODE_SLOTS * i
        uniform, turning = three(table, c + flex.FIELD, 1, 0), nine(table, c + flex.FIELD + 3, 1, 0)
        total = deck_force(frame, uniform, turning, lanes, j)
        for k in range(3):
            total += table[c + flex.SHAPE + k] * frame[(flex.PULL + k) * lanes + j]
        if i < carried:
            matrix = flex.HEAD + flex.MODE_SIZE * modes + 9 * carried * i
            for k in range(9 * carried):
                total += table[matrix + k] * frame[(flex.CARRIED + k) * lanes + j]
        total -= table[c + flex.SQUARE] * frame[(mode + flex.POSITION) * lanes + j]
        frame[(mode + flex.ACCELERATION) * lanes + j] = total
