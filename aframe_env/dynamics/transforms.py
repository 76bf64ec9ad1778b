"""Rigid-body kinematics of the moving deck and of a point fixed in it, eq. (38): R = Rz(yaw) Ry(pitch) Rx(roll)."""

from __future__ import annotations

import math
from typing import Final

from aframe_env.dynamics.compiling import scalar

_TWO_OVER_PI: Final = 2.0 / math.pi
# pi/2 in three parts, the first two exact in few bits, so that x - n pi/2 stays right to the last digit.
_HALF_PI_A: Final = 1.5707963267341256
_HALF_PI_B: Final = 6.077100506303966e-11
_HALF_PI_C: Final = 2.0222662487959506e-21


@scalar
def sine_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine without a branch or a library call, to 2 units in the last place for \\|angle\\| < 1e5 rad.

    Cody-Waite reduction to [-pi/4, pi/4] and Taylor polynomials (truncation below 1e-16 there). A call of the C
    library here would keep the loop over rows from being vectorised.
    """
    quadrant = math.floor(angle * _TWO_OVER_PI + 0.5)
    x = ((angle - quadrant * _HALF_PI_A) - quadrant * _HALF_PI_B) - quadrant * _HALF_PI_C
    z = x * x
    s = x + x * z * (
        -1.0 / 6.0
        + z
        * (
            1.0 / 120.0
            + z
            * (
                -1.0 / 5040.0
                + z * (1.0 / 362880.0 + z * (-1.0 / 39916800.0 + z * (1.0 / 6227020800.0 - z / 1307674368000.0)))
            )
        )
    )
    c = 1.0 + z * (
        -0.5
        + z
        * (
            1.0 / 24.0
            + z
            * (
                -1.0 / 720.0
                + z
                * (
                    1.0 / 40320.0
                    + z
                    * (-1.0 / 3628800.0 + z * (1.0 / 479001600.0 + z * (-1.0 / 87178291200.0 + z / 20922789888000.0)))
                )
            )
        )
    )
    turns = quadrant - 4.0 * math.floor(quadrant * 0.25)  # 0, 1, 2 or 3
    swap = turns == 1.0 or turns == 3.0
    sine = c if swap else s
    cosine = s if swap else c
    sine = -sine if turns >= 2.0 else sine
    cosine = -cosine if turns == 1.0 or turns == 2.0 else cosine
    return sine, cosine


@scalar
def rotate_pair(
    p: float,
    q: float,
    dp: float,
    dq: float,
    ddp: float,
    ddq: float,
    angle: float,
    rate: float,
    acceleration: float,
) -> tuple[float, float, float, float, float, float]:
    """Turn the pair (p, q), with its two time derivatives, by a moving angle in its plane."""
    s, c = sine_cosine(angle)
    a = c * p - s * q
    b = s * p + c * q
    da = c * dp - s * dq
    db = s * dp + c * dq
    dda = c * ddp - s * ddq
    ddb = s * ddp + c * ddq
    return (
        a,
        b,
        da - rate * b,
        db + rate * a,
        dda - 2.0 * rate * db - acceleration * b - rate * rate * a,
        ddb + 2.0 * rate * da + acceleration * a - rate * rate * b,
    )


@scalar
def turn(
    roll: float, pitch: float, yaw: float, p: float, q: float, r: float, pp: float, qq: float, rr: float
) -> tuple[
    tuple[float, float, float, float, float, float, float, float, float],
    tuple[float, float, float],
    tuple[float, float, float],
]:
    """Rotation {D} → base, eq. (38), row-major; angular velocity and acceleration along {D}; from the angles
    [rad], their rates (p, q, r) and accelerations (pp, qq, rr)."""
    sr, cr = sine_cosine(roll)
    sp, cp = sine_cosine(pitch)
    sy, cy = sine_cosine(yaw)
    rotation = (
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    )
    spin = (p - r * sp, q * cr + r * cp * sr, -q * sr + r * cp * cr)
    spin_up = (
        pp - rr * sp - r * cp * q,
        qq * cr - q * sr * p + rr * cp * sr - r * sp * q * sr + r * cp * cr * p,
        -qq * sr - q * cr * p + rr * cp * cr - r * sp * q * cr - r * cp * sr * p,
    )
    return rotation, spin, spin_up
