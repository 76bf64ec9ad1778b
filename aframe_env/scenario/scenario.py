"""Scenario: everything that fixes one episode."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, Literal

from aframe_env.scenario.crane import GRAVITY, Crane
from aframe_env.scenario.motion import HarmonicMotion, ShipMotion, has_components, is_tabled
from aframe_env.validation import InvalidValue, require_choice, require_instance, require_number, shown

Initial = Literal["comoving", "rest"]
INITIALS: tuple[str, ...] = ("comoving", "rest")
LEAST_MASS: Final = 1e-3
"""Least mass of a load, kg."""
LEAST_RAMP: Final = 1e-3
"""Shortest build-up that is one, s."""
FASTEST_BOBBING: Final = 1e4
"""Greatest angular frequency of a load bobbing on its rope, rad/s: the inner step follows it."""
FASTEST_DECAY: Final = 1e6
"""Greatest damping of a rope for each kilogram of load, 1/s: the inner step follows it."""


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything that fixes one episode: crane, ship motion, load, rope."""

    crane: Crane = field(default_factory=Crane)
    motion: ShipMotion = field(default_factory=HarmonicMotion.paper)
    load_mass: float = 1.0e5
    """m_L, kg."""
    target_level: float = -300.0
    """h, the required load coordinate x_L3, m; negative below the mean deck origin."""
    rope_damping: float = 0.0
    """d_R, N s/m."""
    initial: Initial = "comoving"
    """Start of the load: with the pulley's velocity ("comoving") or at rest."""
    ramp: float = 0.0
    """Time over which the ship's motion builds up from nothing, s (a quintic smoothstep); 0 for none."""
    gravity: float = GRAVITY
    """g, m/s²."""

    def __post_init__(self) -> None:
        require_instance("crane", self.crane, Crane)
        if not (has_components(self.motion) or is_tabled(self.motion)):
            raise InvalidValue(f"motion = {shown(self.motion)}: must be a ship motion (HarmonicMotion, SeaMotion, ...)")
        require_number("load_mass", self.load_mass, "kg", low=LEAST_MASS, high=1e7)
        require_number("target_level", self.target_level, "m", low=-1e5, high=1e5)
        require_number("rope_damping", self.rope_damping, "N s/m", low=0.0, high=1e8)
        require_choice("initial", self.initial, INITIALS)
        require_number("ramp", self.ramp, "s", low=LEAST_RAMP, high=1e4, or_zero=True)
        require_number("gravity", self.gravity, "m/s²", low=1e-3, high=100.0)
        least, most = self.crane.winch.min_rope_length, self.crane.winch.max_rope_length
        pulley = self.crane.pulley_position[2]
        if self.target_level >= pulley:
            raise InvalidValue(
                f"target_level = {self.target_level!r} m: must be below the pulley, in (-inf, {pulley:g}) m"
            )
        breaking_load = self.crane.rope.breaking_load
        if self.weight >= breaking_load:
            raise InvalidValue(
                f"load_mass = {self.load_mass!r} kg: must be in (0, {breaking_load / self.gravity:g}) kg, for the rope "
                f"parts at {breaking_load:g} N"
            )
        if not least < self.free_length < most:
            raise InvalidValue(
                f"target_level = {self.target_level!r} m needs {self.free_length:g} m of unstretched rope between "
                f"drum and load: must be in ({least:g}, {most:g}) m, the winch's limits"
            )
        if self.rope_frequency > FASTEST_BOBBING:
            lightest = self.rope_stiffness / FASTEST_BOBBING**2
            raise InvalidValue(
                f"load_mass = {self.load_mass!r} kg bobs on its rope of {self.rope_stiffness:g} N/m at "
                f"{self.rope_frequency:g} rad/s: must be at least {lightest:g} kg, for {FASTEST_BOBBING:g} rad/s"
            )
        if self.rope_damping_rate > FASTEST_DECAY:
            raise InvalidValue(
                f"rope_damping = {self.rope_damping!r} N s/m: must be in [0, {FASTEST_DECAY * self.load_mass:g}] N s/m "
                f"with a load of {self.load_mass:g} kg"
            )

    @classmethod
    def paper(cls, initial: Initial = "comoving", rope_damping: float = 0.0, **changes: Any) -> Scenario:
        """Return the case of the paper's section 4 on the reference crane: motion (42), 100 t at h = -300 m.

        ``changes`` replace further fields.
        """
        return cls(**{"initial": initial, "rope_damping": rope_damping, **changes})

    @property
    def rope_length(self) -> float:
        """|LS| with the ship at rest and the load at its target, m."""
        return self.crane.pulley_position[2] - self.target_level

    @property
    def weight(self) -> float:
        """Weight of the load, N."""
        return self.load_mass * self.gravity

    @cached_property
    def free_length(self) -> float:
        """l_0, m: unstretched length between drum and load that holds the load at its target, ship at rest."""
        return self.crane.free_length(self.rope_length, self.weight)

    @property
    def rope_stiffness(self) -> float:
        """c_R = E_R F_R / l_0, N/m."""
        return self.crane.rope.axial_stiffness / self.free_length

    @property
    def rope_frequency(self) -> float:
        """Angular frequency of the load bobbing on the rope, rad/s."""
        return math.sqrt(self.rope_stiffness / self.load_mass)

    @property
    def rope_damping_rate(self) -> float:
        """d_R / m_L, 1/s."""
        return self.rope_damping / self.load_mass
