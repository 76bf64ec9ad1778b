"""Motion of the deck and of the pulley on it, over a block of rows.

The waves are summed at nodes, up to four motion segments apart: each component is a complex number of modulus one,
turned by one constant factor from node to node, no sine in the loop. Rounding drifts by about 1e-16 a node, 1e-12
after ten hours. From node to node, T apart, deck and pulley follow the quintic through position, velocity and
acceleration at both; for a component of amplitude A and frequency ω its error is at most A (ωT)^6 / 46080.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import fma, scalar
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.transforms import rotate_pair
from aframe_env.dynamics.vector import Vector

Block = npt.NDArray[np.float64]

FEW: Final = 6
"""Rows of a block that are quicker alone than all the block's together."""


@scalar
def smooth_ramp(time: float, rate: float, offset: float) -> tuple[float, float, float]:
    """Build-up factor of the motion and its two derivatives: the quintic smoothstep of rate·time + offset."""
    s = rate * time + offset
    s = 1.0 if s > 1.0 else s
    moving = rate if s < 1.0 else 0.0
    factor = s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
    first = 30.0 * s * s * (1.0 + s * (-2.0 + s))
    second = 60.0 * s * (1.0 + s * (-3.0 + 2.0 * s))
    return factor, first * moving, second * moving * moving


@scalar
def turn_components(row: Block, group: int, span: Span) -> None:
    """Advance the phases of a group of UNROLL wave components to the next node, in the lanes that are due."""
    lanes = span.stride
    for k in range(group * at.UNROLL, (group + 1) * at.UNROLL):
        base = at.ROW_SLOTS + k * at.COMPONENT_SLOTS
        for j in range(span.begin, span.end):
            due = row[at.DUE * lanes + j] > 0.0
            re = row[(base + at.PHASE_RE) * lanes + j]
            im = row[(base + at.PHASE_IM) * lanes + j]
            turn_re = row[(base + at.TURN_RE) * lanes + j]
            turn_im = row[(base + at.TURN_IM) * lanes + j]
            row[(base + at.PHASE_RE) * lanes + j] = fma(re, turn_re, -im * turn_im) if due else re
            row[(base + at.PHASE_IM) * lanes + j] = fma(re, turn_im, im * turn_re) if due else im


@scalar
def add_component(
    a: float, b: float, re: float, im: float, frequency: float, position: float, rate: float, acceleration: float
) -> tuple[float, float, float]:
    """Add Re((a + i b) exp(i ω t)) to a coordinate, its rate and its acceleration; re + i im is exp(i ω t)."""
    part = fma(a, re, -b * im)
    turned = fma(a, im, b * re)
    return position + part, fma(-frequency, turned, rate), fma(-frequency * frequency, part, acceleration)


