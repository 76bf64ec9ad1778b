"""Fourth-order Runge-Kutta step of the load on its rope, with the running Ω1 integral beside it."""

from __future__ import annotations

from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.simplified import load_acceleration


@scalar
def rk4_step(
    x1: float,
    x2: float,
    x3: float,
    v1: float,
    v2: float,
    v3: float,
    start: tuple[float, float, float, float, float, float, float, float],
    middle: tuple[float, float, float, float, float, float, float, float],
    end: tuple[float, float, float, float, float, float, float, float],
    h: float,
    target: float,
    drum_to_pulley: float,
    axial_stiffness: float,
    damping: float,
    mass: float,
    gravity: float,
) -> tuple[float, float, float, float, float, float, float, float]:
    """One step of length h [s]: new position (3) and velocity (3), ∫(x_L3 - h)² dt, greatest tension.

    ``start``, ``middle``, ``end``: pulley position (3) and velocity (3), unstretched rope length and its rate, at
    the three times that the scheme looks at. A step of length 0 changes nothing.
    """
    p = (drum_to_pulley, axial_stiffness, damping, mass, gravity)
    half = 0.5 * h
    a1, a2, a3, force1 = load_acceleration(x1, x2, x3, v1, v2, v3, *start, *p)
    y1, y2, y3 = x1 + half * v1, x2 + half * v2, x3 + half * v3
    w1, w2, w3 = v1 + half * a1, v2 + half * a2, v3 + half * a3
    b1, b2, b3, force2 = load_acceleration(y1, y2, y3, w1, w2, w3, *middle, *p)
    z1, z2, z3 = x1 + half * w1, x2 + half * w2, x3 + half * w3
    u1, u2, u3 = v1 + half * b1, v2 + half * b2, v3 + half * b3
    c1, c2, c3, force3 = load_acceleration(z1, z2, z3, u1, u2, u3, *middle, *p)
    q1, q2, q3 = x1 + h * u1, x2 + h * u2, x3 + h * u3
    r1, r2, r3 = v1 + h * c1, v2 + h * c2, v3 + h * c3
    d1, d2, d3, force4 = load_acceleration(q1, q2, q3, r1, r2, r3, *end, *p)
    sixth = h / 6.0
    e1, e2, e3, e4 = x3 - target, y3 - target, z3 - target, q3 - target
    peak = force1 if force1 > force2 else force2
    peak = force3 if force3 > peak else peak
    peak = force4 if force4 > peak else peak
    return (
        x1 + sixth * (v1 + 2.0 * (w1 + u1) + r1),
        x2 + sixth * (v2 + 2.0 * (w2 + u2) + r2),
        x3 + sixth * (v3 + 2.0 * (w3 + u3) + r3),
        v1 + sixth * (a1 + 2.0 * (b1 + c1) + d1),
        v2 + sixth * (a2 + 2.0 * (b2 + c2) + d2),
        v3 + sixth * (a3 + 2.0 * (b3 + c3) + d3),
        sixth * (e1 * e1 + 2.0 * (e2 * e2 + e3 * e3) + e4 * e4),
        peak,
    )
