"""A drum with inertia under torque, eqs. (23), (24): its angle, its speed and what the drive keeps are states.

I φ'' = M + r (T + ½ N² / E F), with T the tension on the drum's side of the pulley and N its part from the stretch
alone: rope that leaves the drum takes strain energy along. A proportional-integral loop asks the motors for the torque

M_m = G (ω_w - φ') + Q - f r T_f,    Q' = (M_l - (Q - f r T_f)) / t,    T_f' = (T - T_f) / t_f,

M_l being M_m within what the motors can. Short of that limit Q' is G (ω_w - φ') / t; at it Q goes to what the motors
give (back-calculation), so that it does not wind up. The gear lets M = η M_l through while the motors turn the drum,
and M_l / η while it turns them.

The speed ω_w that is wanted is the one that the drum would have if it went as it is told: ``exchange_drum`` puts that
drum in the place of the real one while ``winch`` is asked.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import fma, larger, scalar, smaller
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.lift import (
    END_OVER,
    FILTERED,
    INTEGRAL,
    LENGTH,
    PAY_OUT,
    TURN,
    TURN_RATE,
    advance_slot,
    aim,
    divide,
)

Array = npt.NDArray[np.float64]

STOPPED: Final = 0.01
"""Speed of the drum below which its brake may fall, rad/s."""


@scalar
def begin_drive(row: Array, span: Span) -> None:
    """Let brakes fall or rise at the start of a segment, and have the wanted drum start where the real one is."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.DRIVE * lanes + j] > 0.0:
            speed, wanted = row[at.DRUM_SPEED * lanes + j], row[at.SET_SPEED * lanes + j]
            stopped = abs(speed) < STOPPED and abs(wanted) < STOPPED
            braked = row[at.BRAKED * lanes + j] > 0.0
            falls = row[at.BRAKE * lanes + j] > 0.0 and row[at.COMMAND * lanes + j] == 0.0 and (braked or stopped)
            if falls and not braked:
                row[at.DRUM_SPEED * lanes + j] = 0.0
                row[at.SET_SPEED * lanes + j] = 0.0
            row[at.BRAKED * lanes + j] = 1.0 if falls else 0.0
            row[at.SET_ANGLE * lanes + j] = row[at.DRUM_ANGLE * lanes + j]


@scalar
def exchange_drum(row: Array, span: Span) -> None:
    """Put the drum that is wanted in the place of the real one, and that aside; or back again."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.DRIVE * lanes + j] > 0.0:
            angle, speed = row[at.DRUM_ANGLE * lanes + j], row[at.DRUM_SPEED * lanes + j]
            row[at.DRUM_ANGLE * lanes + j] = row[at.SET_ANGLE * lanes + j]
            row[at.DRUM_SPEED * lanes + j] = row[at.SET_SPEED * lanes + j]
            row[at.SET_ANGLE * lanes + j], row[at.SET_SPEED * lanes + j] = angle, speed


@scalar
def want(row: Array, start: float, middle: float, end: float, lanes: int, j: int) -> None:
    """Have lane j's drum, if it has a drive, pay out at these speeds over the inner step, m/s."""
    if row[at.DRIVE * lanes + j] > 0.0:
        inverse = 1.0 / row[at.DRUM_RADIUS * lanes + j]
        row[at.WANTED * lanes + j] = inverse * start
        row[(at.WANTED + 1) * lanes + j] = inverse * middle
        row[(at.WANTED + 2) * lanes + j] = inverse * end


@scalar
def take_wanted(row: Array, span: Span) -> None:
    """Take the wanted speeds at start, middle and end of the inner step from ENDS."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        slot = at.ENDS + PAY_OUT
        start, middle = row[slot * lanes + j], row[(slot + at.END_SIZE) * lanes + j]
        want(row, start, middle, row[(slot + 2 * at.END_SIZE) * lanes + j], lanes, j)


@scalar
def place_drum(row: Array, source: int, end: int, span: Span) -> None:
    """Write to ENDS the rope that is out in a stage, the drum's and what a flexible frame hands over, and its rate."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.DRIVE * lanes + j] > 0.0:
            radius, angle = row[at.DRUM_RADIUS * lanes + j], row[(source + TURN) * lanes + j]
            over, over_rate = row[(end + END_OVER) * lanes + j], row[(end + END_OVER + 1) * lanes + j]
            row[(end + LENGTH) * lanes + j] = fma(radius, angle, row[at.FREE_LENGTH * lanes + j]) + over
            row[(end + PAY_OUT) * lanes + j] = radius * row[(source + TURN_RATE) * lanes + j] + over_rate


@scalar
def pull_of_rope(row: Array, source: int, end: int, lanes: int, j: int) -> float:
    """Torque of the rope on lane j's drum, N m, once a stage has found its tension."""
    line, rope = aim(row, source, end, lanes, j), divide(row, source, end, lanes, j)
    springs, place = int(rope.springs), line.away
    if springs > 1:
        place = row[(source + springs - 1) * lanes + j]
    stretch = larger(place - rope.drum - rope.top_length, 0.0)
    intact = 1.0 - row[at.PARTED * lanes + j]
    elastic = rope.slide * fma(rope.top_stiffness, stretch, intact * row[at.HALF_WEIGHT * lanes + j])
    tension = fma(0.5 * rope.softness * elastic, elastic, row[at.TENSION * lanes + j])
    pull: float = row[at.DRUM_RADIUS * lanes + j] * tension
    return pull


