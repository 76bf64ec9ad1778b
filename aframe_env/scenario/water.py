"""Water, and what it does to a load."""

from __future__ import annotations

from dataclasses import dataclass

from aframe_env.validation import require_number


@dataclass(frozen=True, kw_only=True)
class Water:
    """The sea that rope and load are in, still and without bottom; all of the rope below the pulley counts as wet."""

    density: float = 1025.0
    """ρ, kg/m³."""

    def __post_init__(self) -> None:
        require_number("density", self.density, "kg/m³", low=900.0, high=1300.0)


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
