"""Fourth-order Runge-Kutta step of the load on its rope, with the running Ω1 integral beside it."""

from __future__ import annotations

from aframe_env.dynamics.compiling import fma, larger, scalar
from aframe_env.dynamics.simplified import load_acceleration

RopeEnd = tuple[float, float, float, float, float, float, float, float, float]
"""Pulley position (3) and velocity (3), unstretched rope length [m], its rate [m/s], stiffness c_R [N/m]."""


@scalar
def rk4_step(
    x1: float,
    x2: float,
    x3: float,
    v1: float,
    v2: float,
    v3: float,
    start: RopeEnd,
    middle: RopeEnd,
    end: RopeEnd,
    h: float,
    target: float,
    drum_to_pulley: float,
    damping: float,
    inverse_mass: float,
    gravity: float,
) -> tuple[float, float, float, float, float, float, float, float]:
    """One step of length h [s]: new position (3) and velocity (3), ∫(x_L3 - h)² dt, greatest tension.

    ``start``, ``middle``, ``end``: the rope's upper end at the three times that the scheme looks at. A step of length 0
    changes nothing.
    """
    p = (drum_to_pulley, damping, inverse_mass, gravity)
    half = 0.5 * h
    a1, a2, a3, force1 = load_acceleration(x1, x2, x3, v1, v2, v3, *start, *p)
    y1, y2, y3 = fma(half, v1, x1), fma(half, v2, x2), fma(half, v3, x3)
    w1, w2, w3 = fma(half, a1, v1), fma(half, a2, v2), fma(half, a3, v3)
    b1, b2, b3, force2 = load_acceleration(y1, y2, y3, w1, w2, w3, *middle, *p)
    z1, z2, z3 = fma(half, w1, x1), fma(half, w2, x2), fma(half, w3, x3)
    u1, u2, u3 = fma(half, b1, v1), fma(half, b2, v2), fma(half, b3, v3)
    c1, c2, c3, force3 = load_acceleration(z1, z2, z3, u1, u2, u3, *middle, *p)
    q1, q2, q3 = fma(h, u1, x1), fma(h, u2, x2), fma(h, u3, x3)
    r1, r2, r3 = fma(h, c1, v1), fma(h, c2, v2), fma(h, c3, v3)
    d1, d2, d3, force4 = load_acceleration(q1, q2, q3, r1, r2, r3, *end, *p)
    sixth = h * (1.0 / 6.0)
    e1, e2, e3, e4 = x3 - target, y3 - target, z3 - target, q3 - target
    return (
        fma(sixth, fma(2.0, w1 + u1, v1 + r1), x1),
        fma(sixth, fma(2.0, w2 + u2, v2 + r2), x2),
        fma(sixth, fma(2.0, w3 + u3, v3 + r3), x3),
        fma(sixth, fma(2.0, b1 + c1, a1 + d1), v1),
        fma(sixth, fma(2.0, b2 + c2, a2 + d2), v2),
        fma(sixth, fma(2.0, b3 + c3, a3 + d3), v3),
        sixth * fma(2.0, fma(e2, e2, e3 * e3), fma(e1, e1, e4 * e4)),
        larger(larger(force1, force2), larger(force3, force4)),
    )
