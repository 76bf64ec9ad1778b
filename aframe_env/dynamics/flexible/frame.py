"""The frame's modes over one inner step: Newmark's scheme, implicit in the rope's force at its end.

η(h) = η + h η̇ + (1/2 - β) h² η̈ + β h² η̈(h), η̇(h) = η̇ + (h/2)(η̈ + η̈(h)), with η̈ + ΦᵀLΦ η̇ + ω² η = F at the end. F is
linear in the rope's force at S, so that a step is a first pass without it, the rope's equation in three dimensions
(``step_rope_and_load``), and a second pass.

Constants, and the slots of a mode as an array of their own, are taken before each loop over lanes: only so can the
compiler tell what a store may change, and vectorise the loop.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.blocks import nine, three
from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.flexible import layout as flex

Array = npt.NDArray[np.float64]


@scalar
def slots_of(frame: Array, first: int, size: int, lanes: int) -> Array:
    """``size`` slots of a block from ``first``, as an array."""
    return frame[first * lanes : (first + size) * lanes]


@scalar
def mode_of(frame: Array, mode: int, lanes: int) -> Array:
    """Slots of a mode."""
    return slots_of(frame, flex.MODES + flex.MODE_SLOTS * mode, flex.MODE_SLOTS, lanes)


@scalar
def carry(frame: Array, table: Array, carried: int, lanes: int) -> None:
    """Write CARRIED from the carried modes' displacement and rate as predicted for the step's end."""
    h = table[flex.STEP]
    for b in range(carried):
        mode = mode_of(frame, b, lanes)
        products = slots_of(frame, flex.CARRIED + 9 * b, 9, lanes)
        for j in range(lanes):
            velocity, acceleration = mode[flex.RATE * lanes + j], mode[flex.ACCELERATION * lanes + j]
            place = mode[flex.POSITION * lanes + j] + h * (velocity + 0.5 * h * acceleration)
            write_carried(frame, products, place, velocity + h * acceleration, lanes, j)


@scalar
def write_carried(frame: Array, products: Array, place: float, velocity: float, lanes: int, j: int) -> None:
    """Write W_cd η + 2 Ω×_cd η̇ of one mode into ``products`` (9 slots)."""
    x = 2.0 * velocity * frame[flex.SPIN * lanes + j]
    y = 2.0 * velocity * frame[(flex.SPIN + 1) * lanes + j]
    z = 2.0 * velocity * frame[(flex.SPIN + 2) * lanes + j]
    w = nine(frame, flex.INPUT + 3, lanes, j)
    products[j] = w[0] * place
    products[lanes + j] = w[1] * place - z
    products[2 * lanes + j] = w[2] * place + y
    products[3 * lanes + j] = w[3] * place + z
    products[4 * lanes + j] = w[4] * place
    products[5 * lanes + j] = w[5] * place - x
    products[6 * lanes + j] = w[6] * place - y
    products[7 * lanes + j] = w[7] * place + x
    products[8 * lanes + j] = w[8] * place


@scalar
def dot(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Inner product of nine numbers with nine."""
    return (
        (a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
        + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
        + (a[6] * b[6] + a[7] * b[7] + a[8] * b[8])
    )


@scalar
def deck_force(frame: Array, uniform: tuple[float, ...], turning: tuple[float, ...], lanes: int, j: int) -> float:
    """Weight and inertial terms of the deck's motion on a mode of the undeformed frame."""
    x, y, z = three(frame, flex.INPUT, lanes, j)
    return uniform[0] * x + uniform[1] * y + uniform[2] * z + dot(turning, nine(frame, flex.INPUT + 3, lanes, j))


@scalar
def load_mode(frame: Array, mode: Array, table: Array, i: int, modes: int, carried: int, lanes: int) -> None:
    """Write RIGHT of mode i: weight and inertial terms, those of the carried modes' displacement and rate included."""
    c = flex.HEAD + flex.MODE_SIZE * i
    uniform, turning = three(table, c + flex.FIELD, 1, 0), nine(table, c + flex.FIELD + 3, 1, 0)
    for j in range(lanes):
        mode[flex.RIGHT * lanes + j] = deck_force(frame, uniform, turning, lanes, j)
    if i < carried:
        for b in range(carried):
            first = flex.HEAD + flex.MODE_SIZE * modes + 9 * (carried * i + b)
            factors = nine(table, first, 1, 0)
            products = slots_of(frame, flex.CARRIED + 9 * b, 9, lanes)
            for j in range(lanes):
                mode[flex.RIGHT * lanes + j] += dot(factors, nine(products, 0, lanes, j))


@scalar
def newmark_predict(frame: Array, table: Array, lanes: int) -> None:
    """Take the modes to the step's end without the rope's force there, and write TIP: the first pass.

    POSITION and RATE become the end's share that is known already, ACCELERATION that without the rope's force. Lanes
    that are not ACTIVE stay as they are.
    """
    modes, carried, h = int(table[flex.COUNT]), int(table[flex.CARRIED_COUNT]), table[flex.STEP]
    coupled = table[flex.COUPLED] > 0.0
    half, twice = 0.5 * h, 2.0 / h
    carry(frame, table, carried, lanes)
    for k in range(6):
        for j in range(lanes):
            frame[(flex.TIP + k) * lanes + j] = 0.0
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = mode_of(frame, i, lanes)
        load_mode(frame, mode, table, i, modes, carried, lanes)
        square, damping, inverse = table[c + flex.SQUARE], table[c + flex.DAMPING], table[c + flex.INVERSE]
        early, late = table[c + flex.EARLY], table[c + flex.LATE]
        softened = twice * (1.0 + late * square)
        for j in range(lanes):
            active = frame[flex.ACTIVE * lanes + j] > 0.0
            place, rate = mode[flex.POSITION * lanes + j], mode[flex.RATE * lanes + j]
            before = mode[flex.ACCELERATION * lanes + j]
            new_place = place + h * rate + early * before
            new_rate = rate + half * before
            force = mode[flex.RIGHT * lanes + j] - square * new_place
            mode[flex.RIGHT * lanes + j] = force + softened * new_rate
            acceleration = (force - damping * new_rate) * inverse
            mode[flex.POSITION * lanes + j] = new_place if active else place
            mode[flex.RATE * lanes + j] = new_rate if active else rate
            mode[flex.ACCELERATION * lanes + j] = acceleration if active else before
        if not coupled:
            add_to_tip(frame, mode, three(table, c + flex.SHAPE, 1, 0), late, half, lanes)
    if coupled:
        solve_coupled(frame, table, modes, carried, lanes)


@scalar
def solve_coupled(frame: Array, table: Array, modes: int, carried: int, lanes: int) -> None:
    """Write ACCELERATION and TIP where the damping couples the modes: the step's matrix A is inverted beforehand.

    With h L / 2 = A - 1 - β h² ω² the damping force of the known rate needs no product of its own.
    """
    h = table[flex.STEP]
    twice = 2.0 / h
    inverse = flex.HEAD + flex.MODE_SIZE * modes + 9 * carried * carried
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = mode_of(frame, i, lanes)
        for j in range(lanes):
            active = frame[flex.ACTIVE * lanes + j] > 0.0
            before, start = mode[flex.ACCELERATION * lanes + j], -twice * mode[flex.RATE * lanes + j]
            mode[flex.ACCELERATION * lanes + j] = start if active else before
        for k in range(modes):
            factor = table[inverse + modes * i + k]
            other = mode_of(frame, k, lanes)
            for j in range(lanes):
                share = factor * other[flex.RIGHT * lanes + j]
                mode[flex.ACCELERATION * lanes + j] += share * frame[flex.ACTIVE * lanes + j]
        add_to_tip(frame, mode, three(table, c + flex.SHAPE, 1, 0), table[c + flex.LATE], 0.5 * h, lanes)


@scalar
def add_to_tip(
    frame: Array, mode: Array, shape: tuple[float, float, float], late: float, half: float, lanes: int
) -> None:
    """Add a mode's part to TIP: the motion of S without the rope's force at the step's end."""
    s1, s2, s3 = shape
    for j in range(lanes):
        acceleration = mode[flex.ACCELERATION * lanes + j]
        place = mode[flex.POSITION * lanes + j] + late * acceleration
        rate = mode[flex.RATE * lanes + j] + half * acceleration
        frame[flex.TIP * lanes + j] += s1 * place
        frame[(flex.TIP + 1) * lanes + j] += s2 * place
        frame[(flex.TIP + 2) * lanes + j] += s3 * place
        frame[(flex.TIP + 3) * lanes + j] += s1 * rate
        frame[(flex.TIP + 4) * lanes + j] += s2 * rate
        frame[(flex.TIP + 5) * lanes + j] += s3 * rate


@scalar
def newmark_correct(frame: Array, table: Array, lanes: int) -> None:
    """Add the rope's force PULL at the step's end and bring the modes there: the second pass."""
    half = 0.5 * table[flex.STEP]
    for i in range(int(table[flex.COUNT])):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = mode_of(frame, i, lanes)
        r1, r2, r3 = three(table, c + flex.RESPONSE, 1, 0)
        late = table[c + flex.LATE]
        for j in range(lanes):
            active = frame[flex.ACTIVE * lanes + j] > 0.0
            place, rate = mode[flex.POSITION * lanes + j], mode[flex.RATE * lanes + j]
            free = mode[flex.ACCELERATION * lanes + j]
            f1, f2, f3 = three(frame, flex.PULL, lanes, j)
            acceleration = free + (r1 * f1 + r2 * f2 + r3 * f3)
            mode[flex.POSITION * lanes + j] = place + late * acceleration if active else place
            mode[flex.RATE * lanes + j] = rate + half * acceleration if active else rate
            mode[flex.ACCELERATION * lanes + j] = acceleration if active else free
