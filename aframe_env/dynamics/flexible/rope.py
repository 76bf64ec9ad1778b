"""Rope between load, pulley S on the flexible frame, and drum: its force at the end of a step, implicitly.

All in {D}. The frame and the load answer the rope's force linearly, so each iteration solves the tension exactly for
the directions of the one before: what remains falls by some 4e-4 an iteration.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.load import tension
from aframe_env.dynamics.vector import Vector, add, cross, difference, inner, scaled

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
    """Displacements and rates that a unit force at the step's end adds there."""

    pulley: Matrix
    """Displacement of S, m/N."""
    pulley_rate: Matrix
    """m/(s N)."""
    load: float
    """Displacement of the load, m/N."""
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
    force = pull.tension
    a = add(pull.to_load, pull.to_drum)
    g, r = apply(compliance.pulley, a), apply(compliance.pulley_rate, a)
    s = add(unloaded.pulley, scaled(force, g))
    u = add(unloaded.pulley_rate, scaled(force, r))
    x = difference(unloaded.load, scaled(force * compliance.load, pull.to_load))
    v = difference(unloaded.load_rate, scaled(force * compliance.load_rate, pull.to_load))
    hanging, to_load = unit(difference(x, s))
    inboard, to_drum = unit(difference(unloaded.drum, s))
    # The deck's turning moves neither S nor H along their line, and S along the load's as it moves the load.
    w = difference(difference(v, cross(unloaded.spin, x)), u)
    rate = inner(to_load, w) - inner(to_drum, u)
    stretch = hanging + inboard - rope.length
    give = compliance.load + a.x * g.x + a.y * g.y + a.z * g.z
    give_rate = compliance.load_rate + a.x * r.x + a.y * r.y + a.z * r.z
    # As if the rope had given way by what this force explains: the tension then solves the law.
    stiffness = rope.axial_stiffness / rope.length
    softened = 1.0 + stiffness * give + rope.damping * give_rate
    elongation, elongation_rate = stretch + give * force, rate - rope.speed + give_rate * force
    return Pull(tension(elongation, elongation_rate, stiffness, rope.damping) / softened, to_load, to_drum)
