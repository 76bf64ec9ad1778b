"""Start of an episode: frame, rope and load in static equilibrium on the level deck, carried to where the deck is."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import nine, put_three, three
from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.deck import deck_now
from aframe_env.dynamics.flexible.frame import deck_force, slots_of, write_carried
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
from aframe_env.dynamics.vector import Vector, add, cross, difference, scaled

Array = npt.NDArray[np.float64]

ITERATIONS: Final = 30
"""Iterations of the deflection of S, which turns the rope's second leg; each gains three digits or so."""
NOTHING: Final = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@scalar
def start_rows(row: Array, frame: Array, tables: Array, comoving: float, lanes: int) -> None:
    """Fill the block's frames and place its loads; the deck's coordinates are in the rows already.

    ``comoving`` is 1 where the load starts with the velocity of S, 0 where it starts at rest.
    """
    deck_now(row, frame, lanes)
    for j in range(lanes):
        table = tables[int(frame[flex.FRAME * lanes + j])]
        deflection = rest(row, frame, table, row[at.GRAVITY * lanes + j] * row[at.MASS * lanes + j], lanes, j)
        place_load(row, frame, deflection, comoving, lanes, j)
        pull_head(row, frame, deflection, lanes, j)
        release(frame, table, lanes, j)


@scalar
def rest(row: Array, frame: Array, table: Array, weight: float, lanes: int, j: int) -> Vector:
    """Put the modes at rest under own weight and the rope's tension ``weight`` [N]; return the deflection of S."""
    modes = int(table[flex.COUNT])
    gravity = row[at.GRAVITY * lanes + j]
    w1, w2, w3 = 0.0, 0.0, 0.0
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        place = -gravity * table[c + flex.FIELD + 2] / table[c + flex.SQUARE]
        w1 += table[c + flex.SHAPE] * place
        w2 += table[c + flex.SHAPE + 1] * place
        w3 += table[c + flex.SHAPE + 2] * place
    pulley, drum = three(row, at.PULLEY_ON_DECK, lanes, j), three(frame, flex.DRUM, lanes, j)
    compliance = nine(table, flex.REST, 1, 0)
    own = Vector(w1, w2, w3)
    u = own
    f = Vector(0.0, 0.0, 0.0)
    for _ in range(ITERATIONS):
        _, d = unit(difference(difference(drum, pulley), u))
        f = Vector(weight * d.x, weight * d.y, weight * (d.z - 1.0))
        u = add(own, apply(compliance, f))
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = flex.MODES + flex.MODE_SLOTS * i
        force = table[c + flex.SHAPE] * f.x + table[c + flex.SHAPE + 1] * f.y + table[c + flex.SHAPE + 2] * f.z
        force -= gravity * table[c + flex.FIELD + 2]
        frame[(mode + flex.POSITION) * lanes + j] = force / table[c + flex.SQUARE]
        frame[(mode + flex.RATE) * lanes + j] = 0.0
    return u


@scalar
def place_load(row: Array, frame: Array, deflection: Vector, comoving: float, lanes: int, j: int) -> None:
    """Hang the load below S by the rope that its weight stretches, at rest or with the velocity of S."""
    pulley = add(three(row, at.PULLEY_ON_DECK, lanes, j), deflection)
    inboard, _ = unit(difference(three(frame, flex.DRUM, lanes, j), pulley))
    weight = row[at.GRAVITY * lanes + j] * row[at.MASS * lanes + j]
    hanging = row[at.FREE_LENGTH * lanes + j] * (1.0 + weight / row[at.AXIAL_STIFFNESS * lanes + j]) - inboard
    put_below(row, frame, pulley, hanging, comoving, lanes, j)


