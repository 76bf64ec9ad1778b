"""A frame that luffs: where the stroke of its servomotors takes the pulley, on the deck and from the drum.

The stroke goes from point to point along quintic smoothsteps. With N at r on the leg and C at c on the deck the length
L of a servomotor and the luffing angle φ are tied by L² = r² + c² - 2 r c sin φ; the pulley is at
(h sin φ, 0, h cos φ). That is exact at the nodes of the motion; in between the distance from the drum follows a quintic
as the pulley's path does.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three, three
from aframe_env.dynamics.compiling import larger, scalar
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.motion import on_quintic, quintic, smooth_ramp
from aframe_env.dynamics.vector import Vector, difference, inner

Array = npt.NDArray[np.float64]


@scalar
def leg_of_stroke(time: float, begin: float, end: float, change: float) -> tuple[float, float, float]:
    """What a leg of the way from ``begin`` to ``end`` [s] adds to the stroke, its rate and its acceleration.

    ``change`` of the stroke over the leg, m.
    """
    share, rate, bend = smooth_ramp(larger(time - begin, 0.0), 1.0 / (end - begin), 0.0)
    return change * share, change * rate, change * bend


@scalar
def pulley_of_stroke(
    length: float, speed: float, acceleration: float, height: float, deck_x: float, top: float
) -> tuple[Vector, Vector, Vector]:
    """Pulley in {D}, its velocity and its acceleration, by a servomotor's ``length`` [m] and its derivatives.

    The servomotor's ``height`` on the leg, its end's place ``deck_x`` on the deck, and the frame's ``top``, m.
    """
    inverse = 1.0 / (height * deck_x)
    sine = 0.5 * (height * height + deck_x * deck_x - length * length) * inverse
    rate = -length * speed * inverse
    bend = -(speed * speed + length * acceleration) * inverse
    cosine = math.sqrt(1.0 - sine * sine)
    fall = -sine * rate / cosine
    curve = -(rate * rate + sine * bend + fall * fall) / cosine
    return (
        Vector(top * sine, 0.0, top * cosine),
        Vector(top * rate, 0.0, top * fall),
        Vector(top * bend, 0.0, top * curve),
    )


@scalar
def reach_of(place: Vector, velocity: Vector, acceleration: Vector, drum: Vector) -> tuple[float, float, float]:
    """Distance from drum to pulley [m], its rate and its acceleration, all along {D}."""
    line = difference(place, drum)
    reach = math.sqrt(inner(line, line))
    rate = inner(line, velocity) / reach
    return reach, rate, (inner(velocity, velocity) + inner(line, acceleration) - rate * rate) / reach


@scalar
def tip_at(row: Array, time: float, lanes: int, j: int) -> tuple[Vector, Vector, Vector]:
    """Pulley in {D}, velocity and acceleration, ``time`` s after the start, of a lane j whose frame luffs."""
    length, speed, acceleration = row[(at.LUFFING + at.LUFFING_MOST) * lanes + j], 0.0, 0.0
    for k in range(1, int(row[at.LUFFING_POINTS * lanes + j])):
        time_slot = at.LUFFING + k
        length_slot = time_slot + at.LUFFING_MOST
        more, faster, harder = leg_of_stroke(
            time,
            row[(time_slot - 1) * lanes + j],
            row[time_slot * lanes + j],
            row[length_slot * lanes + j] - row[(length_slot - 1) * lanes + j],
        )
        length, speed, acceleration = length + more, speed + faster, acceleration + harder
    frame = three(row, at.LUFFING_FRAME, lanes, j)
    return pulley_of_stroke(length, speed, acceleration, frame.x, frame.y, frame.z)


@scalar
def swing_frame(row: Array, span: Span) -> None:
    """Find where frames that luff have the pulley at the node after next, in the lanes that have come to their node."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.LUFFING_POINTS * lanes + j] > 0.0 and row[at.STEP * lanes + j] == row[at.NODE_STEP * lanes + j]:
            segments, period = row[at.NODE_SEGMENTS * lanes + j], row[at.CONTROL_PERIOD * lanes + j]
            place, velocity, acceleration = tip_at(row, (row[at.NODE_STEP * lanes + j] + segments) * period, lanes, j)
            put_three(row, at.TIP, lanes, j, place)
            put_three(row, at.TIP + 3, lanes, j, velocity)
            put_three(row, at.TIP + 6, lanes, j, acceleration)
            before = three(row, at.REACH, lanes, j)
            after = reach_of(place, velocity, acceleration, three(row, at.DRUM_ON_DECK, lanes, j))
            path = quintic(before.x, before.y, before.z, after[0], after[1], after[2], segments * period)
            for k in range(3):
                row[(at.REACH + k) * lanes + j] = after[k]
            for k in range(6):
                row[(at.REACH_PATH + k) * lanes + j] = path[k]


@scalar
def reach_on_path(row: Array, since_node: float, lanes: int, j: int) -> tuple[float, float]:
    """Distance from drum to pulley and its rate, ``since_node`` s after the node before."""
    return on_quintic(
        row[at.REACH_PATH * lanes + j],
        row[(at.REACH_PATH + 1) * lanes + j],
        row[(at.REACH_PATH + 2) * lanes + j],
        row[(at.REACH_PATH + 3) * lanes + j],
        row[(at.REACH_PATH + 4) * lanes + j],
        row[(at.REACH_PATH + 5) * lanes + j],
        since_node,
    )


@scalar
def tell_angle(row: Array, span: Span) -> None:
    """Write the luffing angle of frames that luff at the rows' time."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.LUFFING_POINTS * lanes + j] > 0.0:
            place, _, _ = tip_at(row, row[at.TIME * lanes + j], lanes, j)
            row[at.LUFFING_ANGLE * lanes + j] = math.atan2(place.x, place.z)


@scalar
def gone_out(row: Array, time: float, lanes: int, j: int) -> float:
    """How far outboard of where it started lane j's pulley is in {D}, ``time`` s after the start, m."""
    if row[at.LUFFING_POINTS * lanes + j] > 0.0:
        place, _, _ = tip_at(row, time, lanes, j)
        out: float = place.x - row[at.PULLEY_ON_DECK * lanes + j]
        return out
    return 0.0
