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
from aframe_env.dynamics.compiling import fma, larger, scalar
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
def tension(elongation: float, elongation_rate: float, stiffness: float, damping: float) -> float:
    """Rope tension max(0, c_R Δ + d_R Δ'), N, eqs. (25), (26) and (40), (41).

    ``elongation`` is Δ [m], ``stiffness`` c_R = E_R F_R / l [N/m] with l the unstretched length between drum and
    load, ``damping`` d_R [N s/m]. A rope never pushes, not even a damped one.
    """
    return larger(fma(stiffness, elongation, damping * elongation_rate), 0.0)


@scalar
def load_acceleration(load: Load, end: RopeEnd, constants: Constants) -> tuple[Vector, float]:
    """Acceleration of the load [m/s²] and rope tension [N], eqs. (39)-(41).

    A load at the very pulley has no rope direction; 1 nm stands in for it.
    """
    u = difference(end.position, load.position)
    du = difference(end.velocity, load.velocity)
    distance = math.sqrt(fma(u.x, u.x, fma(u.y, u.y, fma(u.z, u.z, 1e-18))))
    inverse = 1.0 / distance
    stretch_rate = fma(u.x, du.x, fma(u.y, du.y, u.z * du.z))
    elongation = distance + (constants.drum_to_pulley - end.length)
    elongation_rate = fma(stretch_rate, inverse, -end.pay_out_speed)
    force = tension(elongation, elongation_rate, end.stiffness, constants.damping)
    pull = force * (inverse * constants.inverse_mass)
    return Vector(pull * u.x, pull * u.y, fma(pull, u.z, -constants.gravity)), force


@scalar
def rk4_step(
    load: Load, start: RopeEnd, middle: RopeEnd, end: RopeEnd, h: float, target: float, constants: Constants
) -> tuple[Load, float, float]:
    """Fourth-order Runge-Kutta step of length h [s]: the load after it, ∫(x_L3 - h)² dt, greatest tension [N].

    ``start``, ``middle``, ``end``: the rope's upper end at the three times that the scheme looks at; ``target``: the
    required level [m]. A step of length 0 changes nothing.
    """
    half, sixth = 0.5 * h, h * (1.0 / 6.0)
    a1, force1 = load_acceleration(load, start, constants)
    second = Load(along(load.position, half, load.velocity), along(load.velocity, half, a1))
    a2, force2 = load_acceleration(second, middle, constants)
    third = Load(along(load.position, half, second.velocity), along(load.velocity, half, a2))
    a3, force3 = load_acceleration(third, middle, constants)
    fourth = Load(along(load.position, h, third.velocity), along(load.velocity, h, a3))
    a4, force4 = load_acceleration(fourth, end, constants)
    after = Load(
        along(load.position, sixth, simpson(load.velocity, second.velocity, third.velocity, fourth.velocity)),
        along(load.velocity, sixth, simpson(a1, a2, a3, a4)),
    )
    e1, e2 = load.position.z - target, second.position.z - target
    e3, e4 = third.position.z - target, fourth.position.z - target
    cost = sixth * fma(2.0, fma(e2, e2, e3 * e3), fma(e1, e1, e4 * e4))
    return after, cost, larger(larger(force1, force2), larger(force3, force4))