@scalar
def sum_components(row: Block, components: int, span: Span) -> None:
    """Turn the wave components and sum deck coordinates, rates and accelerations at the next node, before the ramp.

    UNROLL components and three coordinates at a time: the sums stay in registers meanwhile, the components in cache.
    """
    lanes = span.stride
    for i in range(18):
        for j in range(span.begin, span.end):
            row[(at.NODE + i) * lanes + j] = 0.0
    for group in range(components // at.UNROLL):
        turn_components(row, group, span)
        begin = at.ROW_SLOTS + group * at.UNROLL * at.COMPONENT_SLOTS
        for first in (0, 3):
            for j in range(span.begin, span.end):
                p1, v1, a1, p2, v2, a2, p3, v3, a3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
                for k in range(at.UNROLL):
                    base = begin + k * at.COMPONENT_SLOTS
                    re = row[(base + at.PHASE_RE) * lanes + j]
                    im = row[(base + at.PHASE_IM) * lanes + j]
                    w = row[(base + at.FREQUENCY) * lanes + j]
                    real, imaginary = base + at.RESPONSE + first, base + at.RESPONSE + 6 + first
                    p1, v1, a1 = add_component(row[real * lanes + j], row[imaginary * lanes + j], re, im, w, p1, v1, a1)
                    p2, v2, a2 = add_component(
                        row[(real + 1) * lanes + j], row[(imaginary + 1) * lanes + j], re, im, w, p2, v2, a2
                    )
                    p3, v3, a3 = add_component(
                        row[(real + 2) * lanes + j], row[(imaginary + 2) * lanes + j], re, im, w, p3, v3, a3
                    )
                c = at.NODE + first
                row[c * lanes + j] += p1
                row[(c + 1) * lanes + j] += p2
                row[(c + 2) * lanes + j] += p3
                row[(c + 6) * lanes + j] += v1
                row[(c + 7) * lanes + j] += v2
                row[(c + 8) * lanes + j] += v3
                row[(c + 12) * lanes + j] += a1
                row[(c + 13) * lanes + j] += a2
                row[(c + 14) * lanes + j] += a3


@scalar
def read_record(row: Block, records: npt.NDArray[np.float64], span: Span) -> None:
    """Read the deck coordinates of rows that follow a recorded motion: the table's line at the next node.

    After the last line the deck stands still where that line has it.
    """
    lanes = span.stride
    for j in range(span.begin, span.end):
        first = int(row[at.RECORD * lanes + j])
        if first >= 0:
            line = int(row[at.NODE_STEP * lanes + j])
            last = int(row[at.RECORD_LENGTH * lanes + j]) - 1
            moving = 1.0 if line <= last else 0.0
            line = line if line < last else last
            for i in range(6):
                row[(at.NODE + i) * lanes + j] = records[first + line, i]
            for i in range(6, 18):
                row[(at.NODE + i) * lanes + j] = moving * records[first + line, i]


@scalar
def place_pulley(row: Block, span: Span) -> None:
    """Apply the ramp to the deck's motion, and carry the pulley with the deck, eq. (38), at the next node.

    The motion builds up from nothing, the yaw from YAW_START. The pulley's own motion on the deck is turned with it.
    """
    lanes = span.stride
    for j in range(span.begin, span.end):
        time = row[at.NODE_STEP * lanes + j] * row[at.CONTROL_PERIOD * lanes + j]
        r, dr, ddr = smooth_ramp(time, row[at.RAMP_RATE * lanes + j], row[at.RAMP_OFFSET * lanes + j])
        for dof in range(6):
            q = row[(at.NODE + dof) * lanes + j]
            dq = row[(at.NODE + 6 + dof) * lanes + j]
            row[(at.NODE + dof) * lanes + j] = r * q
            row[(at.NODE + 6 + dof) * lanes + j] = r * dq + dr * q
            row[(at.NODE + 12 + dof) * lanes + j] = r * row[(at.NODE + 12 + dof) * lanes + j] + 2.0 * dr * dq + ddr * q
        start = row[at.YAW_START * lanes + j]
        row[(at.NODE + 5) * lanes + j] += (1.0 - r) * start
        row[(at.NODE + 11) * lanes + j] -= dr * start
        row[(at.NODE + 17) * lanes + j] -= ddr * start
    for j in range(span.begin, span.end):
        x, dx, ddx = row[at.TIP * lanes + j], row[(at.TIP + 3) * lanes + j], row[(at.TIP + 6) * lanes + j]
        y, dy, ddy = row[(at.TIP + 1) * lanes + j], row[(at.TIP + 4) * lanes + j], row[(at.TIP + 7) * lanes + j]
        z, dz, ddz = row[(at.TIP + 2) * lanes + j], row[(at.TIP + 5) * lanes + j], row[(at.TIP + 8) * lanes + j]
        angle, rate, acceleration = (
            row[(at.NODE + 3) * lanes + j],
            row[(at.NODE + 9) * lanes + j],
            row[(at.NODE + 15) * lanes + j],
        )
        y, z, dy, dz, ddy, ddz = rotate_pair(y, z, dy, dz, ddy, ddz, angle, rate, acceleration)
        angle, rate, acceleration = (
            row[(at.NODE + 4) * lanes + j],
            row[(at.NODE + 10) * lanes + j],
            row[(at.NODE + 16) * lanes + j],
        )
        z, x, dz, dx, ddz, ddx = rotate_pair(z, x, dz, dx, ddz, ddx, angle, rate, acceleration)
        angle, rate, acceleration = (
            row[(at.NODE + 5) * lanes + j],
            row[(at.NODE + 11) * lanes + j],
            row[(at.NODE + 17) * lanes + j],
        )
        x, y, dx, dy, ddx, ddy = rotate_pair(x, y, dx, dy, ddx, ddy, angle, rate, acceleration)
        row[at.NODE_PULLEY * lanes + j] = x + row[at.NODE * lanes + j]
        row[(at.NODE_PULLEY + 1) * lanes + j] = y + row[(at.NODE + 1) * lanes + j]
        row[(at.NODE_PULLEY + 2) * lanes + j] = z + row[(at.NODE + 2) * lanes + j]
        row[(at.NODE_PULLEY + 3) * lanes + j] = dx + row[(at.NODE + 6) * lanes + j]
        row[(at.NODE_PULLEY + 4) * lanes + j] = dy + row[(at.NODE + 7) * lanes + j]
        row[(at.NODE_PULLEY + 5) * lanes + j] = dz + row[(at.NODE + 8) * lanes + j]
        row[(at.NODE_PULLEY + 6) * lanes + j] = ddx + row[(at.NODE + 12) * lanes + j]
        row[(at.NODE_PULLEY + 7) * lanes + j] = ddy + row[(at.NODE + 13) * lanes + j]
        row[(at.NODE_PULLEY + 8) * lanes + j] = ddz + row[(at.NODE + 14) * lanes + j]


@scalar
def quintic(
    p0: float, v0: float, a0: float, p1: float, v1: float, a1: float, duration: float
) -> tuple[float, float, float, float, float, float]:
    """Coefficients of the quintic in time through position, velocity and acceleration at both ends."""
    inverse = 1.0 / duration
    dp = (p1 - p0 - v0 * duration - 0.5 * a0 * duration * duration) * inverse * inverse * inverse
    dv = (v1 - v0 - a0 * duration) * inverse * inverse
    da = (a1 - a0) * inverse
    return (
        p0,
        v0,
        0.5 * a0,
        10.0 * dp - 4.0 * dv + 0.5 * da,
        (-15.0 * dp + 7.0 * dv - da) * inverse,
        (6.0 * dp - 3.0 * dv + 0.5 * da) * inverse * inverse,
    )


@scalar
def on_quintic(c0: float, c1: float, c2: float, c3: float, c4: float, c5: float, t: float) -> tuple[float, float]:
    """Position and velocity on the quintic: Horner's scheme, for the derivative along with the value."""
    velocity = c5
    position = fma(t, c5, c4)
    velocity = fma(t, velocity, position)
    position = fma(t, position, c3)
    velocity = fma(t, velocity, position)
    position = fma(t, position, c2)
    velocity = fma(t, velocity, position)
    position = fma(t, position, c1)
    velocity = fma(t, velocity, position)
    position = fma(t, position, c0)
    return position, velocity


@scalar
def second_derivative(c2: float, c3: float, c4: float, c5: float, t: float) -> float:
    """Second derivative of the quintic."""
    return 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5))


