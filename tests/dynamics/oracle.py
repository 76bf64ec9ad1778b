"""The simplified model written once more, from eqs. (25), (26), (37)-(41), for SciPy's integrator.

Nothing here calls the package's physics: the deck's motion comes as a function of time.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from aframe_env import Scenario
from aframe_env.scenario.motion import Components

FloatArray = npt.NDArray[np.float64]
Drum = Callable[[float], tuple[float, float]]
"""Drum angle [rad] and speed [rad/s] over time."""
Reach = Callable[[float], tuple[float, float]]
"""|SH| [m] and its rate [m/s] over time."""


class SixDofMotion:
    """Sum of harmonics of all six coordinates with phases of its own: 12 of them from 4 to 18 s."""

    def __init__(self, seed: int, scale: float = 1.0, components: int = 12) -> None:
        rng = np.random.default_rng(seed)
        size = np.array([1.0, 1.0, 1.5, 0.08, 0.05, 0.03]) * scale / math.sqrt(components)
        response = size * (rng.normal(size=(components, 6)) + 1j * rng.normal(size=(components, 6)))
        self._components = Components(rng.uniform(0.35, 1.6, components), response)

    def components(self) -> Components:
        return self._components


def pulley(
    motion: Callable[[float], FloatArray], point: tuple[float, float, float], ramp: float = 0.0
) -> Callable[[float], FloatArray]:
    """Position and velocity (6,) of a deck point over t, from motion(t) -> (2, 6), coordinates and rates."""

    def at(t: float) -> FloatArray:
        q, dq = motion(t)
        if ramp and t < ramp:
            s = t / ramp
            factor, rate = s**3 * (10 - 15 * s + 6 * s**2), 30 * s**2 * (1 - s) ** 2 / ramp
            q, dq = factor * q, factor * dq + rate * q
        (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in q[3:].tolist())
        x, y, z = point
        # R = Rz Ry Rx, eq. (38), multiplied out.
        a1 = cy * cp * x + (cy * sp * sr - sy * cr) * y + (cy * sp * cr + sy * sr) * z
        a2 = sy * cp * x + (sy * sp * sr + cy * cr) * y + (sy * sp * cr - cy * sr) * z
        a3 = -sp * x + cp * sr * y + cp * cr * z
        # Angular velocity in the base frame: yaw about z, pitch about the yawed y, roll about the pitched x.
        roll, pitch, yaw = dq[3:].tolist()
        w1, w2, w3 = cy * cp * roll - sy * pitch, sy * cp * roll + cy * pitch, yaw - sp * roll
        moved = (a1, a2, a3, w2 * a3 - w3 * a2, w3 * a1 - w1 * a3, w1 * a2 - w2 * a1)
        return np.concatenate([q[:3], dq[:3]]) + moved

    return at


def of_components(components: Components) -> Callable[[float], FloatArray]:
    """motion(t) -> (2, 6) of a sum of components, from its definition."""

    def motion(t: float) -> FloatArray:
        turned = components.response * np.exp(1j * components.frequency * t)[:, None]
        return np.stack([turned.real.sum(0), (1j * components.frequency[:, None] * turned).real.sum(0)])

    return motion


def still(t: float) -> tuple[float, float]:
    return 0.0, 0.0


def behind_pulley(scenario: Scenario) -> float:
    """|SH|, m."""
    return math.dist(scenario.crane.pulley_position, scenario.crane.drum_position)


def free_length(scenario: Scenario) -> float:
    """l_0, m: so much rope, stretched by the load's weight, reaches from the drum to the load at h."""
    reach = scenario.crane.pulley_position[2] - scenario.target_level + behind_pulley(scenario)
    return reach / (1 + scenario.load_mass * scenario.gravity / scenario.crane.rope.axial_stiffness)


def forces(
    t: float,
    y: FloatArray,
    scenario: Scenario,
    pulley_at: Callable[[float], FloatArray],
    drum: Drum,
    reach: Reach | None = None,
) -> tuple[float, float, float, float]:
    """Rope tension and its three components on the load, N."""
    crane = scenario.crane
    s1, s2, s3, d1, d2, d3 = pulley_at(t).tolist()
    x1, x2, x3, v1, v2, v3 = y[:6].tolist()
    angle, speed = drum(t)
    radius = crane.winch.drum_diameter / 2
    length = free_length(scenario) + radius * angle
    u1, u2, u3 = s1 - x1, s2 - x2, s3 - x3
    distance = math.sqrt(u1**2 + u2**2 + u3**2)
    behind, lengthening = (behind_pulley(scenario), 0.0) if reach is None else reach(t)
    stretch = distance + behind - length
    rate = (u1 * (d1 - v1) + u2 * (d2 - v2) + u3 * (d3 - v3)) / distance + lengthening - radius * speed
    tension = max(0.0, crane.rope.axial_stiffness / length * stretch + scenario.rope_damping * rate)
    return tension, tension * u1 / distance, tension * u2 / distance, tension * u3 / distance