@scalar
def within(row: Array, torque: float, speed: float, lanes: int, j: int) -> float:
    """Torque that lane j's motors give of what they are asked for, at the drum without the gear's losses, N m."""
    most, power = row[at.MOTOR * lanes + j], row[(at.MOTOR + 1) * lanes + j]
    most = power / larger(abs(speed), power / most)
    return smaller(larger(torque, -most), most)


@scalar
def drive_drum(row: Array, source: int, target: int, end: int, fraction: float, weight: float, span: Span) -> None:
    """Accelerate drums with inertia by their drives and ropes, once a stage has found the tension."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        inertia = row[at.DRIVE * lanes + j]
        if inertia > 0.0:
            pull, speed = pull_of_rope(row, source, end, lanes, j), row[(source + TURN_RATE) * lanes + j]
            tension, filtered = row[at.TENSION * lanes + j], row[(source + FILTERED) * lanes + j]
            filter_rate, integral = row[at.FILTER_RATE * lanes + j], row[(source + INTEGRAL) * lanes + j]
            measured = filtered if filter_rate > 0.0 else tension
            relief = integral - row[at.FEEDFORWARD * lanes + j] * row[at.DRUM_RADIUS * lanes + j] * measured
            wanted = row[(at.WANTED + (end - at.ENDS) // at.END_SIZE) * lanes + j]
            mean, half = row[at.GEAR * lanes + j], row[(at.GEAR + 1) * lanes + j]
            braked = row[at.BRAKED * lanes + j] > 0.0
            # Under a fallen brake the loop is made ready for what it will have to hold.
            asked = -pull / mean if braked else fma(row[at.GAIN * lanes + j], wanted - speed, relief)
            motors = within(row, asked, speed, lanes, j)
            integral_rate = row[at.INTEGRAL_RATE * lanes + j] * (motors - relief)
            if braked:
                # The rope can only pull out: so a brake that slips slips that way.
                motors, torque = 0.0, 0.0
                brake = row[at.BRAKE * lanes + j]
                speed = larger(speed, 0.0)
                acceleration = (pull - brake) / inertia if speed > 0.0 or pull > brake else 0.0
            else:
                creep = row[(at.GEAR + 2) * lanes + j]
                way = speed / math.sqrt(fma(speed, speed, creep * creep))
                torque = fma(mean, motors, -half * abs(motors) * way)
                acceleration = (pull + torque) / inertia
            row[at.DRIVE_TORQUE * lanes + j] = torque
            row[at.DRIVE_POWER * lanes + j] = motors * speed
            advance_slot(row, TURN, speed, source, target, fraction, weight, lanes, j)
            advance_slot(row, TURN_RATE, acceleration, source, target, fraction, weight, lanes, j)
            advance_slot(row, INTEGRAL, integral_rate, source, target, fraction, weight, lanes, j)
            advance_slot(row, FILTERED, filter_rate * (tension - filtered), source, target, fraction, weight, lanes, j)


@scalar
def settle_drum(row: Array, span: Span) -> None:
    """Stop drums with inertia at the limit switches, and such as have slipped to rest under their brakes."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.DRIVE * lanes + j] > 0.0:
            angle, speed = row[at.DRUM_ANGLE * lanes + j], row[at.DRUM_SPEED * lanes + j]
            least, most = row[at.MIN_ANGLE * lanes + j], row[at.MAX_ANGLE * lanes + j]
            if angle <= least or row[at.BRAKED * lanes + j] > 0.0:
                speed = larger(speed, 0.0)
            if angle >= most:
                speed = smaller(speed, 0.0)
            row[at.DRUM_ANGLE * lanes + j] = smaller(larger(angle, least), most)
            row[at.DRUM_SPEED * lanes + j] = speed


@scalar
def hold_load(row: Array, end: int, span: Span) -> None:
    """Have drives hold what hangs on their drums at the start, a stage with ``end`` having just been measured."""
    lanes = span.stride
    for j in range(span.begin, span.end):
        if row[at.DRIVE * lanes + j] > 0.0:
            pull = pull_of_rope(row, at.LIFT, end, lanes, j)
            tension, share = row[at.TENSION * lanes + j], row[at.FEEDFORWARD * lanes + j]
            held = within(row, -pull / row[at.GEAR * lanes + j], 0.0, lanes, j)
            row[at.FILTERED * lanes + j] = tension
            row[at.INTEGRAL * lanes + j] = fma(share * row[at.DRUM_RADIUS * lanes + j], tension, held)
            row[at.DRIVE_TORQUE * lanes + j] = row[at.GEAR * lanes + j] * held
            row[at.DRIVE_POWER * lanes + j] = 0.0