@scalar
def on_path(row: Block, axis: int, t: float, lanes: int, j: int) -> tuple[float, float]:
    """Position and velocity of lane j's pulley along an axis, ``t`` s after the node before."""
    c = at.PATH + 6 * axis
    return on_quintic(
        row[c * lanes + j],
        row[(c + 1) * lanes + j],
        row[(c + 2) * lanes + j],
        row[(c + 3) * lanes + j],
        row[(c + 4) * lanes + j],
        row[(c + 5) * lanes + j],
        t,
    )


@scalar
def pulley_on_path(row: Block, t: float, lanes: int, j: int) -> tuple[Vector, Vector]:
    """Position and velocity of lane j's pulley, ``t`` s after the node before."""
    x, u = on_path(row, 0, t, lanes, j)
    y, v = on_path(row, 1, t, lanes, j)
    z, w = on_path(row, 2, t, lanes, j)
    return Vector(x, y, z), Vector(u, v, w)


@scalar
def acceleration_on_path(row: Block, axis: int, t: float, lanes: int, j: int) -> float:
    """Acceleration of lane j's pulley along an axis, ``t`` s after the node before."""
    c = at.PATH + 6 * axis
    return second_derivative(
        row[(c + 2) * lanes + j], row[(c + 3) * lanes + j], row[(c + 4) * lanes + j], row[(c + 5) * lanes + j], t
    )


@scalar
def pulley_acceleration_on_path(row: Block, t: float, lanes: int, j: int) -> Vector:
    """Acceleration of lane j's pulley, ``t`` s after the node before."""
    return Vector(
        acceleration_on_path(row, 0, t, lanes, j),
        acceleration_on_path(row, 1, t, lanes, j),
        acceleration_on_path(row, 2, t, lanes, j),
    )


@scalar
def lay_path(row: Block, span: Span) -> None:
    """Lay the quintics through the pulley's path up to the next node, in the lanes that are due."""
    lanes = span.stride
    for axis in range(3):
        c, p = at.PATH + 6 * axis, at.PULLEY + axis
        for j in range(span.begin, span.end):
            due = row[at.DUE * lanes + j] > 0.0
            new = quintic(
                row[p * lanes + j],
                row[(p + 3) * lanes + j],
                row[(p + 6) * lanes + j],
                row[(at.NODE_PULLEY + axis) * lanes + j],
                row[(at.NODE_PULLEY + 3 + axis) * lanes + j],
                row[(at.NODE_PULLEY + 6 + axis) * lanes + j],
                row[at.NODE_SEGMENTS * lanes + j] * row[at.CONTROL_PERIOD * lanes + j],
            )
            for i in range(6):
                row[(c + i) * lanes + j] = new[i] if due else row[(c + i) * lanes + j]


