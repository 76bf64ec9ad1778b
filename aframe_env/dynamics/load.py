"""The simplified model, eqs. (37)-(41): rigid frame, the load a particle on an elastic rope.

The rope's law, the load's acceleration, and the Runge-Kutta step with the running Ω1 integral beside it. Whatever
integrates this model (the engine, the drives' objective, the rows on a GPU) takes them from here, and a row's constants
through :func:`load_constants`. The compiled full model takes the rope's law from here and moves the load by an implicit
step of its own, in ``flexible.step``; the stand-alone reference runs state the law for themselves, in
``aframe_env.rfem.rope_law``.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import fma, larger, scalar, select, smaller
from aframe_env.dynamics.vector import Vector, along, difference, simpson


class Load(NamedTuple):
    """The load in the base frame."""

    position: Vector
    """m."""
    velocity: Vector
    """m/s."""


class RopeEnd(NamedTuple):
    """Upper end of the rope at one time: the pulley S, and what the drum has paid out."""

    position: Vector
    """Pulley in the base frame, m."""
    velocity: Vector
    """m/s."""
    length: float
    """l, unstretched length between drum and load, m."""
    pay_out_speed: float
    """Rate of that length, m/s."""
    stiffness: float
    """c_R = E_R F_R / l at that length, N/m."""


class Constants(NamedTuple):
    """Constants of a step."""

    drum_to_pulley: float
    """|SH|, m."""
    damping: float
    """d_R, N s/m."""
    inverse_mass: float
    """1/kg."""
    gravity: float
    """m/s²."""


@scalar
def load_constants(row: Any, intact: float, lanes: int, j: int) -> Constants:
    """Constants of lane j in a segment that has begun; ``intact`` is 1, or 0 once the rope has parted."""
    return Constants(
        row[at.DRUM_TO_PULLEY * lanes + j],
        intact * row[at.ROPE_DAMPING * lanes + j],
        row[at.INVERSE_MASS * lanes + j],
        row[at.GRAVITY * lanes + j],
    )


@scalar
def pull(elongation: float, elongation_rate: float, stiffness: float, damping: float) -> float:
    """c_R Δ + d_R Δ', N: the rope's tension, or negative where the rope, which never pushes, is slack."""
    return fma(stiffness, elongation, damping * elongation_rate)


@scalar
def tension(elongation: float, elongation_rate: float, stiffness: float, damping: float) -> float:
    """Rope tension max(0, c_R Δ + d_R Δ'), N, eqs. (25), (26) and (40), (41).

    ``elongation`` is Δ [m], ``stiffness`` c_R = E_R F_R / l [N/m] with l the unstretched length between drum and
    load, ``damping`` d_R [N s/m]. A rope never pushes, not even a damped one.
    """
    return larger(pull(elongation, elongation_rate, stiffness, damping), 0.0)


class Pull(NamedTuple):
    """The rope's pull on the load."""

    force: float
    """N; negative where the rope is slack."""
    towards: Vector
    """From the load to the pulley, m."""
    nearness: float
    """1 / that distance, 1/m."""


@scalar
def rope_pull(load: Load, end: RopeEnd, constants: Constants) -> Pull:
    """Pull of the rope, eqs. (40), (41).

    A load at the very pulley has no rope direction; 1 nm stands in for it.
    """
    u = difference(end.position, load.position)
    du = difference(end.velocity, load.velocity)
    distance = math.sqrt(fma(u.x, u.x, fma(u.y, u.y, fma(u.z, u.z, 1e-18))))
    inverse = 1.0 / distance
    stretch_rate = fma(u.x, du.x, fma(u.y, du.y, u.z * du.z))
    elongation = distance + (constants.drum_to_pulley - end.length)
    elongation_rate = fma(stretch_rate, inverse, -end.pay_out_speed)
    return Pull(pull(elongation, elongation_rate, end.stiffness, constants.damping), u, inverse)


@scalar
def load_acceleration(force: float, rope: Pull, constants: Constants) -> Vector:
    """Acceleration of the load [m/s²] on which the rope pulls with ``force`` N, eq. (39)."""
    u, share = rope.towards, force * (rope.nearness * constants.inverse_mass)
    return Vector(share * u.x, share * u.y, fma(share, u.z, -constants.gravity))


@scalar
def last_tension(pull1: float, pull2: float, pull3: float, pull4: float) -> float:
    """Tension [N] for the last stage of a step, given the pulls in all of its stages.

    It is the tension there; but where the rope goes slack or comes taut within the step, the one with which the
    scheme's weights find the impulse of max(0, pull), the pull running on a parabola through the stages. The scheme
    would otherwise lose its order at that corner.
    """
    most, least = larger(pull1, pull4), smaller(pull1, pull4)
    corner = most * least < 0.0
    # The rope is taut for this share of the step, at one of its ends; the bend moves that in second order alone.
    share = most / select(corner, most - least, 1.0)
    bend = 2.0 * (pull1 + pull4 - pull2 - pull3)
    impulse = larger(share * fma(bend * share, fma(share, 1.0 / 3.0, -0.5), 0.5 * most), 0.0)
    earlier = fma(2.0, larger(pull2, 0.0) + larger(pull3, 0.0), larger(pull1, 0.0))
    return select(corner, fma(6.0, impulse, -earlier), larger(pull4, 0.0))


@scalar
def rk4_step(
    load: Load, start: RopeEnd, middle: RopeEnd, end: RopeEnd, h: float, target: float, constants: Constants
) -> tuple[Load, float, float]:
    """Fourth-order Runge-Kutta step of length h [s]: the load after it, ∫(x_L3 - h)² dt, greatest tension [N].

    ``start``, ``middle``, ``end``: the rope's upper end at the three times that the scheme looks at; ``target``: the
    required level [m]. A step of length 0 changes nothing. The greatest tension is negative where the rope was slack.
    """
    half, sixth = 0.5 * h, h * (1.0 / 6.0)
    rope1 = rope_pull(load, start, constants)
    a1 = load_acceleration(larger(rope1.force, 0.0), rope1, constants)
    second = Load(along(load.position, half, load.velocity), along(load.velocity, half, a1))
    rope2 = rope_pull(second, middle, constants)
    a2 = load_acceleration(larger(rope2.force, 0.0), rope2, constants)
    third = Load(along(load.position, half, second.velocity), along(load.velocity, half, a2))
    rope3 = rope_pull(third, middle, constants)
    a3 = load_acceleration(larger(rope3.force, 0.0), rope3, constants)
    fourth = Load(along(load.position, h, third.velocity), along(load.velocity, h, a3))
    rope4 = rope_pull(fourth, end, constants)
    a4 = load_acceleration(last_tension(rope1.force, rope2.force, rope3.force, rope4.force), rope4, constants)
    after = Load(
        along(load.position, sixth, simpson(load.velocity, second.velocity, third.velocity, fourth.velocity)),
        along(load.velocity, sixth, simpson(a1, a2, a3, a4)),
    )
    e1, e2 = load.position.z - target, second.position.z - target
    e3, e4 = third.position.z - target, fourth.position.z - target
    cost = sixth * fma(2.0, fma(e2, e2, e3 * e3), fma(e1, e1, e4 * e4))
    return after, cost, larger(larger(rope1.force, rope2.force), larger(rope3.force, rope4.force))
