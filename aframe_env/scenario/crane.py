"""The crane and its parts. Numbers in SI units; the defaults are the reference crane.

Axes (right-handed): the deck frame {D} has its origin midway between the feet, x outboard (aft, for a frame
at the stern), z up, and y to the left of somebody who looks outboard. The frame axes {F} share the origin
and are turned about y by the luffing angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

from aframe_env.dynamics.start import free_length, radius_of_layer
from aframe_env.scenario.cross_sections import FrameStructure
from aframe_env.scenario.drive import TorqueDrive
from aframe_env.validation import InvalidValue, require_instance, require_number, require_vector

Vector = tuple[float, float, float]

GRAVITY = 9.81
"""Acceleration of gravity, m/s² (the reference crane's figure)."""
LEAST_ARM = 1e-4
"""Least lever arm of the servomotors about the feet, m."""


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Geometry of the A-frame: a portal of two legs and a top beam, luffed by two servomotors."""

    half_width: float = 5.0
    """Half the distance between the feet A_R and A_L, m."""
    height: float = 12.0
    """Height of the corners B_R, B_L and of the pulley S along z of {F}, m."""
    luffing_angle: float = math.radians(25.0)
    """Luffing angle φ, rad; positive leans outboard."""
    servomotor_height: float = 4.8
    """Height of the servomotor ends N_R, N_L on the legs, along z of {F}, m."""
    servomotor_deck_x: float = -5.0
    """x coordinate in {D} of the servomotor ends C_R, C_L on the deck, m."""
    structure: FrameStructure = field(default_factory=FrameStructure)
    """Material, sections and servomotors (the full model alone reads them)."""

    def __post_init__(self) -> None:
        require_number("half_width", self.half_width, "m", low=0.01, high=1e3)
        require_number("height", self.height, "m", low=0.01, high=1e3)
        require_number("luffing_angle", self.luffing_angle, "rad", low=-1.4, high=1.4)
        require_number("servomotor_height", self.servomotor_height, "m", low=1e-3, high=self.height)
        require_number("servomotor_deck_x", self.servomotor_deck_x, "m", low=-1e4, high=1e4)
        require_instance("structure", self.structure, FrameStructure)
        if self.servomotor_arm < LEAST_ARM:
            raise InvalidValue(
                f"servomotor_deck_x = {self.servomotor_deck_x!r} m: the servomotors' line passes the feet at "
                f"{self.servomotor_arm:g} m: must be at least {LEAST_ARM:g} m, or they cannot hold the frame"
            )

    @property
    def servomotor_length(self) -> float:
        """Distance of the servomotors' ends N and C, m."""
        height = self.servomotor_height * math.cos(self.luffing_angle)
        return math.hypot(self.servomotor_height * math.sin(self.luffing_angle) - self.servomotor_deck_x, height)

    @property
    def servomotor_arm(self) -> float:
        """Lever arm of the servomotors about the feet, m."""
        height = self.servomotor_height * math.cos(self.luffing_angle)
        return abs(self.servomotor_deck_x) * height / self.servomotor_length


@dataclass(frozen=True, kw_only=True)
class Rope:
    """Elastic hoisting rope, which can pull and cannot push."""

    axial_stiffness: float = 2.0e8
    """E_R F_R, N. The default is about a 70 mm six-strand steel rope."""
    breaking_load: float = 3.42e6
    """Tension at which the rope parts, N. Default: 0.356 d² R with d = 70 mm, R = 1960 N/mm² (EN 12385-4)."""
    mass_per_length: float = 0.0
    """μ, kg/m; 0 for the paper's rope, which has none. ``six_strand`` has that of the default's construction."""
    solid_diameter: float = 0.0
    """Diameter of the solid bar that displaces as much water, m."""
    tangential_drag: float = 0.008
    """C_t of water along the rope: ½ ρ C_t π d v² N for each metre, with d the solid diameter."""
    outer_diameter: float = 0.0
    """Diameter that water across the rope meets, m."""
    across_drag: float = 1.2
    """C_n of water across the rope: ½ ρ C_n d v² N for each metre, with d the outer diameter."""
    loss_time: float = 0.0
    """β, s: time constant of the material's damping, E F (e + β de/dt); adds to a scenario's ``rope_damping``."""

    def __post_init__(self) -> None:
        require_number("axial_stiffness", self.axial_stiffness, "N", low=1.0, high=1e12)
        require_number("breaking_load", self.breaking_load, "N", low=1.0, high=1e12)
        require_number("mass_per_length", self.mass_per_length, "kg/m", low=1e-3, high=1e3, or_zero=True)
        require_number("solid_diameter", self.solid_diameter, "m", low=0.0, high=1.0)
        require_number("tangential_drag", self.tangential_drag, "", low=0.0, high=1.0)
        require_number("outer_diameter", self.outer_diameter, "m", low=0.0, high=1.0)
        require_number("across_drag", self.across_drag, "", low=0.0, high=10.0)
        require_number("loss_time", self.loss_time, "s", low=0.0, high=1.0)

    @classmethod
    def six_strand(cls, **changes: float) -> Rope:
        """Return the default rope with the mass, volume and damping of 70 mm of six-strand steel rope.

        ``changes`` replace further fields.
        """
        return cls(
            **{"mass_per_length": 19.55, "solid_diameter": 0.056, "outer_diameter": 0.07, "loss_time": 0.01, **changes}
        )

    def weight_per_length(self, gravity: float, density: float) -> float:
        """Weight of a metre of rope less its buoyancy in a fluid of ``density`` kg/m³, N/m."""
        return (self.mass_per_length - density * 0.25 * math.pi * self.solid_diameter**2) * gravity


@dataclass(frozen=True, kw_only=True)
class Winch:
    """The drum and its drive: an actuator with limits on speed, acceleration and paid-out length."""

    drum_diameter: float = 1.5
    """d_H, m: that of the rope's centre line in the innermost layer."""
    max_rope_speed: float = 3.0
    """Speed limit, m/s of rope."""
    max_rope_acceleration: float = 2.0
    """Acceleration limit, m/s² of rope."""
    lag: float = 0.0
    """Time constant of the first-order response of speed to its command, s; 0 for none."""
    min_rope_length: float = 20.0
    """Upper hoist limit switch: least unstretched length paid out between drum and load, m."""
    max_rope_length: float = 3000.0
    """Rope on the drum: greatest unstretched length between drum and load, m."""
    max_power: float = 0.0
    """Power at the drum, W: the speed falls as the tension grows; 0 for no limit."""
    max_torque: float = 0.0
    """Torque at the drum, N m: beyond it the load turns the drum; 0 for no limit."""
    inertia: float = 0.0
    """Of drum and drive about the drum's axis, kg m²; goes with ``max_torque``."""
    drum_width: float = 0.0
    """Width that the rope is wound on in layers, m; 0: one layer, however long the rope is."""
    drive: TorqueDrive | None = None
    """What turns a drum with inertia; None: the drum follows its command as far as the limits above let it."""

    def __post_init__(self) -> None:
        require_number("drum_diameter", self.drum_diameter, "m", low=1e-3, high=1e3)
        require_number("max_rope_speed", self.max_rope_speed, "m/s", low=1e-6, high=1e3)
        require_number("max_rope_acceleration", self.max_rope_acceleration, "m/s²", low=1e-6, high=1e6)
        require_number("lag", self.lag, "s", low=0.0, high=1e4)
        require_number("min_rope_length", self.min_rope_length, "m", low=1e-3, high=1e5)
        require_number("max_rope_length", self.max_rope_length, "m", low=self.min_rope_length, high=1e5, low_open=True)
        require_number("max_power", self.max_power, "W", low=1.0, high=1e10, or_zero=True)
        require_number("max_torque", self.max_torque, "N m", low=1.0, high=1e10, or_zero=True)
        require_number("inertia", self.inertia, "kg m²", low=1e-3, high=1e9, or_zero=True)
        require_number("drum_width", self.drum_width, "m", low=1e-3, high=100.0, or_zero=True)
        if bool(self.max_torque) != bool(self.inertia):
            raise InvalidValue(
                f"max_torque = {self.max_torque!r} N m, inertia = {self.inertia!r} kg m²: must both be 0, or neither"
            )
        if self.drive is not None:
            require_instance("drive", self.drive, TorqueDrive)
            for name, unit in (("max_power", "W"), ("max_torque", "N m")):
                if getattr(self, name):
                    raise InvalidValue(
                        f"{name} = {getattr(self, name)!r} {unit}: a drive has its own, motor_power and motor_torque: "
                        f"must be 0 {unit}"
                    )

    @property
    def drum_radius(self) -> float:
        """d_H / 2, m."""
        return 0.5 * self.drum_diameter

    @property
    def max_speed(self) -> float:
        """Speed limit of the drum, rad/s."""
        return self.max_rope_speed / self.drum_radius

    @property
    def max_acceleration(self) -> float:
        """Acceleration limit of the drum, rad/s²."""
        return self.max_rope_acceleration / self.drum_radius


@dataclass(frozen=True, kw_only=True)
class Compensator:
    """Passive heave compensator between drum and pulley: a cylinder with a gas behind it that pays rope out.

    T = F (l / (l - s))^n + c ds/dt, with s the rope that it has given; at the ends of its stroke it stands.
    """

    stroke: float = 6.0
    """m of rope, half of it to either side of the middle, where it starts."""
    gas_length: float = 120.0
    """l, volume of the gas at mid-stroke over the piston's area, in m of rope. The load's period on it is
    2 π √(l / (n g)), whatever its mass: 19 s."""
    exponent: float = 1.3
    """n, from 1 (isothermal) to 1.4 (adiabatic)."""
    damping: float = 5.0e4
    """c, N s/m."""
    preload: float = 0.0
    """F, N; 0: what load and rope weigh at the start."""

    def __post_init__(self) -> None:
        require_number("stroke", self.stroke, "m", low=1e-3, high=100.0)
        require_number("gas_length", self.gas_length, "m", low=0.5 * self.stroke + 0.5, high=1e4)
        require_number("exponent", self.exponent, "", low=1.0, high=1.67)
        require_number("damping", self.damping, "N s/m", low=1e3, high=1e9)
        require_number("preload", self.preload, "N", low=1.0, high=1e9, or_zero=True)


@dataclass(frozen=True, kw_only=True)
class Crane:
    """A-frame crane: frame, rope, winch and the drum's place on the deck."""

    frame: Frame = field(default_factory=Frame)
    rope: Rope = field(default_factory=Rope)
    winch: Winch = field(default_factory=Winch)
    drum_position: Vector = (-2.0, 0.0, 1.0)
    """Drum H in {D}, m."""
    sheave_friction: float = 0.0
    """Share by which the tension on the drum's side of the pulley is above that on the load's while rope is hauled in,
    and below while it is paid out; 0.02 to 0.05 for a sheave on rolling or plain bearings."""
    compensator: Compensator | None = None
    """Passive compensator, or None."""

    def __post_init__(self) -> None:
        require_instance("frame", self.frame, Frame)
        require_instance("rope", self.rope, Rope)
        require_instance("winch", self.winch, Winch)
        require_vector("drum_position", self.drum_position, "m", low=-1e4, high=1e4)
        require_number("sheave_friction", self.sheave_friction, "", low=0.0, high=0.2)
        if self.compensator is not None:
            require_instance("compensator", self.compensator, Compensator)
        diameter = self.rope.outer_diameter
        if self.winch.drum_width and not 0.0 < diameter <= self.winch.drum_width:
            raise InvalidValue(
                f"outer_diameter = {diameter!r} m: must be in (0, {self.winch.drum_width:g}] m, the drum_width, for "
                "the rope to be wound in layers"
            )
        if self.drum_to_pulley < 1e-3:
            raise InvalidValue(f"drum_position = {self.drum_position} m: must not be the pulley's place, within 1 mm")

    @cached_property
    def pulley_position(self) -> Vector:
        """Pulley S, the middle of the top beam, in {D} with the frame rigid, m."""
        angle, height = self.frame.luffing_angle, self.frame.height
        return (height * math.sin(angle), 0.0, height * math.cos(angle))

    @cached_property
    def drum_to_pulley(self) -> float:
        """|SH| with the frame rigid, m."""
        return math.dist(self.pulley_position, self.drum_position)

    @property
    def layer(self) -> tuple[float, float]:
        """Height of a layer of rope on the drum, whose turns lie in the grooves of those below, m, and its turns.

        Height 0 where the winch winds no layers.
        """
        diameter = self.rope.outer_diameter
        if not self.winch.drum_width:
            return 0.0, 1.0
        return 0.5 * math.sqrt(3.0) * diameter, float(int(self.winch.drum_width / diameter + 1e-9))

    def drum_radius(self, length: float) -> float:
        """Radius [m] at which the rope runs off the drum with ``length`` m of it between drum and load."""
        if not self.winch.drum_width:
            return self.winch.drum_radius
        return radius_of_layer(length, *self.layer, self.winch.drum_radius, self.winch.max_rope_length)

    @property
    def is_plain(self) -> bool:
        """Whether the winch has the paper's limits alone, and drum and pulley nothing but rope between them."""
        winch = self.winch
        further = winch.max_power or winch.max_torque or winch.drum_width or winch.drive
        return not (further or self.sheave_friction or self.compensator)

    def free_length(self, rope_length: float, weight: float) -> float:
        """Unstretched rope [m] between drum and a load of ``weight`` N that hangs ``rope_length`` m below the pulley.

        The ship is at rest and the frame rigid.
        """
        return free_length(rope_length, self.drum_to_pulley, weight, self.rope.axial_stiffness)