@scalar
def pose_node(row: Block, components: int, records: npt.NDArray[np.float64], span: Span) -> None:
    """Pose deck and pulley at the next node, from the components (or the record)."""
    sum_components(row, components, span)
    if records.shape[0] > 0:
        read_record(row, records, span)
    place_pulley(row, span)


@scalar
def start_motion(row: Block, components: int, records: npt.NDArray[np.float64], span: Span) -> None:
    """Pose deck and pulley at the start, which is the first node."""
    lanes = span.stride
    pose_node(row, components, records, span)
    for i in range(18):
        for j in range(span.begin, span.end):
            row[(at.NODE_BEFORE + i) * lanes + j] = row[(at.NODE + i) * lanes + j]
    meet_node(row, span)


@scalar
def meet_node(row: Block, span: Span) -> None:
    """Put the pulley where it is at the node."""
    lanes = span.stride
    for i in range(9):
        for j in range(span.begin, span.end):
            row[(at.PULLEY + i) * lanes + j] = row[(at.NODE_PULLEY + i) * lanes + j]


@scalar
def go_to_next_node(row: Block, components: int, records: npt.NDArray[np.float64], span: Span) -> None:
    """Go on to the next node in the lanes that are due, and lay the path there."""
    lanes = span.stride
    for i in range(18):
        for j in range(span.begin, span.end):
            before, node = row[(at.NODE_BEFORE + i) * lanes + j], row[(at.NODE + i) * lanes + j]
            row[(at.NODE_BEFORE + i) * lanes + j] = node if row[at.DUE * lanes + j] > 0.0 else before
    pose_node(row, components, records, span)
    lay_path(row, span)


@scalar
def advance_motion(row: Block, components: int, records: npt.NDArray[np.float64], span: Span) -> None:
    """Begin a motion segment: where a row has come to its node, go on to the next.

    Where many rows of a block are due all of them go through it, those that are not to the numbers that they have;
    where few are, each goes alone.
    """
    lanes = span.stride
    due = 0.0
    for j in range(span.begin, span.end):
        own = 1.0 if row[at.STEP * lanes + j] == row[at.NODE_STEP * lanes + j] else 0.0
        row[at.DUE * lanes + j] = own
        row[at.NODE_STEP * lanes + j] += own * row[at.NODE_SEGMENTS * lanes + j]
        due += own
    if due > FEW:
        go_to_next_node(row, components, records, span)
    elif due > 0.0:
        for j in range(span.begin, span.end):
            if row[at.DUE * lanes + j] > 0.0:
                go_to_next_node(row, components, records, Span(lanes, j, j + 1))
    for j in range(span.begin, span.end):
        since_node = row[at.STEP * lanes + j] - row[at.NODE_STEP * lanes + j] + row[at.NODE_SEGMENTS * lanes + j]
        row[at.ELAPSED * lanes + j] = since_node * row[at.CONTROL_PERIOD * lanes + j]
        row[at.STEP * lanes + j] += 1.0
        row[at.TIME * lanes + j] = row[at.STEP * lanes + j] * row[at.CONTROL_PERIOD * lanes + j]


@scalar
def end_motion(row: Block, span: Span) -> None:
    """Write the acceleration of the pulley at the end of a segment."""
    lanes = span.stride
    for axis in range(3):
        c = at.PATH + 6 * axis
        for j in range(span.begin, span.end):
            row[(at.PULLEY + 6 + axis) * lanes + j] = second_derivative(
                row[(c + 2) * lanes + j],
                row[(c + 3) * lanes + j],
                row[(c + 4) * lanes + j],
                row[(c + 5) * lanes + j],
                row[at.ELAPSED * lanes + j] + row[at.CONTROL_PERIOD * lanes + j],
            )


@scalar
def deck_coordinate(row: Block, dof: int, lanes: int, j: int) -> float:
    """Coordinate ``dof`` of lane j's deck at the row's time."""
    period, segments = row[at.CONTROL_PERIOD * lanes + j], row[at.NODE_SEGMENTS * lanes + j]
    elapsed = (row[at.STEP * lanes + j] - row[at.NODE_STEP * lanes + j] + segments) * period
    c = quintic(
        row[(at.NODE_BEFORE + dof) * lanes + j],
        row[(at.NODE_BEFORE + 6 + dof) * lanes + j],
        row[(at.NODE_BEFORE + 12 + dof) * lanes + j],
        row[(at.NODE + dof) * lanes + j],
        row[(at.NODE + 6 + dof) * lanes + j],
        row[(at.NODE + 12 + dof) * lanes + j],
        segments * period,
    )
    return on_quintic(*c, elapsed)[0]
