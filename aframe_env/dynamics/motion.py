"""Motion of the deck and of the pulley on it, over a block of rows.

Each wave component is a complex number of modulus one, turned by one constant factor a control step: no sine in
the loop. Rounding drifts by about 1e-16 a step, 1e-11 after ten hours of 0.1 s steps. Between the two ends of a
control step T the pulley follows the quintic through position, velocity and acceleration at both ends; for a
component of amplitude A and frequency ω its error is at most A (ωT)^6 / 46080 (5e-9 A at 2.5 rad/s and 0.1 s).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.transforms import rotate_pair

Block = npt.NDArray[np.float64]


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
def turn_components(row: Block, components: int, lanes: int) -> None:
    """Advance the phase of each wave component by one control step."""
    for k in range(components):
        base = at.ROW_SLOTS + k * at.COMPONENT_SLOTS
        for j in range(lanes):
            re = row[(base + at.PHASE_RE) * lanes + j]
            im = row[(base + at.PHASE_IM) * lanes + j]
            turn_re = row[(base + at.TURN_RE) * lanes + j]
            turn_im = row[(base + at.TURN_IM) * lanes + j]
            row[(base + at.PHASE_RE) * lanes + j] = re * turn_re - im * turn_im
            row[(base + at.PHASE_IM) * lanes + j] = re * turn_im + im * turn_re


@scalar
def sum_components(row: Block, components: int, lanes: int) -> None:
    """Deck coordinates, rates and accelerations from the wave components, before the ramp.

    UNROLL components at a time: the sums stay in registers meanwhile, which halves the cost.
    """
    for i in range(18):
        for j in range(lanes):
            row[(at.MOTION + i) * lanes + j] = 0.0
    for dof in range(6):
        for group in range(components // at.UNROLL):
            first = at.ROW_SLOTS + group * at.UNROLL * at.COMPONENT_SLOTS
            for j in range(lanes):
                position, rate, acceleration = 0.0, 0.0, 0.0
                for k in range(at.UNROLL):
                    base = first + k * at.COMPONENT_SLOTS
                    re = row[(base + at.PHASE_RE) * lanes + j]
                    im = row[(base + at.PHASE_IM) * lanes + j]
                    frequency = row[(base + at.FREQUENCY) * lanes + j]
                    a = row[(base + at.RESPONSE + dof) * lanes + j]
                    b = row[(base + at.RESPONSE + 6 + dof) * lanes + j]
                    part = a * re - b * im
                    position += part
                    rate -= frequency * (a * im + b * re)
                    acceleration -= frequency * frequency * part
                row[(at.MOTION + dof) * lanes + j] += position
                row[(at.MOTION + 6 + dof) * lanes + j] += rate
                row[(at.MOTION + 12 + dof) * lanes + j] += acceleration


@scalar
def read_record(row: Block, records: npt.NDArray[np.float64], lanes: int) -> None:
    """Deck coordinates of rows that follow a recorded motion: the table's line at the row's time.

    After the last line the deck stands still where that line has it.
    """
    for j in range(lanes):
        first = int(row[at.RECORD * lanes + j])
        if first >= 0:
            line = int(row[at.STEP * lanes + j])
            last = int(row[at.RECORD_LENGTH * lanes + j]) - 1
            moving = 1.0 if line <= last else 0.0
            line = line if line < last else last
            for i in range(6):
                row[(at.MOTION + i) * lanes + j] = records[first + line, i]
            for i in range(6, 18):
                row[(at.MOTION + i) * lanes + j] = moving * records[first + line, i]


@scalar
def place_pulley(row: Block, lanes: int) -> None:
    """Apply the ramp to the deck's motion, and carry the pulley with the deck, eq. (38)."""
    for j in range(lanes):
        r, dr, ddr = smooth_ramp(
            row[at.TIME * lanes + j], row[at.RAMP_RATE * lanes + j], row[at.RAMP_OFFSET * lanes + j]
        )
        for dof in range(6):
            q = row[(at.MOTION + dof) * lanes + j]
            dq = row[(at.MOTION + 6 + dof) * lanes + j]
            row[(at.MOTION + dof) * lanes + j] = r * q
            row[(at.MOTION + 6 + dof) * lanes + j] = r * dq + dr * q
            row[(at.MOTION + 12 + dof) * lanes + j] = (
                r * row[(at.MOTION + 12 + dof) * lanes + j] + 2.0 * dr * dq + ddr * q
            )
    for j in range(lanes):
        x = row[at.PULLEY_ON_DECK * lanes + j]
        y = row[(at.PULLEY_ON_DECK + 1) * lanes + j]
        z = row[(at.PULLEY_ON_DECK + 2) * lanes + j]
        angle, rate, acceleration = (
            row[(at.MOTION + 3) * lanes + j],
            row[(at.MOTION + 9) * lanes + j],
            row[(at.MOTION + 15) * lanes + j],
        )
        y, z, dy, dz, ddy, ddz = rotate_pair(y, z, 0.0, 0.0, 0.0, 0.0, angle, rate, acceleration)
        angle, rate, acceleration = (
            row[(at.MOTION + 4) * lanes + j],
            row[(at.MOTION + 10) * lanes + j],
            row[(at.MOTION + 16) * lanes + j],
        )
        z, x, dz, dx, ddz, ddx = rotate_pair(z, x, dz, 0.0, ddz, 0.0, angle, rate, acceleration)
        angle, rate, acceleration = (
            row[(at.MOTION + 5) * lanes + j],
            row[(at.MOTION + 11) * lanes + j],
            row[(at.MOTION + 17) * lanes + j],
        )
        x, y, dx, dy, ddx, ddy = rotate_pair(x, y, dx, dy, ddx, ddy, angle, rate, acceleration)
        row[at.PULLEY * lanes + j] = x + row[at.MOTION * lanes + j]
        row[(at.PULLEY + 1) * lanes + j] = y + row[(at.MOTION + 1) * lanes + j]
        row[(at.PULLEY + 2) * lanes + j] = z + row[(at.MOTION + 2) * lanes + j]
        row[(at.PULLEY + 3) * lanes + j] = dx + row[(at.MOTION + 6) * lanes + j]
        row[(at.PULLEY + 4) * lanes + j] = dy + row[(at.MOTION + 7) * lanes + j]
        row[(at.PULLEY + 5) * lanes + j] = dz + row[(at.MOTION + 8) * lanes + j]
        row[(at.PULLEY + 6) * lanes + j] = ddx + row[(at.MOTION + 12) * lanes + j]
        row[(at.PULLEY + 7) * lanes + j] = ddy + row[(at.MOTION + 13) * lanes + j]
        row[(at.PULLEY + 8) * lanes + j] = ddz + row[(at.MOTION + 14) * lanes + j]


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
    """Position and velocity on the quintic."""
    position = c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5))))
    velocity = c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * (5.0 * c5))))
    return position, velocity


