"""Rope between load, pulley S on the flexible frame, and drum: its force at the end of a step, implicitly.

All in {D}. The frame and the load answer the rope's force linearly, so each sweep solves the tension exactly for
the directions of the sweep before: what remains falls by some 4e-4 a sweep.
"""

from __future__ import annotations

import math

from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.rope import tension

Vector = tuple[float, float, float]


@scalar
def apply(m: tuple[float, ...], x: float, y: float, z: float) -> Vector:
    """Product of a 3 × 3 matrix (row-major) and a vector."""
    return (m[0] * x + m[1] * y + m[2] * z, m[3] * x + m[4] * y + m[5] * z, m[6] * x + m[7] * y + m[8] * z)


@scalar
def apply_transposed(m: tuple[float, ...], x: float, y: float, z: float) -> Vector:
    """Product of the transpose of a 3 × 3 matrix (row-major) and a vector."""
    return (m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z, m[2] * x + m[5] * y + m[8] * z)


@scalar
def unit(x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """Length and unit vector; a vector of no length counts as 1 nm."""
    length = math.sqrt(x * x + y * y + z * z + 1e-18)
    return length, x / length, y / length, z / length


@scalar
def sweep(
    force: float,
    to_load: Vector,
    to_drum: Vector,
    pulley: Vector,
    pulley_rate: Vector,
    load: Vector,
    load_rate: Vector,
    drum: Vector,
    spin: Vector,
    give: tuple[float, ...],
    give_rate: tuple[float, ...],
    load_give: float,
    load_give_rate: float,
    length: float,
    pay_out_speed: float,
    axial_stiffness: float,
    damping: float,
) -> tuple[float, Vector, Vector]:
    """Tension [N] and unit vectors from S to load and drum, better than those given.

    ``pulley``, ``load`` (and rates) are the places at the step's end without the rope's force there, along {D}; the
    load's rate is the one relative to the base frame, less the deck's own. ``give``, ``load_give`` (and rates):
    what a unit force there adds.
    """
    a1, a2, a3 = to_load[0] + to_drum[0], to_load[1] + to_drum[1], to_load[2] + to_drum[2]
    g1, g2, g3 = apply(give, a1, a2, a3)
    r1, r2, r3 = apply(give_rate, a1, a2, a3)
    s1, s2, s3 = pulley[0] + force * g1, pulley[1] + force * g2, pulley[2] + force * g3
    u1, u2, u3 = pulley_rate[0] + force * r1, pulley_rate[1] + force * r2, pulley_rate[2] + force * r3
    pull, pull_rate = force * load_give, force * load_give_rate
    x1, x2, x3 = load[0] - pull * to_load[0], load[1] - pull * to_load[1], load[2] - pull * to_load[2]
    v1, v2, v3 = (
        load_rate[0] - pull_rate * to_load[0],
        load_rate[1] - pull_rate * to_load[1],
        load_rate[2] - pull_rate * to_load[2],
    )
    hanging, l1, l2, l3 = unit(x1 - s1, x2 - s2, x3 - s3)
    inboard, h1, h2, h3 = unit(drum[0] - s1, drum[1] - s2, drum[2] - s3)
    # The deck's turning moves neither S nor H along their line, and S along the load's as it moves the load.
    w1 = v1 - (spin[1] * x3 - spin[2] * x2) - u1
    w2 = v2 - (spin[2] * x1 - spin[0] * x3) - u2
    w3 = v3 - (spin[0] * x2 - spin[1] * x1) - u3
    rate = l1 * w1 + l2 * w2 + l3 * w3 - (h1 * u1 + h2 * u2 + h3 * u3)
    stretch = hanging + inboard - length
    compliance = load_give + a1 * g1 + a2 * g2 + a3 * g3
    compliance_rate = load_give_rate + a1 * r1 + a2 * r2 + a3 * r3
    # As if the rope had given way by what this force explains: the tension then solves the law.
    stiffness = axial_stiffness / length
    softened = 1.0 + stiffness * compliance + damping * compliance_rate
    new_force = (
        tension(
            stretch + compliance * force,
            rate - pay_out_speed + compliance_rate * force,
            stiffness,
            damping,
        )
        / softened
    )
    return new_force, (l1, l2, l3), (h1, h2, h3)