@scalar
def put_below(row: Array, frame: Array, pulley: Vector, hanging: float, comoving: float, lanes: int, j: int) -> Vector:
    """Put the load ``hanging`` m below S, which is at ``pulley`` in {D}; return the velocity of S."""
    turned = nine(frame, flex.ROTATION, lanes, j)
    place = add(three(frame, flex.ORIGIN, lanes, j), apply(turned, pulley))
    turning = apply(turned, cross(three(frame, flex.SPIN, lanes, j), pulley))
    velocity = add(three(frame, flex.ORIGIN + 3, lanes, j), turning)
    put_three(row, at.LOAD_POSITION, lanes, j, Vector(place.x, place.y, place.z - hanging))
    put_three(row, at.LOAD_VELOCITY, lanes, j, scaled(comoving, velocity))
    row[at.OMEGA2 * lanes + j] = abs(row[(at.LOAD_POSITION + 2) * lanes + j] - row[at.TARGET * lanes + j])
    return velocity


@scalar
def pull_head(row: Array, frame: Array, deflection: Vector, lanes: int, j: int) -> None:
    """Find the rope's force at the start, and the load's acceleration that follows from it."""
    pulley = add(three(row, at.PULLEY_ON_DECK, lanes, j), deflection)
    turned = nine(frame, flex.ROTATION, lanes, j)
    load, velocity = three(row, at.LOAD_POSITION, lanes, j), three(row, at.LOAD_VELOCITY, lanes, j)
    mass, gravity = row[at.MASS * lanes + j], row[at.GRAVITY * lanes + j]
    still = Vector(0.0, 0.0, 0.0)
    pull = iterate_tension(
        Pull(0.0, 0.0, 0.0, still, still),
        Unloaded(
            pulley,
            still,
            apply_transposed(turned, difference(load, three(frame, flex.ORIGIN, lanes, j))),
            apply_transposed(turned, difference(velocity, three(frame, flex.ORIGIN + 3, lanes, j))),
            three(frame, flex.DRUM, lanes, j),
            three(frame, flex.SPIN, lanes, j),
        ),
        Compliance(NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, NOTHING, 0.0, 0.0),
        PaidOut(
            row[at.FREE_LENGTH * lanes + j],
            0.0,
            row[at.AXIAL_STIFFNESS * lanes + j],
            row[at.ROPE_DAMPING * lanes + j],
        ),
    )
    force, n = pull.tension, apply(turned, pull.to_load)
    frame[flex.LOAD_ACCELERATION * lanes + j] = -force / mass * n.x
    frame[(flex.LOAD_ACCELERATION + 1) * lanes + j] = -force / mass * n.y
    frame[(flex.LOAD_ACCELERATION + 2) * lanes + j] = -force / mass * n.z - gravity
    for k in range(3):
        towards = pull.to_load[k] + pull.to_drum[k]
        frame[(flex.PULL + k) * lanes + j] = force * towards
        frame[(flex.ELASTIC + k) * lanes + j] = pull.elastic * towards
        frame[(flex.GROWTH + k) * lanes + j] = pull.growth * towards
    row[at.TENSION * lanes + j] = force
    row[at.PEAK_TENSION * lanes + j] = force
    row[at.SLACK * lanes + j] = 1.0 if force <= 0.0 else 0.0


@scalar
def release(frame: Array, table: Array, lanes: int, j: int) -> None:
    """Find what the deck does to the modes as they are."""
    modes, carried = int(table[flex.COUNT]), int(table[flex.CARRIED_COUNT])
    for b in range(carried):
        mode = flex.MODES + flex.MODE_SLOTS * b
        place, rate = frame[(mode + flex.POSITION) * lanes + j], frame[(mode + flex.RATE) * lanes + j]
        write_carried(frame, slots_of(frame, flex.CARRIED + 9 * b, 9, lanes), place, rate, lanes, j)
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        uniform, turning = three(table, c + flex.FIELD, 1, 0), nine(table, c + flex.FIELD + 3, 1, 0)
        total = deck_force(frame, uniform, turning, lanes, j)
        if i < carried:
            matrix = flex.HEAD + flex.MODE_SIZE * modes + 9 * carried * i
            for k in range(9 * carried):
                total += table[matrix + k] * frame[(flex.CARRIED + k) * lanes + j]
        frame[(flex.MODES + flex.MODE_SLOTS * i + flex.FORCE) * lanes + j] = total