def solve(
    scenario: Scenario,
    times: FloatArray,
    pulley_at: Callable[[float], FloatArray],
    drum: Drum = still,
    start: FloatArray | None = None,
    breaks: Iterable[float] = (),
    max_step: float = 0.1,
    reach: Reach | None = None,
) -> FloatArray:
    """States (T, 7) at ``times``: load position, velocity, ∫(x_L3 - h)² dt. ``breaks``: times of kinks.

    ``reach``: |SH| over time, where it changes.
    """
    if start is None:
        tip = pulley_at(times[0])
        velocity = tip[3:] if scenario.initial == "comoving" else np.zeros(3)
        start = np.concatenate(
            [tip[:3] - [0.0, 0.0, scenario.crane.pulley_position[2] - scenario.target_level], velocity]
        )
    y = np.append(start, 0.0)

    def slope(t: float, y: FloatArray) -> list[float]:
        _, f1, f2, f3 = forces(t, y, scenario, pulley_at, drum, reach)
        error = y[2] - scenario.target_level
        mass = scenario.load_mass
        return [y[3], y[4], y[5], f1 / mass, f2 / mass, f3 / mass - scenario.gravity, error * error]

    return integrate(slope, times, y, breaks, max_step)


def integrate(
    slope: Callable[[float, FloatArray], list[float]],
    times: FloatArray,
    start: FloatArray,
    breaks: Iterable[float] = (),
    max_step: float = 0.1,
) -> FloatArray:
    """States (T, n) at ``times``, from ``start`` at the first of them."""
    y = start
    out = [y]
    # Steps end at every kink; stops that differ by rounding are one.
    stops = np.unique(np.round(np.concatenate([list(breaks), times[[0, -1]]]), 9))
    stops = stops[(stops >= times[0] - 1e-9) & (stops <= times[-1] + 1e-9)]
    for begin, end in itertools.pairwise(stops):
        inside = times[(times > begin + 1e-8) & (times < end - 1e-8)]
        wanted = np.append(inside, end)
        found = solve_ivp(slope, (begin, end), y, "DOP853", wanted, rtol=1e-10, atol=1e-11, max_step=max_step)
        assert found.success
        at_end = bool(np.any(np.abs(times - end) < 1e-8))
        out.extend(found.y.T if at_end else found.y.T[:-1])
        y = found.y[:, -1]
    return np.array(out)


def winch(
    commands: Iterable[float], period: float, limit: float, acceleration: float, lag: float = 0.0
) -> tuple[Drum, list[float]]:
    """Drum angle and speed over time for held commands, and the times of the kinks in its speed."""
    pieces = []
    angle, speed, begin = 0.0, 0.0, 0.0
    for command in commands:
        command = min(max(command, -limit), limit)
        gap = command - speed
        error = min(abs(gap), acceleration * lag)
        ramp = (abs(gap) - error) / acceleration
        pieces.append((begin, angle, speed, command, math.copysign(acceleration, gap), ramp, lag))
        angle, speed = _piece(pieces[-1], begin + period)
        begin += period

    def drum(t: float) -> tuple[float, float]:
        return _piece(pieces[min(int(t / period + 1e-9), len(pieces) - 1)], t)

    kinks = [p[0] for p in pieces] + [p[0] + p[5] for p in pieces if 0 < p[5] < period]
    return drum, kinks


def _piece(piece: tuple[float, ...], t: float) -> tuple[float, float]:
    begin, angle, speed, command, acceleration, ramp, lag = piece
    t -= begin
    if t <= ramp:
        return angle + speed * t + acceleration * t * t / 2, speed + acceleration * t
    angle += speed * ramp + acceleration * ramp**2 / 2
    speed += acceleration * ramp
    rest = t - ramp
    if lag == 0.0:
        return angle + command * rest, command
    decay = math.exp(-rest / lag)
    return angle + command * rest + (speed - command) * lag * (1 - decay), command + (speed - command) * decay
