"""Water, and what it does to a load."""

from __future__ import annotations

from dataclasses import dataclass

from aframe_env.dynamics.layout import CURRENT_MOST
from aframe_env.validation import InvalidValue, require_number, require_vector, shown


@dataclass(frozen=True, kw_only=True)
class Water:
    """The sea that rope and load are in, without waves or bottom; all of the rope below the pulley counts as wet."""

    density: float = 1025.0
    """ρ, kg/m³."""
    surface_level: float = -5.0
    """Height of the mean surface in the base frame, m: the deck of the supply vessel is 5 m above it."""
    current: tuple[tuple[float, float, float], ...] = ()
    """Depth below the surface [m] and velocity along x and y [m/s], from above; linear in between, constant beyond."""

    def __post_init__(self) -> None:
        require_number("density", self.density, "kg/m³", low=900.0, high=1300.0)
        require_number("surface_level", self.surface_level, "m", low=-1e3, high=1e3)
        if not isinstance(self.current, tuple) or len(self.current) > CURRENT_MOST:
            raise InvalidValue(f"current = {shown(self.current)}: must be a tuple of up to {CURRENT_MOST} points")
        above = -1.0
        for index, point in enumerate(self.current):
            require_vector(f"current[{index}]", point, "m, m/s and m/s")
            require_number(f"current[{index}] depth", point[0], "m, each deeper by 1 m", low=above + 1.0, high=1.2e4)
            for velocity in point[1:]:
                require_number(f"current[{index}] velocity", velocity, "m/s", low=-5.0, high=5.0)
            above = point[0]


@dataclass(frozen=True, kw_only=True)
class LoadShape:
    """What water feels of a load; the load is a point to all else.

    Drag is ½ ρ (C_d A) |v| v, with v the velocity relative to the water: vertically, and horizontally in its own
    direction. Added mass is the mass of water that is accelerated with the load.
    """

    volume: float = 0.0
    """V, m³ of water displaced."""
    added_mass_vertical: float = 0.0
    """m_a for vertical motion, kg."""
    added_mass_horizontal: float = 0.0
    """m_a for horizontal motion, kg."""
    drag_area_vertical: float = 0.0
    """C_d A for vertical motion, m²."""
    drag_area_horizontal: float = 0.0
    """C_d A for horizontal motion, m²."""

    def __post_init__(self) -> None:
        require_number("volume", self.volume, "m³", low=0.0, high=1e4)
        for name in ("added_mass_vertical", "added_mass_horizontal"):
            require_number(name, getattr(self, name), "kg", low=0.0, high=1e7)
        for name in ("drag_area_vertical", "drag_area_horizontal"):
            require_number(name, getattr(self, name), "m²", low=0.0, high=1e4)
