"""Rope between load, pulley S on the flexible frame, and drum: its force at the end of a step, implicitly.

All in {D}. The frame and the load answer the rope's force linearly, so each iteration solves the tension exactly for
the directions of the one before: what remains falls by some 4e-4 an iteration.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from aframe_env.dynamics.compiling import scalar, select
from aframe_env.dynamics.load import tension
from aframe_env.dynamics.vector import Vector, add, along, cross, difference, inner, scaled

Matrix = tuple[float, float, float, float, float, float, float, float, float]
"""3 × 3, row-major."""


class Unloaded(NamedTuple):
    """Places and rates at the step's end without the rope's force there, along {D}."""

    pulley: Vector
    """m."""
    pulley_rate: Vector
    """m/s."""
    load: Vector
    """m."""
    load_rate: Vector
    """Relative to the base frame, less the deck's own, m/s."""
    drum: Vector
    """m."""
    spin: Vector
    """Angular velocity of the deck, rad/s."""


class Compliance(NamedTuple):
    """Displacements and rates at the step's end by the rope's force there: elastic part, its rate, the rest."""

    by_elastic: Matrix
    """Displacement of S, m/N."""
    by_growth: Matrix
    """m s/N."""
    by_rest: Matrix
    """m/N."""
    rate_by_elastic: Matrix
    """Rate of S, m/(s N)."""
    rate_by_growth: Matrix
    """m/N."""
    rate_by_rest: Matrix
    """m/(s N)."""
    load: float
    """Displacement of the load by the force as a whole, m/N."""
    load_rate: float
    """m/(s N)."""


class PaidOut(NamedTuple):
    """Rope that the drum has paid out."""

    length: float
    """Unstretched, between drum and load, m."""
    speed: float
    """Rate of that length, m/s."""
    axial_stiffness: float
    """E_R F_R, N."""
    damping: float
    """d_R, N s/m."""


class Pull(NamedTuple):
    """The rope's force."""

    tension: float
    """N."""
    elastic: float
    """Its elastic part, N."""
    growth: float
    """Rate of that part, N/s; of its length alone, not of its directions."""
    to_load: Vector
    """Unit vector from S to the load."""
    to_drum: Vector
    """Unit vector from S to the drum."""


@scalar
def apply(m: Matrix, v: Vector) -> Vector:
    """Product of a matrix and a vector."""
    return Vector(
        m[0] * v.x + m[1] * v.y + m[2] * v.z, m[3] * v.x + m[4] * v.y + m[5] * v.z, m[6] * v.x + m[7] * v.y + m[8] * v.z
    )


@scalar
def apply_transposed(m: Matrix, v: Vector) -> Vector:
    """Product of the transpose of a matrix and a vector."""
    return Vector(
        m[0] * v.x + m[3] * v.y + m[6] * v.z, m[1] * v.x + m[4] * v.y + m[7] * v.z, m[2] * v.x + m[5] * v.y + m[8] * v.z
    )


@scalar
def unit(v: Vector) -> tuple[float, Vector]:
    """Length and unit vector; a vector of no length counts as 1 nm."""
    length = math.sqrt(v.x * v.x + v.y * v.y + v.z * v.z + 1e-18)
    return length, Vector(v.x / length, v.y / length, v.z / length)


@scalar
def iterate_tension(pull: Pull, unloaded: Unloaded, compliance: Compliance, rope: PaidOut) -> Pull:
    """Tension and directions of the rope, better than those of ``pull``."""
    force, elastic, growth = pull.tension, pull.elastic, pull.growth
    rest = force - elastic
    a = add(pull.to_load, pull.to_drum)
    g_elastic, g_growth, g_rest = (
        apply(compliance.by_elastic, a),
        apply(compliance.by_growth, a),
        apply(compliance.by_rest, a),
    )
    r_elastic, r_growth, r_rest = (
        apply(compliance.rate_by_elastic, a),
        apply(compliance.rate_by_growth, a),
        apply(compliance.rate_by_rest, a),
    )
    s = along(along(along(unloaded.pulley, elastic, g_elastic), growth, g_growth), rest, g_rest)
    u = along(along(along(unloaded.pulley_rate, elastic, r_elastic), growth, r_growth), rest, r_rest)
    x = difference(unloaded.load, scaled(force * compliance.load, pull.to_load))
    v = difference(unloaded.load_rate, scaled(force * compliance.load_rate, pull.to_load))
    hanging, to_load = unit(difference(x, s))
    inboard, to_drum = unit(difference(unloaded.drum, s))
    # The deck's turning moves neither S nor H along their line, and S along the load's as it moves the load.
    w = difference(difference(v, cross(unloaded.spin, x)), u)
    rate = inner(to_load, w) - inner(to_drum, u)
    stretch = hanging + inboard - rope.length
    # As if the rope had given way by what this force explains: length and rate then solve the law, two by two.
    give = compliance.load + inner(a, g_elastic), inner(a, g_growth), compliance.load + inner(a, g_rest)
    slow = compliance.load_rate + inner(a, r_elastic), inner(a, r_growth), compliance.load_rate + inner(a, r_rest)
    stretch += give[0] * elastic + give[1] * growth + give[2] * rest
    rate += slow[0] * elastic + slow[1] * growth + slow[2] * rest - rope.speed
    stiffness, damping = rope.axial_stiffness / rope.length, rope.damping
    m11, m12 = 1.0 + stiffness * give[0], stiffness * give[1] + damping * give[2]
    m21, m22 = stiffness * slow[0], 1.0 + stiffness * slow[1] + damping * slow[2]
    scale = 1.0 / (m11 * m22 - m12 * m21)
    elongation, elongation_rate = (m22 * stretch - m12 * rate) * scale, (m11 * rate - m21 * stretch) * scale
    pulled = tension(elongation, elongation_rate, stiffness, damping)
    taut = pulled > 0.0
    return Pull(
        pulled,
        select(taut, stiffness * elongation, 0.0),
        select(taut, stiffness * elongation_rate, 0.0),
        to_load,
        to_drum,
    )
