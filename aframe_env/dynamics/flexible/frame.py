"""The frame's modes over one inner step: Newmark's scheme, implicit in the rope's force at its end.

η(h) = η + h η̇ + (1/2 - β) h² η̈ + β h² η̈(h), η̇(h) = η̇ + (h/2)(η̈ + η̈(h)), with η̈ + ΦᵀLΦ η̇ + ω² η = F at the end. F is
linear in the rope's force at S, so that a step is a first pass without it, the rope's equation in three dimensions
(``pull``), and a second pass.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.blocks import nine, three

Array = npt.NDArray[np.float64]


@scalar
def carry(frame: Array, table: Array, carried: int, lanes: int) -> None:
    """Write CARRIED from the carried modes' displacement and rate as the step's end is foreseen."""
    h = table[flex.STEP]
    for b in range(carried):
        mode = flex.MODES + flex.MODE_SLOTS * b
        first = flex.CARRIED + 9 * b
        for j in range(lanes):
            velocity = frame[(mode + flex.RATE) * lanes + j]
            acceleration = frame[(mode + flex.ACCELERATION) * lanes + j]
            place = frame[(mode + flex.POSITION) * lanes + j] + h * (velocity + 0.5 * h * acceleration)
            write_carried(frame, first, place, velocity + h * acceleration, lanes, j)


@scalar
def write_carried(frame: Array, first: int, place: float, velocity: float, lanes: int, j: int) -> None:
    """W_cd η + 2 Ω×_cd η̇ of one mode into nine slots from ``first``."""
    for k in range(9):
        frame[(first + k) * lanes + j] = frame[(flex.INPUT + 3 + k) * lanes + j] * place
    x = 2.0 * velocity * frame[flex.SPIN * lanes + j]
    y = 2.0 * velocity * frame[(flex.SPIN + 1) * lanes + j]
    z = 2.0 * velocity * frame[(flex.SPIN + 2) * lanes + j]
    frame[(first + 1) * lanes + j] -= z
    frame[(first + 2) * lanes + j] += y
    frame[(first + 3) * lanes + j] += z
    frame[(first + 5) * lanes + j] -= x
    frame[(first + 6) * lanes + j] -= y
    frame[(first + 7) * lanes + j] += x


@scalar
def deck_force(
    frame: Array, uniform: tuple[float, ...], turning: tuple[float, ...], lanes: int, j: int
) -> float:
    """Weight and inertial terms of the deck's motion on a mode of the undeformed frame."""
    force = 0.0
    for k in range(3):
        force += uniform[k] * frame[(flex.INPUT + k) * lanes + j]
    for k in range(9):
        force += turning[k] * frame[(flex.INPUT + 3 + k) * lanes + j]
    return force


@scalar
def predict(frame: Array, table: Array, lanes: int) -> None:
    """First pass: modes to the step's end without the rope's force there, and TIP.

    POSITION and RATE become the end's share that is known already, ACCELERATION that without the rope's force. Lanes
    that are not ACTIVE stay as they are.
    """
    modes, carried, coupled, h = int(table[flex.COUNT]), int(table[flex.CARRIED_COUNT]), table[flex.COUPLED], table[3]
    matrix = flex.HEAD + flex.MODE_SIZE * modes
    carry(frame, table, carried, lanes)
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = flex.MODES + flex.MODE_SLOTS * i
        square, damping = table[c + flex.SQUARE], table[c + flex.DAMPING]
        early, late, inverse = table[c + flex.EARLY], table[c + flex.LATE], table[c + flex.INVERSE]
        for j in range(lanes):
            frame[(mode + flex.RIGHT) * lanes + j] = 0.0
        if i < carried:
            for b in range(carried):
                factors = nine(table, matrix + 9 * (carried * i + b), 1, 0)
                for j in range(lanes):
                    force = 0.0
                    for k in range(9):
                        force += factors[k] * frame[(flex.CARRIED + 9 * b + k) * lanes + j]
                    frame[(mode + flex.RIGHT) * lanes + j] += force
        # Constants are read before the loop over lanes: within it a store might have changed them, for all that
        # the compiler knows, and the loop would not be vectorised.
        uniform, turning = three(table, c + flex.FIELD, 1, 0), nine(table, c + flex.FIELD + 3, 1, 0)
        for j in range(lanes):
            active = frame[flex.ACTIVE * lanes + j] > 0.0
            place, rate, before = (
                frame[(mode + flex.POSITION) * lanes + j],
                frame[(mode + flex.RATE) * lanes + j],
                frame[(mode + flex.ACCELERATION) * lanes + j],
            )
            force = deck_force(frame, uniform, turning, lanes, j)
            force += frame[(mode + flex.RIGHT) * lanes + j]
            new_place = place + h * rate + early * before
            new_rate = rate + 0.5 * h * before
            force -= square * new_place
            frame[(mode + flex.RIGHT) * lanes + j] = force + (2.0 / h) * (1.0 + late * square) * new_rate
            acceleration = (force - damping * new_rate) * inverse
            frame[(mode + flex.POSITION) * lanes + j] = new_place if active else place
            frame[(mode + flex.RATE) * lanes + j] = new_rate if active else rate
            frame[(mode + flex.ACCELERATION) * lanes + j] = acceleration if active else before
    if coupled > 0.0:
        solve_coupled(frame, table, modes, lanes)
    sum_tip(frame, table, modes, lanes)


