"""A load on a light rope, straight up and down, integrated by SciPy: what the compiled model is held against."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

from aframe_env import Scenario

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Lift:
    """A scenario whose ship heaves by ``heave(t)`` [m], and whose drum has paid out ``paid_out(t)`` [m]."""

    scenario: Scenario
    heave: Callable[[float], float]
    paid_out: Callable[[float], float] = lambda t: 0.0
    surface: Callable[[float], float] = lambda t: -1e9
    """Level of the sea's surface, m."""
    bed: tuple[float, float, float] = (-1e9, 0.0, 0.0)
    """Level [m], stiffness, damping."""

    def tension(self, t: float, z: float, v: float, given: float = 0.0, given_rate: float = 0.0) -> float:
        """Tension of the rope, N."""
        s, h = self.scenario, 1e-5
        crane = s.crane
        length = s.free_length + self.paid_out(t) + given
        rate = (self.paid_out(t + h) - self.paid_out(t - h)) / (2 * h) + given_rate
        pulley = crane.pulley_position[2] + self.heave(t)
        pulley_rate = (self.heave(t + h) - self.heave(t - h)) / (2 * h)
        elongation = pulley - z + crane.drum_to_pulley - length
        stretching = pulley_rate - v - rate
        stiffness = crane.rope.axial_stiffness / length
        return max(0.0, stiffness * elongation + s.total_rope_damping * stretching)

    def rates(self, t: float, state: FloatArray) -> list[float]:
        """Rates of level, velocity and the cylinder's stroke."""
        s, load = self.scenario, self.scenario.load
        z, v = float(state[0]), float(state[1])
        given, given_rate = 0.0, 0.0
        cylinder = s.crane.compensator
        if cylinder is not None:
            given = float(state[2])
            gas = s.weight * (cylinder.gas_length / (cylinder.gas_length - given)) ** cylinder.exponent
            # The cylinder's speed by bisection: tension less gas force is what its damper takes.
            low, high = -100.0, 100.0
            for _ in range(80):
                given_rate = 0.5 * (low + high)
                over = self.tension(t, z, v, given, given_rate) - gas - cylinder.damping * given_rate
                low, high = (given_rate, high) if over > 0.0 else (low, given_rate)
        tension = self.tension(t, z, v, given, given_rate)
        force, mass = tension - s.load_mass * s.gravity, s.load_mass
        if s.water is not None:
            h, density = 1e-5, s.water.density
            level, rising = self.surface(t), (self.surface(t + h) - self.surface(t - h)) / (2 * h)
            wet = min(max((level - (z - 0.5 * load.height)) / load.height, 0.0), 1.0)
            force += density * load.volume * s.gravity * wet - 0.5 * density * load.drag_area_vertical * wet * v * abs(
                v
            )
            mass += load.added_mass_vertical * wet
            if 0.0 < wet < 1.0:
                against = v - rising
                area = load.slam_area if against < 0.0 else load.exit_area
                force -= 0.5 * density * area * against * abs(against)
            sunk = self.bed[0] - (z - 0.5 * load.height)
            if sunk > 0.0:
                force += max(0.0, self.bed[1] * sunk - self.bed[2] * v)
        return [v, force / mass, given_rate]

    def run(self, times: FloatArray, max_step: float = 0.01) -> FloatArray:
        """Level [m] and velocity [m/s] of the load, and the cylinder's stroke [m], at ``times``: (3, T)."""
        h = 1e-5
        v0 = (self.heave(h) - self.heave(-h)) / (2 * h)
        start = [self.scenario.target_level + self.heave(0.0), v0, 0.0]
        solved = solve_ivp(
            self.rates, (0.0, float(times[-1])), start, t_eval=times, rtol=1e-8, atol=1e-9, max_step=max_step
        )
        assert solved.success
        return np.asarray(solved.y)
