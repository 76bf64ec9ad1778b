"""The simplified model, eqs. (37)-(41): rigid frame, the load a particle on an elastic rope."""

from __future__ import annotations

import math

from aframe_env.dynamics.compiling import fma, scalar
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
    stiffness: float,
    drum_to_pulley: float,
    damping: float,
    inverse_mass: float,
    gravity: float,
) -> tuple[float, float, float, float]:
    """Acceleration of the load [m/s²] and rope tension [N].

    x, v: load; s, ds: pulley (base frame); ``length``: unstretched length between drum and load;
    ``pay_out_speed``: its rate; ``stiffness``: c_R at that length. A load at the very pulley has no rope direction;
    1 nm stands in for it.
    """
    u1, u2, u3 = s1 - x1, s2 - x2, s3 - x3
    distance = math.sqrt(fma(u1, u1, fma(u2, u2, fma(u3, u3, 1e-18))))
    inverse = 1.0 / distance
    stretch_rate = fma(u1, ds1 - v1, fma(u2, ds2 - v2, u3 * (ds3 - v3)))
    elongation_rate = fma(stretch_rate, inverse, -pay_out_speed)
    force = tension(distance + (drum_to_pulley - length), elongation_rate, stiffness, damping)
    pull = force * (inverse * inverse_mass)
    return pull * u1, pull * u2, fma(pull, u3, -gravity), force
