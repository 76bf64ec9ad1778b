"""Water, and what it does to a load."""

from __future__ import annotations

from dataclasses import dataclass

from aframe_env.dynamics.layout import CURRENT_MOST
from aframe_env.dynamics.start import share_under_water
from aframe_env.validation import InvalidValue, require_instance, require_number, require_vector, shown


@dataclass(frozen=True, kw_only=True)
class Seabed:
    """Ground that bears the load like a spring and a damper, and holds it sideways by the same damper."""

    depth: float
    """Below the mean surface, m."""
    stiffness: float = 2.0e6
    """Vertical, N/m."""
    damping: float = 2.0e5
    """N s/m."""

    def __post_init__(self) -> None:
        require_number("depth", self.depth, "m", low=1.0, high=1.2e4)
        require_number("stiffness", self.stiffness, "N/m", low=1.0, high=1e9)
        require_number("damping", self.damping, "N s/m", low=0.0, high=1e8)


@dataclass(frozen=True, kw_only=True)
class Water:
    """The sea that rope and load are in; all of the rope below the pulley counts as wet.

    Where a sea moves the ship (``SeaMotion``), its waves move the water about the load too; other ship motions know of
    no waves, and the water is still. The rope feels the current, but not the waves.
    """

    density: float = 1025.0
    """ρ, kg/m³."""
    surface_level: float = -5.0
    """Height of the mean surface in the base frame, m: the deck of the supply vessel is 5 m above it."""
    current: tuple[tuple[float, float, float], ...] = ()
    """Depth below the surface [m] and velocity along x and y [m/s], from above; linear in between, constant beyond."""
    waves: bool = True
    """Whether the sea's waves move the water about the load."""
    seabed: Seabed | None = None
    """None: too deep to be met."""

    def __post_init__(self) -> None:
        require_number("density", self.density, "kg/m³", low=900.0, high=1300.0)
        require_number("surface_level", self.surface_level, "m", low=-1e3, high=1e3)
        if not isinstance(self.waves, bool):
            raise InvalidValue(f"waves = {shown(self.waves)}: must be True or False")
        if self.seabed is not None:
            require_instance("seabed", self.seabed, Seabed)
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
    """What water feels of a load; the load is a point, its middle, to all else.

    Drag is ½ ρ (C_d A) |v| v, with v the velocity relative to the water: vertically, and horizontally in its own
    direction. Added mass is the mass of water that is accelerated with the load. Buoyancy, added mass and drag go with
    the share of the height that is under water; while that is between 0 and 1 the surface slams, ½ ρ (C_s A) v², with v
    the load's velocity against the surface's (DNV-RP-N103, 4.3 and 3.5).
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
    height: float = 0.0
    """m, for the way through the surface and the seabed below the load; 0: under water wherever it is."""
    slam_area: float = 0.0
    """C_s A when it enters the water, m²."""
    exit_area: float = 0.0
    """C_e A when it leaves it, m²."""

    def __post_init__(self) -> None:
        require_number("volume", self.volume, "m³", low=0.0, high=1e4)
        for name in ("added_mass_vertical", "added_mass_horizontal"):
            require_number(name, getattr(self, name), "kg", low=0.0, high=1e7)
        require_number("height", self.height, "m", low=0.01, high=1e3, or_zero=True)
        for name in ("drag_area_vertical", "drag_area_horizontal", "slam_area", "exit_area"):
            require_number(name, getattr(self, name), "m²", low=0.0, high=1e4)
        if not self.height and (self.slam_area or self.exit_area):
            raise InvalidValue(f"height = {self.height!r} m: must be above 0 m where there is a slam_area or exit_area")

    def share_under_water(self, depth: float) -> float:
        """Share of the load that is under water, its middle being ``depth`` m below the surface."""
        return share_under_water(depth, self.height)
