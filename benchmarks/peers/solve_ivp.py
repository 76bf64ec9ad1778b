"""The same model straight in ``scipy.integrate.solve_ivp`` (RK45, rtol 1e-6): one episode of 60 s, the drum at rest.

Written as one would who had only SciPy: eqs. (25), (26), (37)-(41), the paper's crane and load, a deck motion of 32
components. A drum at rest is the easy case for the integrator, which need not look for kinks.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

if __package__:
    from .serve import Measurement, serve, speed
    from .synthetic import components
else:
    from serve import Measurement, serve, speed
    from synthetic import components

DURATION = 60.0
CONTROL_STEPS = 600
MASS, GRAVITY, TARGET = 1.0e5, 9.81, -300.0
AXIAL_STIFFNESS, DAMPING = 2.0e8, 1.5e4
PULLEY = np.array([12.0 * math.sin(math.radians(25.0)), 0.0, 12.0 * math.cos(math.radians(25.0))])
DRUM = np.array([-2.0, 0.0, 1.0])
TO_PULLEY = float(np.linalg.norm(PULLEY - DRUM))
LENGTH = (PULLEY[2] - TARGET + TO_PULLEY) / (1.0 + MASS * GRAVITY / AXIAL_STIFFNESS)
FREQUENCY, RESPONSE = components()


def pulley(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity of the pulley on the moving deck, ZYX Euler angles."""
    turned = RESPONSE * np.exp(1j * FREQUENCY * t)[:, None]
    q = turned.real.sum(axis=0)
    dq = (1j * FREQUENCY[:, None] * turned).real.sum(axis=0)
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in q[3:])
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    roll, pitch, yaw = dq[3:]
    spin = np.array([cy * cp * roll - sy * pitch, sy * cp * roll + cy * pitch, yaw - sp * roll])
    arm = rotation @ PULLEY
    return q[:3] + arm, dq[:3] + np.cross(spin, arm)


def slope(t: float, y: np.ndarray) -> np.ndarray:
    """Rate of the load's position (3), velocity (3) and of Ω1."""
    s, ds = pulley(t)
    u, du = s - y[:3], ds - y[3:6]
    distance = math.sqrt(u @ u)
    tension = AXIAL_STIFFNESS / LENGTH * (distance + TO_PULLEY - LENGTH) + DAMPING * (u @ du) / distance
    acceleration = max(0.0, tension) / (MASS * distance) * u
    acceleration[2] -= GRAVITY
    return np.concatenate([y[3:6], acceleration, [(y[2] - TARGET) ** 2]])


def episode() -> np.ndarray:
    """State (7,) after 60 s; the load starts with the pulley's velocity, right below it."""
    s, ds = pulley(0.0)
    start = np.concatenate([s - [0.0, 0.0, PULLEY[2] - TARGET], ds, [0.0]])
    return solve_ivp(slope, (0.0, DURATION), start, "RK45", rtol=1e-6).y[:, -1]


def measure() -> Measurement:
    return speed(episode, CONTROL_STEPS)


if __name__ == "__main__":
    serve({"episode": measure}, ("scipy", "numpy"))
