"""Scenario: everything that fixes one episode."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, Literal

from aframe_env.dynamics.start import heavy_lengths, longest_chain_step, springs_of_rope
from aframe_env.scenario.crane import GRAVITY, Crane
from aframe_env.scenario.luffing import Luffing
from aframe_env.scenario.motion import HarmonicMotion, ShipMotion, has_components, is_tabled
from aframe_env.scenario.target import TargetPath
from aframe_env.scenario.told import Told
from aframe_env.scenario.water import LoadShape, Water
from aframe_env.validation import InvalidValue, require_choice, require_instance, require_number, shown

Initial = Literal["comoving", "rest"]
INITIALS: tuple[str, ...] = ("comoving", "rest")
LEAST_MASS: Final = 1e-3
"""Least mass of a load, kg."""
LEAST_RAMP: Final = 1e-3
"""Shortest build-up that is one, s."""
FASTEST_BOBBING: Final = 1e4
"""Greatest angular frequency of a load bobbing on its rope, rad/s: the inner step follows it."""
SHORTEST_CHAIN_STEP: Final = 1e-4
"""Shortest inner step that a rope with mass may ask for, s."""
FASTEST_FLOW: Final = 10.0
"""Speed through the water up to which the inner step is stable, m/s."""
SURFACE_ZONE: Final = 20.0
"""Depth of the target above which the inner step is short enough for the surface's slam, m."""
SLAMMING_SPEED: Final = 3.0
"""Speed through the surface that the inner step is for, m/s."""
SLAM_SHARE: Final = 0.05
"""Share of that speed that a slam may take in an inner step."""
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
    water: Water | None = None
    """Water that rope and load are in; None for air, as in the paper."""
    load: LoadShape = field(default_factory=LoadShape)
    """What the water feels of the load."""
    target_path: TargetPath | None = None
    """Path of the target from ``target_level`` on; None: it holds."""
    sensor_delay: float | None = None
    """Time from a motion to its reading, s, in the place of the sensors' own; None: theirs."""
    told: Told | None = None
    """What the operator was told where that is not what is; None: he was told all of it truly."""
    luffing: Luffing | None = None
    """Way of the frame from its ``luffing_angle`` on; None: it holds."""

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
        require_instance("load", self.load, LoadShape)
        if self.water is not None:
            require_instance("water", self.water, Water)
        if self.target_path is not None:
            require_instance("target_path", self.target_path, TargetPath)
        if self.luffing is not None:
            require_instance("luffing", self.luffing, Luffing)
            self.luffing.require_frame(self.crane)
        self._require_room()
        self._require_wet()
        least, most = self.crane.winch.min_rope_length, self.crane.winch.max_rope_length
        breaking_load = self.crane.rope.breaking_load
        if self.hanging_weight >= breaking_load > self.weight:
            raise InvalidValue(
                f"target_level = {self.target_level!r} m: a rope that weighs {self.rope_weight:g} N/m would bear "
                f"{self.hanging_weight:g} N with its load: must be below {breaking_load:g} N, at which it parts"
            )
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
        self._require_way()
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
        self._require_chain()
        if self.sensor_delay is not None:
            require_number("sensor_delay", self.sensor_delay, "s", low=0.0, high=10.0)
        if self.told is not None:
            require_instance("told", self.told, Told)
            try:
                self.as_told  # noqa: B018 - refuse now what could not be, were it so
            except InvalidValue as error:
                raise InvalidValue(f"told: {error}") from None

    @cached_property
    def as_told(self) -> Scenario:
        """The scenario as the operator was told it: all that a policy may know, unless it is privileged.

        This very scenario where nothing that was told differs. Target and ``free_length``, which the rope counter
        reads, are the true ones.
        """
        if self.told is None:
            return self
        crane, lift = self.told.of(self.crane), self.told.differences(self, "load_mass", "load", "sensor_delay")
        if crane is self.crane and not lift:
            return self
        told = replace(self, told=None, crane=crane, **lift)
        # With the numbers told another length would hold the load at its target; the counter reads what is paid out.
        told.__dict__["free_length"] = self.free_length
        return told

    @property
    def max_drum_speed(self) -> float:
        """Speed limit of the drum, rad/s."""
        return self.crane.winch.max_speed

    @property
    def target_levels(self) -> tuple[float, float]:
        """Lowest and highest level of the target, m."""
        low, high = (0.0, 0.0) if self.target_path is None else self.target_path.changes
        return self.target_level + low, self.target_level + high

    @property
    def bed_level(self) -> float:
        """Level of the seabed, m; -inf without one."""
        water = self.water
        return -math.inf if water is None or water.seabed is None else water.surface_level - water.seabed.depth

    def _require_room(self) -> None:
        """Raise where the target is not between pulley and seabed."""
        name = "target_level" if self.target_path is None else "target_level with its path"
        low, high = self.target_levels
        pulley, ground = (
            min(crane.pulley_position[2] for crane in self.cranes),
            self.bed_level + 0.5 * self.load.height,
        )
        if high >= pulley:
            raise InvalidValue(f"{name} = {high!r} m: must be below the pulley, in (-inf, {pulley:g}) m")
        if low < ground:
            raise InvalidValue(
                f"{name} = {low!r} m: must be in [{ground:g}, {pulley:g}) m, between the seabed, with half the height "
                "of the load on it, and the pulley"
            )

    def _require_way(self) -> None:
        """Raise where rope or winch do not reach the ends of the target's path."""
        if self.target_path is None and self.luffing is None:
            return
        name = "luffing" if self.target_path is None else "target_path"
        winch, breaking_load = self.crane.winch, self.crane.rope.breaking_load
        for level, crane in itertools.product(self.target_levels, self.cranes):
            parts = self._lengths(crane, level)
            if not winch.min_rope_length < sum(parts) < winch.max_rope_length:
                raise InvalidValue(
                    f"{name} takes the load to {level:g} m, with {sum(parts):g} m of unstretched rope: must be in "
                    f"({winch.min_rope_length:g}, {winch.max_rope_length:g}) m, the winch's limits"
                )
            if self.weight + self.rope_weight * parts[0] >= breaking_load:
                raise InvalidValue(
                    f"{name} takes the load to {level:g} m, where rope and load weigh "
                    f"{self.weight + self.rope_weight * parts[0]:g} N: must be below {breaking_load:g} N, at which the "
                    "rope parts"
                )

    @property
    def cranes(self) -> list[Crane]:
        """The crane at the start, and where it luffs at the angles that pulley and rope reach furthest at."""
        return [self.crane] if self.luffing is None else self.luffing.cranes(self.crane)

    def _lengths(self, crane: Crane, level: float) -> tuple[float, float]:
        """Unstretched rope below a crane's pulley and from there to the drum, m, that holds the load at ``level``."""
        length, axial = crane.pulley_position[2] - level, self.crane.rope.axial_stiffness
        return heavy_lengths(length, crane.drum_to_pulley, self.weight, axial, self.rope_weight)

    def _require_wet(self) -> None:
        """Raise where water, rope and load do not go together."""
        rope = self.crane.rope
        if self.water is None:
            if self.load != LoadShape():
                raise InvalidValue(f"load = {shown(self.load)}: goes with water, and there is none")
            return
        if self.rope_weight < 0.0:
            raise InvalidValue(
                f"solid_diameter = {rope.solid_diameter!r} m: the rope floats in water of {self.water.density:g} "
                f"kg/m³: must be at most {2.0 * math.sqrt(rope.mass_per_length / (math.pi * self.water.density)):g} m"
            )
        if self.weight <= 0.0:
            raise InvalidValue(
                f"volume = {self.load.volume!r} m³: a load of {self.load_mass:g} kg floats: must be below "
                f"{self.load_mass / self.water.density:g} m³"
            )

    def _require_chain(self) -> None:
        """Raise where the waves in the rope are too fast for the inner step."""
        if self.attached_step < SHORTEST_CHAIN_STEP:
            raise InvalidValue(
                f"seabed, compensator, drive, or drag and slam on a load of {self.load_mass:g} kg need steps of "
                f"{self.attached_step:.2g} s: must be at least {SHORTEST_CHAIN_STEP:g} s: make them softer, slower or "
                "smaller, or load and drum heavier"
            )
        if self.chain_step < SHORTEST_CHAIN_STEP:
            raise InvalidValue(
                f"mass_per_length = {self.crane.rope.mass_per_length!r} kg/m: the waves in the rope need steps of "
                f"{self.chain_step:.2g} s, must be at least {SHORTEST_CHAIN_STEP:g} s: make it 0 kg/m, or the rope "
                "heavier, softer or less damped"
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
        """Weight of the load, less its buoyancy at its target, N."""
        return (self.load_mass - self.density * self.load.volume * self.share_under_water) * self.gravity

    @property
    def share_under_water(self) -> float:
        """Share of the load that is under water at its target in calm water; 1 for a load without height."""
        if self.water is None:
            return 0.0
        return self.load.share_under_water(self.water.surface_level - self.target_level)

    @property
    def density(self) -> float:
        """ρ of what is around rope and load, kg/m³; 0 in air."""
        return 0.0 if self.water is None else self.water.density

    @property
    def rope_weight(self) -> float:
        """w, weight of a metre of rope less its buoyancy, N/m."""
        return self.crane.rope.weight_per_length(self.gravity, self.density) if self.crane.rope.mass_per_length else 0.0

    @property
    def hanging_weight(self) -> float:
        """Weight of the load and of the rope below the pulley, N."""
        return self.weight + self.rope_weight * self.lengths[0]

    @property
    def pulley_strain(self) -> float:
        """Strain at rest of the rope at the pulley: what the drum pays out is longer by that."""
        return self.hanging_weight / self.crane.rope.axial_stiffness

    @property
    def is_light(self) -> bool:
        """Whether nothing goes beyond the paper: rope without mass, in air, plain winch, target and frame that hold."""
        return (
            self.water is None
            and not self.crane.rope.mass_per_length
            and self.crane.is_plain
            and self.target_path is None
            and self.luffing is None
        )

    def require_light(self, what: str) -> None:
        """Raise where something goes beyond the paper: ``what`` takes its rope, winch and target alone."""
        if not self.is_light:
            raise InvalidValue(
                f"mass_per_length = {self.crane.rope.mass_per_length!r} kg/m, water = {shown(self.water)}, target_path "
                f"= {shown(self.target_path)}, luffing = {shown(self.luffing)}: {what} take a rope without mass in "
                "air, a winch without further limits, a target and a frame that hold: must be 0 kg/m, None, None and "
                "None"
            )

    @cached_property
    def lengths(self) -> tuple[float, float]:
        """Unstretched rope below the pulley and from there to the drum, m, that hold the load at its target at rest."""
        return self._lengths(self.crane, self.target_level)

    @cached_property
    def springs(self) -> int:
        """Springs that the rope is divided into, one more than it has lumps of mass; 0 for the paper's rope."""
        rope = self.crane.rope
        return 0 if self.is_light else springs_of_rope(self.lengths[0], rope.mass_per_length, self.load_mass)

    @cached_property
    def free_length(self) -> float:
        """l_0, m: unstretched length between drum and load that holds the load at its target, ship at rest."""
        if self.springs > 1:
            return sum(self.lengths)
        return self.crane.free_length(self.rope_length, self.weight + 0.5 * self.rope_weight * self.lengths[0])

    @property
    def chain_step(self) -> float:
        """Longest stable inner step for the rope, s, with a tenth of its length wound up; inf without lumps.

        What a frame that luffs leaves of it at the least counts.
        """
        rope, lumps = self.crane.rope, self.springs - 1
        if lumps < 1:
            return math.inf
        mass = self.load_mass + self.load.added_mass_vertical
        shortest = min(self._lengths(crane, self.target_level)[0] for crane in self.cranes)
        return longest_chain_step(
            0.9 * shortest / lumps, rope.mass_per_length, rope.axial_stiffness, mass, self.loss_time
        )

    @property
    def attached_step(self) -> float:
        """Longest inner step for what is about load and drum, s; inf in air with nothing attached.

        Stable for seabed, drag, passive compensator and drive, and short beside the surface's slam.
        """
        rates = [self._compensator_rate, *self._drive_rates, *self._water_rates]
        return 1.0 / max(rates) if any(rates) else math.inf

    @property
    def _compensator_rate(self) -> float:
        """Rate at which a passive compensator gives way to the rope's spring, halved, 1/s."""
        if self.crane.compensator is None:
            return 0.0
        stiffness = self._top_stiffness
        return 0.5 * stiffness / (self.crane.compensator.damping + stiffness * self.loss_time)

    @property
    def _drive_rates(self) -> list[float]:
        """Rates of what turns a drum with inertia, on the rope's spring, each by what a step may be of it, 1/s."""
        winch = self.crane.winch
        return [] if winch.drive is None else winch.drive.rates(self._top_stiffness, self.loss_time, winch.drum_radius)

    @property
    def _top_stiffness(self) -> float:
        """Stiffness of the rope's uppermost spring with a tenth of the rope wound up, N/m."""
        below, drum_part = self.lengths
        top = drum_part + (0.45 * below / (self.springs - 1) if self.springs > 1 else 0.9 * below)
        return self.crane.rope.axial_stiffness / top

    @property
    def _water_rates(self) -> list[float]:
        """Rates that seabed, drag and slam change the load's velocity at, each by what a step may be of it, 1/s."""
        if self.water is None:
            return []
        load, mass, half_density = self.load, self.load_mass, 0.5 * self.density
        rates = [
            half_density * load.drag_area_vertical * FASTEST_FLOW / (mass + load.added_mass_vertical),
            half_density * load.drag_area_horizontal * FASTEST_FLOW / (mass + load.added_mass_horizontal),
        ]
        if self.water.seabed is not None:
            bed = self.water.seabed
            rates += [2.0 * math.sqrt(bed.stiffness / mass), bed.damping / mass]
        if self.target_levels[1] + load.height > self.water.surface_level - SURFACE_ZONE:
            rates.append(half_density * max(load.slam_area, load.exit_area) * SLAMMING_SPEED / mass / SLAM_SHARE)
        return rates

    @property
    def loss_time(self) -> float:
        """β of the rope's damping, the material's and ``rope_damping``, s."""
        return self.total_rope_damping / self.rope_stiffness

    @property
    def rope_stiffness(self) -> float:
        """c_R = E_R F_R / l_0, N/m."""
        return self.crane.rope.axial_stiffness / self.free_length

    @property
    def moved_mass(self) -> float:
        """Mass that bobs on the rope, kg: the load's, its added mass, and a third of the rope's below the pulley."""
        if self.is_light:
            return self.load_mass
        rope = self.crane.rope.mass_per_length * self.lengths[0]
        return self.load_mass + self.load.added_mass_vertical + rope / 3.0

    @property
    def rope_frequency(self) -> float:
        """Angular frequency of the load bobbing on the rope, rad/s; of a heavy rope within 3 % (at three loads)."""
        return math.sqrt(self.rope_stiffness / self.moved_mass)

    @property
    def total_rope_damping(self) -> float:
        """d_R with what the material's loss time adds, N s/m."""
        return self.rope_damping + self.crane.rope.loss_time * self.rope_stiffness

    @property
    def rope_damping_rate(self) -> float:
        """d_R over the mass that it damps, 1/s."""
        return self.total_rope_damping / self.moved_mass