@scalar
def advance_motion(row: Block, components: int, records: npt.NDArray[np.float64], lanes: int) -> None:
    """Advance the deck by one segment, and lay the quintic through the pulley's path over it."""
    for i in range(9):
        for j in range(lanes):
            row[(at.PATH + i) * lanes + j] = row[(at.PULLEY + i) * lanes + j]
    for j in range(lanes):
        row[at.STEP * lanes + j] += 1.0
        row[at.TIME * lanes + j] = row[at.STEP * lanes + j] * row[at.CONTROL_PERIOD * lanes + j]
    turn_components(row, components, lanes)
    pose_deck(row, components, records, lanes)
    for j in range(lanes):
        duration = row[at.CONTROL_PERIOD * lanes + j]
        p1, p2, p3 = row[at.PATH * lanes + j], row[(at.PATH + 1) * lanes + j], row[(at.PATH + 2) * lanes + j]
        v1, v2, v3 = (
            row[(at.PATH + 3) * lanes + j],
            row[(at.PATH + 4) * lanes + j],
            row[(at.PATH + 5) * lanes + j],
        )
        a1, a2, a3 = (
            row[(at.PATH + 6) * lanes + j],
            row[(at.PATH + 7) * lanes + j],
            row[(at.PATH + 8) * lanes + j],
        )
        x = quintic(
            p1,
            v1,
            a1,
            row[at.PULLEY * lanes + j],
            row[(at.PULLEY + 3) * lanes + j],
            row[(at.PULLEY + 6) * lanes + j],
            duration,
        )
        y = quintic(
            p2,
            v2,
            a2,
            row[(at.PULLEY + 1) * lanes + j],
            row[(at.PULLEY + 4) * lanes + j],
            row[(at.PULLEY + 7) * lanes + j],
            duration,
        )
        z = quintic(
            p3,
            v3,
            a3,
            row[(at.PULLEY + 2) * lanes + j],
            row[(at.PULLEY + 5) * lanes + j],
            row[(at.PULLEY + 8) * lanes + j],
            duration,
        )
        for i in range(6):
            row[(at.PATH + i) * lanes + j] = x[i]
            row[(at.PATH + 6 + i) * lanes + j] = y[i]
            row[(at.PATH + 12 + i) * lanes + j] = z[i]
        row[at.TIP * lanes + j], row[(at.TIP + 1) * lanes + j], row[(at.TIP + 2) * lanes + j] = p1, p2, p3
        row[(at.TIP + 3) * lanes + j], row[(at.TIP + 4) * lanes + j], row[(at.TIP + 5) * lanes + j] = (
            v1,
            v2,
            v3,
        )


@scalar
def pose_deck(row: Block, components: int, records: npt.NDArray[np.float64], lanes: int) -> None:
    """Deck and pulley at the row's time, from the phases of the components (or the record)."""
    sum_components(row, components, lanes)
    if records.shape[0] > 0:
        read_record(row, records, lanes)
    place_pulley(row, lanes)
