"""A rope of many elements, straight up and down, with the drum still: what a chain of nine lumps is held against.

Nodes are fixed to the material, the mass of an element at each and half of one more at the load; the last element runs
over S to the drum. RK4 with a step of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aframe_env import Scenario
from train.verify.vertical import FloatArray


@dataclass(frozen=True)
class FineChain:
    """A scenario at rest, whose pulley moves by ``heave(t)`` [m] at ``heave_rate(t)`` [m/s]."""

    scenario: Scenario
    heave: Callable[[float], float]
    heave_rate: Callable[[float], float]
    elements: int = 60
    step: float = 5e-4
    """s."""

    @property
    def element(self) -> float:
        """Unstretched length of an element, m."""
        return self.scenario.lengths[0] / self.elements

    @property
    def top(self) -> float:
        """Unstretched length of the last one, to the drum, m."""
        return self.element + self.scenario.lengths[1]

    def run(self, times: FloatArray) -> FloatArray:
        """Level of the load [m] and tension at the drum [N] at ``times``, whole steps apart: (2, T)."""
        s, n = self.scenario, self.elements
        load, rope, mu = s.load, s.crane.rope, s.crane.rope.mass_per_length
        mass = np.full(n, mu * self.element)
        mass[0] = s.load_mass + load.added_mass_vertical + 0.5 * mu * self.element
        weight = np.full(n, s.rope_weight * self.element)
        weight[0] = s.weight + 0.5 * s.rope_weight * self.element
        drag = np.full(n, 0.5 * s.density * rope.tangential_drag * math.pi * rope.solid_diameter * self.element)
        drag[0] = 0.5 * (drag[0] + s.density * load.drag_area_vertical)
        x, v, now, found = self._rest(np.cumsum(weight)), np.zeros(n), 0.0, []

        def rates(t: float, x: FloatArray, v: FloatArray) -> FloatArray:
            tension = self._tensions(t, x, v)
            force = tension - weight - drag * np.abs(v) * v
            force[1:] -= tension[:-1]
            return np.asarray(force / mass)

        for time in times:
            for _ in range(round((time - now) / self.step)):
                h = self.step
                a1 = rates(now, x, v)
                v2 = v + 0.5 * h * a1
                a2 = rates(now + 0.5 * h, x + 0.5 * h * v, v2)
                v3 = v + 0.5 * h * a2
                a3 = rates(now + 0.5 * h, x + 0.5 * h * v2, v3)
                v4 = v + h * a3
                a4 = rates(now + h, x + h * v3, v4)
                x = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
                v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
                now += h
            found.append((x[0], self._tensions(now, x, v)[-1]))
        return np.array(found).T

    def _rest(self, tension: FloatArray) -> FloatArray:
        """Places of the nodes at rest, the elements above them under ``tension``."""
        crane = self.scenario.crane
        strain = 1.0 + tension / crane.rope.axial_stiffness
        highest = crane.pulley_position[2] + crane.drum_to_pulley - self.top * strain[-1]
        below = np.cumsum((self.element * strain[:-1])[::-1])[::-1]
        return np.concatenate([highest - below, [highest]])

    def _tensions(self, t: float, x: FloatArray, v: FloatArray) -> FloatArray:
        """Tensions of the elements above each node."""
        crane = self.scenario.crane
        drum = crane.pulley_position[2] + self.heave(t) + crane.drum_to_pulley
        lengths = np.full(self.elements, self.element)
        lengths[-1] = self.top
        strain = np.diff(x, append=drum) / lengths - 1.0
        rate = np.diff(v, append=self.heave_rate(t)) / lengths
        return np.asarray(np.maximum(0.0, crane.rope.axial_stiffness * (strain + self.scenario.loss_time * rate)))
