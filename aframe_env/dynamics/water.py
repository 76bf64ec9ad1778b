"""Water about rope and load over a block of rows: current, waves, and what they do to a load under them.

The waves are those that move the ship, as deep water has them: a component of elevation a cos φ moves the water at the
depth d by ω a exp(-k d) (cos φ along its way, -sin φ upwards), k = ω²/g. Over a motion segment velocity and surface
go on as they accelerate and rise at its start.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import put_three, three
from aframe_env.dynamics.compiling import fma, larger, scalar, smaller
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.luffing import gone_out
from aframe_env.dynamics.motion import smooth_ramp
from aframe_env.dynamics.vector import Vector, along, difference, inner, scaled

Array = npt.NDArray[np.float64]

STILL: Final = 14.0
"""k d beyond which a wave no longer moves the water: by less than a millionth."""
NEAR: Final = 50.0
"""Depth of a load's top to which the surface is told, m."""


@scalar
def current(row: Array, level: float, lanes: int, j: int) -> tuple[float, float]:
    """Current of lane j's water at a level [m]: x and y, m/s; linear between the levels given, constant beyond."""
    count = int(row[at.CURRENT_POINTS * lanes + j])
    x, y = row[(at.CURRENT + at.CURRENT_MOST) * lanes + j], row[(at.CURRENT + 2 * at.CURRENT_MOST) * lanes + j]
    for k in range(1, count):
        upper, lower = row[(at.CURRENT + k - 1) * lanes + j], row[(at.CURRENT + k) * lanes + j]
        share = smaller(larger((upper - level) / (upper - lower), 0.0), 1.0)
        x = fma(share, row[(at.CURRENT + at.CURRENT_MOST + k) * lanes + j] - x, x)
        y = fma(share, row[(at.CURRENT + 2 * at.CURRENT_MOST + k) * lanes + j] - y, y)
    return x, y


@scalar
def waves_at(row: Array, level: float, back: float, lanes: int, j: int) -> tuple[Vector, Vector, float, float]:
    """Velocity and acceleration of lane j's water at a level, elevation of its surface and its rate.

    ``back``: time from now to the next node of the motion, at which the components have their phases, s. A frame that
    luffs takes the place of the load with it, through waves of other phases.
    """
    gravity = row[at.GRAVITY * lanes + j]
    depth = larger(row[at.SURFACE_LEVEL * lanes + j] - level, 0.0)
    time = row[at.NODE_STEP * lanes + j] * row[at.CONTROL_PERIOD * lanes + j] - back
    ramp, ramp_rate, _ = smooth_ramp(time, row[at.RAMP_RATE * lanes + j], row[at.RAMP_OFFSET * lanes + j])
    u, v, w, du, dv, dw, elevation, rate = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    out = gone_out(row, time, lanes, j)
    # The elevation counts near the surface only, so that deep down the loop is over short waves soon.
    shallow = depth < row[at.HALF_HEIGHT * lanes + j] + NEAR
    for k in range(int(row[at.WAVES * lanes + j])):
        base = at.ROW_SLOTS + k * at.COMPONENT_SLOTS
        frequency = row[(base + at.FREQUENCY) * lanes + j]
        number = frequency * frequency / gravity
        decay = number * depth
        if decay < STILL or shallow:
            re, im = row[(base + at.PHASE_RE) * lanes + j], row[(base + at.PHASE_IM) * lanes + j]
            x, y = row[(base + at.TOWARDS_X) * lanes + j], row[(base + at.TOWARDS_Y) * lanes + j]
            later = fma(number * x, out, frequency * back)
            c, s = math.cos(later), math.sin(later)
            re, im = fma(re, c, im * s), fma(im, c, -re * s)
            a, b = row[(base + at.ELEVATION_RE) * lanes + j], row[(base + at.ELEVATION_IM) * lanes + j]
            crest, slope = fma(a, re, -b * im), fma(a, im, b * re)
            elevation += crest
            rate = fma(-frequency, slope, rate)
            moved = frequency * math.exp(-decay)
            along_it, up = moved * crest, -moved * slope
            faster, higher = -moved * frequency * slope, -moved * frequency * crest
            u, v, w = fma(along_it, x, u), fma(along_it, y, v), w + up
            du, dv, dw = fma(faster, x, du), fma(faster, y, dv), dw + higher
    velocity = Vector(ramp * u, ramp * v, ramp * w)
    acceleration = Vector(fma(ramp, du, ramp_rate * u), fma(ramp, dv, ramp_rate * v), fma(ramp, dw, ramp_rate * w))
    return velocity, acceleration, ramp * elevation, fma(ramp, rate, ramp_rate * elevation)


@scalar
def begin_water(row: Array, span: Span) -> None:
    """Find the water's motion about the load, and its drag across the rope, ELAPSED s after the motion's node before.

    The current and the drag across the rope belong to swings of a minute; they are held over the segment.
    """
    lanes = span.stride
    for j in range(span.begin, span.end):
        position, velocity = three(row, at.LOAD_POSITION, lanes, j), three(row, at.LOAD_VELOCITY, lanes, j)
        pulley, pulley_rate = three(row, at.PULLEY, lanes, j), three(row, at.PULLEY + 3, lanes, j)
        line, turning = difference(position, pulley), difference(velocity, pulley_rate)
        x, y = current(row, position.z, lanes, j)
        flow, flow_rate, elevation, rising = Vector(0.0, 0.0, 0.0), Vector(0.0, 0.0, 0.0), 0.0, 0.0
        if row[at.WAVES * lanes + j] > 0.0:
            interval = row[at.NODE_SEGMENTS * lanes + j] * row[at.CONTROL_PERIOD * lanes + j]
            back = interval - row[at.ELAPSED * lanes + j]
            flow, flow_rate, elevation, rising = waves_at(row, position.z, back, lanes, j)
        put_three(row, at.FLOW, lanes, j, Vector(flow.x + x, flow.y + y, flow.z))
        put_three(row, at.FLOW_RATE, lanes, j, flow_rate)
        row[at.SURFACE * lanes + j] = row[at.SURFACE_LEVEL * lanes + j] + elevation
        row[(at.SURFACE + 1) * lanes + j] = rising
        row[at.MOMENT * lanes + j] = 0.0
        push = hold = Vector(0.0, 0.0, 0.0)
        drag = row[at.ACROSS_DRAG * lanes + j]
        if drag > 0.0:
            away = math.sqrt(inner(line, line) + 1e-18)
            axis = scaled(1.0 / away, line)
            pieces = max(int(row[at.SPRINGS * lanes + j]) - 1, 1)
            for i in range(pieces):
                # The middles of equal pieces, as the lumps are but for strain.
                lever = (i + 0.5) / pieces
                x, y = current(row, fma(lever, line.z, pulley.z), lanes, j)
                through = difference(along(pulley_rate, lever, turning), Vector(x, y, 0.0))
                across = along(through, -inner(axis, through), axis)
                force = -drag * (away / pieces) * math.sqrt(inner(across, across))
                push = along(push, lever * force, across)
                hold = along(hold, (1.0 - lever) * force, across)
        put_three(row, at.PUSH, lanes, j, push)
        put_three(row, at.PUSH + 3, lanes, j, hold)


@scalar
def begin_water_at_node(row: Array, span: Span) -> None:
    """Do what ``begin_water`` does where the motion is at its next node."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        row[at.ELAPSED * lanes + j] = row[at.NODE_SEGMENTS * lanes + j] * row[at.CONTROL_PERIOD * lanes + j]
    begin_water(row, span)
