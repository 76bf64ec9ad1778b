"""The simplified model, eqs. (37)-(41): rigid frame, the load a particle on an elastic rope."""

from __future__ import annotations

import math

from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.rope import tension


@scalar
def load_acceleration(
    x1: float,
    x2: float,
    x3: float,
    v1: float,
    v2: float,
    v3: float,
    s1: float,
    s2: float,
    s3: float,
    ds1: float,
    ds2: float,
    ds3: float,
    length: float,
    pay_out_speed: float,
    drum_to_pulley: float,
    axial_stiffness: float,
    damping: float,
    mass: float,
    gravity: float,
) -> tuple[float, float, float, float]:
    """Acceleration of the load [m/s²] and rope tension [N].

    x, v: load; s, ds: pulley (base frame); ``length``: unstretched length between drum and load;
    ``pay_out_speed``: its rate. A load at the very pulley has no rope direction; 1 nm stands in for it.
    """
    u1, u2, u3 = s1 - x1, s2 - x2, s3 - x3
    distance = math.sqrt(u1 * u1 + u2 * u2 + u3 * u3 + 1e-18)
    rate = (u1 * (ds1 - v1) + u2 * (ds2 - v2) + u3 * (ds3 - v3)) / distance
    force = tension(distance + drum_to_pulley - length, rate - pay_out_speed, length, axial_stiffness, damping)
    pull = force / (distance * mass)
    return pull * u1, pull * u2, pull * u3 - gravity, force
