"""The frame's modes over one inner step: exact but for the forces, which are interpolated between its ends.

What the deck does goes along a straight line, the rope's elastic pull along a cubic by its values and rates at both
ends, so that the frame rings at its own frequencies and the rope feels it do so. The end of a step is linear in the
rope's force there: a step is a first pass without it, the rope's equation in three dimensions
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
        c = flex.HEAD + flex.MODE_SIZE * b
        square, damping = table[c + flex.SQUARE], table[c + flex.DAMPING]
        s1, s2, s3 = three(table, c + flex.SHAPE, 1, 0)
        products = slots_of(frame, flex.CARRIED + 9 * b, 9, lanes)
        for j in range(lanes):
            place, velocity = mode[flex.POSITION * lanes + j], mode[flex.RATE * lanes + j]
            f1, f2, f3 = three(frame, flex.PULL, lanes, j)
            force = mode[flex.FORCE * lanes + j] + (s1 * f1 + s2 * f2 + s3 * f3)
            acceleration = force - square * place - damping * velocity
            place += h * (velocity + 0.5 * h * acceleration)
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
def predict_modes(frame: Array, table: Array, lanes: int) -> None:
    """Take the modes to the step's end without the rope's force there, and write TIP: the first pass.

    Lanes that are not ACTIVE stay as they are.
    """
    modes, carried = int(table[flex.COUNT]), int(table[flex.CARRIED_COUNT])
    coupled = table[flex.COUPLED] > 0.0
    carry(frame, table, carried, lanes)
    for k in range(6):
        for j in range(lanes):
            frame[(flex.TIP + k) * lanes + j] = 0.0
    for i in range(modes):
        c = flex.HEAD + flex.MODE_SIZE * i
        mode = mode_of(frame, i, lanes)
        load_mode(frame, mode, table, i, modes, carried, lanes)
        if not coupled:
            step_mode(frame, mode, table, c, lanes)
            add_to_tip(frame, mode, three(table, c + flex.SHAPE, 1, 0), lanes)
    if coupled:
        step_coupled_modes(frame, table, modes, carried, lanes)


@scalar
def step_mode(frame: Array, mode: Array, table: Array, c: int, lanes: int) -> None:
    """Take a mode by itself to the step's end; its constants begin at ``c`` in the table."""
    free0, free1 = table[c + flex.FREE], table[c + flex.FREE + 1]
    free2, free3 = table[c + flex.FREE + 2], table[c + flex.FREE + 3]
    linear0, linear1 = table[c + flex.LINEAR], table[c + flex.LINEAR + 1]
    linear2, linear3 = table[c + flex.LINEAR + 2], table[c + flex.LINEAR + 3]
    cubic0, cubic1 = table[c + flex.CUBIC], table[c + flex.CUBIC + 1]
    cubic2, cubic3 = table[c + flex.CUBIC + 2], table[c + flex.CUBIC + 3]
    s1, s2, s3 = three(table, c + flex.SHAPE, 1, 0)
    for j in range(lanes):
        active = frame[flex.ACTIVE * lanes + j] > 0.0
        place, rate = mode[flex.POSITION * lanes + j], mode[flex.RATE * lanes + j]
        before, after = mode[flex.FORCE * lanes + j], mode[flex.RIGHT * lanes + j]
        f1, f2, f3 = three(frame, flex.PULL, lanes, j)
        e1, e2, e3 = three(frame, flex.ELASTIC, lanes, j)
        g1, g2, g3 = three(frame, flex.GROWTH, lanes, j)
        elastic, growth = s1 * e1 + s2 * e2 + s3 * e3, s1 * g1 + s2 * g2 + s3 * g3
        start = before + (s1 * f1 + s2 * f2 + s3 * f3) - elastic
        new_place = (free0 * place + free1 * rate) + (linear0 * start + linear1 * after)
        new_rate = (free2 * place + free3 * rate) + (linear2 * start + linear3 * after)
        new_place += cubic0 * elastic + cubic1 * growth
        new_rate += cubic2 * elastic + cubic3 * growth
        mode[flex.POSITION * lanes + j] = new_place if active else place
        mode[flex.RATE * lanes + j] = new_rate if active else rate
        mode[flex.FORCE * lanes + j] = after if active else before


