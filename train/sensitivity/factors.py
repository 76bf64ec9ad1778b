"""Quantities that a policy may be told wrongly, and the scenario that is then the true one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from aframe_env.scenario import Scenario
from aframe_env.scenario.motion import ComponentMotion, Components, has_components
from aframe_env.validation import InvalidValue


@dataclass(frozen=True)
class Factor:
    """A quantity, and the range of its true value over the assumed one (of the phase: of the difference, rad)."""

    name: str
    low: float
    high: float
    assumed: float
    """Value at which the truth is as assumed."""
    label: str


FACTORS: Final = (
    Factor("mass", 0.8, 1.2, 1.0, "load mass, true / assumed"),
    Factor("length", 0.8, 1.2, 1.0, "rope length, true / assumed"),
    Factor("stiffness", 0.7, 1.3, 1.0, "E_R F_R, true / assumed"),
    Factor("damping", 0.0, 3.0, 1.0, "rope damping, true / assumed"),
    Factor("period", 0.95, 1.05, 1.0, "wave period, true / assumed"),
    Factor("phase", -math.pi / 6.0, math.pi / 6.0, 0.0, "phase of the waves, true − assumed, rad"),
)
NOMINAL: Final = tuple(factor.assumed for factor in FACTORS)


@dataclass(frozen=True)
class AlteredMotion:
    """A ship motion whose waves have other periods and phases; their responses stay the same."""

    motion: ComponentMotion
    period: float = 1.0
    """Factor of every component's period."""
    phase: float = 0.0
    """Lead of every component, rad."""

    def components(self) -> Components:
        """Return the altered components."""
        components = self.motion.components()
        turn = complex(math.cos(self.phase), math.sin(self.phase))
        return Components(components.frequency / self.period, components.response * turn)


def altered(assumed: Scenario, values: Sequence[float]) -> Scenario:
    """Return the true scenario, by the values of ``FACTORS``. The load starts at its target in it."""
    mass, length, stiffness, damping, period, phase = values
    if not has_components(assumed.motion):
        raise InvalidValue(f"motion = {assumed.motion}: must be a sum of components")
    crane = assumed.crane
    rope = replace(crane.rope, axial_stiffness=stiffness * crane.rope.axial_stiffness)
    return replace(
        assumed,
        crane=replace(crane, rope=rope),
        motion=AlteredMotion(assumed.motion, period, phase),
        load_mass=mass * assumed.load_mass,
        target_level=crane.pulley_position[2] - length * assumed.rope_length,
        rope_damping=damping * assumed.rope_damping,
    )