@scalar
def solve_coupled(frame: Array, table: Array, modes: int, lanes: int) -> None:
    """ACCELERATION where the damping couples the modes: the step's matrix A inverted beforehand.

    With h L / 2 = A - 1 - β h² ω² the damping force of the known rate needs no product of its own.
    """
    h = table[flex.STEP]
    inverse = flex.HEAD + flex.MODE_SIZE * modes + 9 * int(table[flex.CARRIED_COUNT]) * int(table[flex.CARRIED_COUNT])
    for i in range(modes):
        mode = flex.MODES + flex.MODE_SLOTS * i
        for j in range(lanes):
            active = frame[flex.ACTIVE * lanes + j] > 0.0
            before = frame[(mode + flex.ACCELERATION) * lanes + j]
            start = -(2.0 / h) * frame[(mode + flex.RATE) * lanes + j]
            frame[(mode + flex.ACCELERATION) * lanes + j] = start if active else before
        for k in range(modes):
            factor = table[inverse + modes * i + k]
            right = flex.MODES + flex.MODE_SLOTS * k + flex.RIGHT
            for j in range(lanes):
                active = frame[flex.ACTIVE * lanes + j] > 0.0
                share = factor * frame[right * lanes + j]
                frame[(mode + flex.ACCELERATION) * lanes + j] += share if active else 0.0


@scalar
def sum_tip(frame: Array, table: Array, modes: int, lanes: int) -> None:
    """TIP from the modes as they are: what S would do without the rope's force at the step's end."""
    half = 0.5 * table[flex.STEP]
    for k in range(6):
        for j in range(lanes):
            frame[(flex.TIP + k) * lanes + j] = 0.0
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = flex.MODES + flex.MODE_SLOTS * i
        s1, s2, s3 = table[c + flex.SHAPE], table[c + flex.SHAPE + 1], table[c + flex.SHAPE + 2]
        late = table[c + flex.LATE]
        for j in range(lanes):
            acceleration = frame[(mode + flex.ACCELERATION) * lanes + j]
            place = frame[(mode + flex.POSITION) * lanes + j] + late * acceleration
            rate = frame[(mode + flex.RATE) * lanes + j] + half * acceleration
            frame[flex.TIP * lanes + j] += s1 * place
            frame[(flex.TIP + 1) * lanes + j] += s2 * place
            frame[(flex.TIP + 2) * lanes + j] += s3 * place
            frame[(flex.TIP + 3) * lanes + j] += s1 * rate
            frame[(flex.TIP + 4) * lanes + j] += s2 * rate
            frame[(flex.TIP + 5) * lanes + j] += s3 * rate


@scalar
def finish(frame: Array, table: Array, lanes: int) -> None:
    """Second pass: the rope's force PULL at the step's end added, and the modes brought there."""
    half = 0.5 * table[flex.STEP]
    for i in range(int(table[flex.COUNT])):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = flex.MODES + flex.MODE_SLOTS * i
        r1, r2, r3 = table[c + flex.RESPONSE], table[c + flex.RESPONSE + 1], table[c + flex.RESPONSE + 2]
        late = table[c + flex.LATE]
        for j in range(lanes):
            active = frame[flex.ACTIVE * lanes + j] > 0.0
            place, rate, free = (
                frame[(mode + flex.POSITION) * lanes + j],
                frame[(mode + flex.RATE) * lanes + j],
                frame[(mode + flex.ACCELERATION) * lanes + j],
            )
            acceleration = (
                free
                + r1 * frame[flex.PULL * lanes + j]
                + r2 * frame[(flex.PULL + 1) * lanes + j]
                + r3 * frame[(flex.PULL + 2) * lanes + j]
            )
            frame[(mode + flex.POSITION) * lanes + j] = place + late * acceleration if active else place
            frame[(mode + flex.RATE) * lanes + j] = rate + half * acceleration if active else rate
            frame[(mode + flex.ACCELERATION) * lanes + j] = acceleration if active else free