@scalar
def step_coupled_modes(frame: Array, table: Array, modes: int, carried: int, lanes: int) -> None:
    """Take modes that the damping couples to the step's end, and write TIP."""
    first = flex.HEAD + flex.MODE_SIZE * modes + 9 * carried * carried
    for i in range(modes):
        mode = mode_of(frame, i, lanes)
        for row in range(2):
            for j in range(lanes):
                mode[(flex.NEXT + row) * lanes + j] = 0.0
            for k in range(modes):
                m = first + modes * modes * flex.MATRICES * row + modes * i + k
                free0, free1 = table[m], table[m + modes * modes]
                linear0, linear1 = table[m + 2 * modes * modes], table[m + 3 * modes * modes]
                cubic0, cubic1 = table[m + 4 * modes * modes], table[m + 5 * modes * modes]
                s1, s2, s3 = three(table, flex.HEAD + flex.MODE_SIZE * k + flex.SHAPE, 1, 0)
                other = mode_of(frame, k, lanes)
                for j in range(lanes):
                    f1, f2, f3 = three(frame, flex.PULL, lanes, j)
                    e1, e2, e3 = three(frame, flex.ELASTIC, lanes, j)
                    g1, g2, g3 = three(frame, flex.GROWTH, lanes, j)
                    elastic, growth = s1 * e1 + s2 * e2 + s3 * e3, s1 * g1 + s2 * g2 + s3 * g3
                    start = other[flex.FORCE * lanes + j] + (s1 * f1 + s2 * f2 + s3 * f3) - elastic
                    moved = free0 * other[flex.POSITION * lanes + j] + free1 * other[flex.RATE * lanes + j]
                    forced = linear0 * start + linear1 * other[flex.RIGHT * lanes + j]
                    mode[(flex.NEXT + row) * lanes + j] += moved + forced + cubic0 * elastic + cubic1 * growth
    for i in range(modes):
        mode = mode_of(frame, i, lanes)
        for j in range(lanes):
            active = frame[flex.ACTIVE * lanes + j] > 0.0
            place, rate = mode[flex.POSITION * lanes + j], mode[flex.RATE * lanes + j]
            before, after = mode[flex.FORCE * lanes + j], mode[flex.RIGHT * lanes + j]
            mode[flex.POSITION * lanes + j] = mode[flex.NEXT * lanes + j] if active else place
            mode[flex.RATE * lanes + j] = mode[(flex.NEXT + 1) * lanes + j] if active else rate
            mode[flex.FORCE * lanes + j] = after if active else before
        add_to_tip(frame, mode, three(table, flex.HEAD + flex.MODE_SIZE * i + flex.SHAPE, 1, 0), lanes)


@scalar
def add_to_tip(frame: Array, mode: Array, shape: tuple[float, float, float], lanes: int) -> None:
    """Add a mode's part to TIP: the motion of S without the rope's force at the step's end."""
    s1, s2, s3 = shape
    for j in range(lanes):
        place, rate = mode[flex.POSITION * lanes + j], mode[flex.RATE * lanes + j]
        frame[flex.TIP * lanes + j] += s1 * place
        frame[(flex.TIP + 1) * lanes + j] += s2 * place
        frame[(flex.TIP + 2) * lanes + j] += s3 * place
        frame[(flex.TIP + 3) * lanes + j] += s1 * rate
        frame[(flex.TIP + 4) * lanes + j] += s2 * rate
        frame[(flex.TIP + 5) * lanes + j] += s3 * rate


@scalar
def correct_modes(frame: Array, table: Array, lanes: int) -> None:
    """Add the rope's force at the step's end and bring the modes there: the second pass."""
    for i in range(int(table[flex.COUNT])):
        c = flex.HEAD + flex.MODE_SIZE * i + flex.RESPONSE
        mode = mode_of(frame, i, lanes)
        place_by, rate_by = nine(table, c, 1, 0), nine(table, c + 9, 1, 0)
        for j in range(lanes):
            active = frame[flex.ACTIVE * lanes + j] > 0.0
            place, rate = mode[flex.POSITION * lanes + j], mode[flex.RATE * lanes + j]
            f1, f2, f3 = three(frame, flex.PULL, lanes, j)
            e1, e2, e3 = three(frame, flex.ELASTIC, lanes, j)
            g1, g2, g3 = three(frame, flex.GROWTH, lanes, j)
            parts = (e1, e2, e3, g1, g2, g3, f1 - e1, f2 - e2, f3 - e3)
            mode[flex.POSITION * lanes + j] = place + dot(place_by, parts) if active else place
            mode[flex.RATE * lanes + j] = rate + dot(rate_by, parts) if active else rate
