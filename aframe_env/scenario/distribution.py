"""The distribution that scenarios are drawn from."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

import numpy as np

from aframe_env.dynamics.start import LIGHT_ROPE, SHORT_ROPE, critical_damping, heavy_lengths
from aframe_env.scenario.crane import GRAVITY, Crane
from aframe_env.scenario.interval import Range, factor, highest, require_range, uniform_of, within
from aframe_env.scenario.recorded_motion import RecordedMotion, RecordedWindow
from aframe_env.scenario.scenario import LEAST_MASS, LEAST_RAMP, Scenario
from aframe_env.scenario.sea import FULL_TURN, Sea, SeaMotion, dnv_gamma
from aframe_env.scenario.sensors import Sensors
from aframe_env.scenario.target import TargetPath
from aframe_env.scenario.told import Told
from aframe_env.scenario.vessel import Vessel
from aframe_env.scenario.water import LoadShape, Water
from aframe_env.validation import InvalidValue, require_instance, require_integer, require_number, shown

SUBSTREAM: Final = 8
"""Numbers that sea, load and rope each take from the generator, however many they need. Each has its place: what is
drawn more leaves what was drawn before as it was."""
FASTEST_CURRENT: Final = 5.0
"""Greatest speed of a drawn current, m/s."""
NUMBERS: Final = 3 * SUBSTREAM
"""Random numbers that a scenario is drawn with."""


_WET: Final = (
    "added_mass_factor",
    "drag_factor",
    "current_factor",
    "current_turn",
    "told_added_mass_error",
    "told_drag_error",
)
"""What goes with water."""
_CRANE: Final = {
    "axial_stiffness": ("N", 1.0, 1e12),
    "max_rope_speed": ("m/s", 1e-6, 1e3),
    "max_rope_acceleration": ("m/s²", 1e-6, 1e6),
    "lag": ("s", 0.0, 1e4),
    "sensor_delay": ("s", 0.0, 10.0),
}
"""What may be drawn of crane and sensors: unit, least and greatest value."""
_ERRORS: Final = {
    "told_mass_error": "load_mass",
    "told_stiffness_error": "axial_stiffness",
    "told_added_mass_error": "load",
    "told_drag_error": "load",
}
"""What is told with an error, and what it then is told of."""


@dataclass(frozen=True, kw_only=True)
class ScenarioDistribution:
    """Distribution of scenarios: seas or recorded motions, load masses and rope lengths, exact or intervals.

    Sea, load and rope take their random numbers from sub-streams of their own: changing one leaves the others'
    draws alone.
    """

    hs: Range = (0.5, 4.0)
    """Significant wave height, m."""
    tp: Range = (6.0, 14.0)
    """Peak period, s."""
    heading: Range = (0.0, 2.0 * math.pi)
    """Direction that the waves travel towards, rad from the bow."""
    gamma: Range | Literal["dnv"] = "dnv"
    """Peak enhancement factor; "dnv" takes the one that goes with Hs and Tp."""
    spectrum: str = "jonswap"
    """Or "pierson-moskowitz"."""
    spreading: int | None = None
    """Exponent n of the cosine spreading of directions, see ``Sea``; None for long-crested seas."""
    components: int = 32
    """Waves that a sea is made of."""
    vessel: Vessel = field(default_factory=Vessel.supply)
    load_mass: Range = (20.0e3, 100.0e3)
    """kg."""
    rope_length: Range = (50.0, 1500.0)
    """|LS| with the ship at rest, m."""
    rope_damping_ratio: Range = (0.01, 0.05)
    """Damping of the load's bobbing on the rope, share of critical."""
    ramp: float = 10.0
    """Time over which the ship's motion builds up, s."""
    crane: Crane = field(default_factory=Crane)
    sensors: Sensors = field(default_factory=Sensors)
    """Sensors of the observation "sensors"."""
    records: tuple[RecordedMotion, ...] = ()
    """Recorded motions in place of the seas: each episode meets a stretch of one of them, from a random start."""
    window: float = 60.0
    """Length of a stretch of ``records``, s; at least an episode's."""
    water: Water | None = None
    """Water that rope and load are in; None for air."""
    load: LoadShape = field(default_factory=LoadShape)
    """Shape of a load with the mass in the middle of ``load_mass``. One that is drawn has the same form and density:
    volume and added masses go with its mass, areas with its power of two thirds, its height with that of one third, and
    none floats that others do not."""
    target_path: TargetPath | None = None
    """Path of the target from where the load hangs at the start; None: it holds."""
    added_mass_factor: Range = 1.0
    """What the added masses are multiplied by."""
    drag_factor: Range = 1.0
    """What the drag areas are multiplied by."""
    current_factor: Range = 1.0
    """What the velocities of the water's current are multiplied by."""
    current_turn: Range = 0.0
    """Angle that the current is turned by, from x to y, rad."""
    axial_stiffness: Range | None = None
    """Of the rope, N; None: the crane's."""
    max_rope_speed: Range | None = None
    """Of the winch, m/s; None: the crane's."""
    max_rope_acceleration: Range | None = None
    """Of the winch, m/s²; None: the crane's."""
    lag: Range | None = None
    """Of the winch, s; None: the crane's."""
    sensor_delay: Range | None = None
    """Time from a motion to its reading, s; the operator is told that of ``sensors``. None: that is true."""
    told: Told | None = None
    """What the operator is told in every scenario, whatever is drawn; None: the truth, but for the errors below."""
    told_mass_error: float = 0.0
    """The load's mass is told wrongly by up to ± this share of it."""
    told_stiffness_error: float = 0.0
    """And so is the rope's axial stiffness."""
    told_added_mass_error: float = 0.0
    """And so are the load's added masses."""
    told_drag_error: float = 0.0
    """And so are its drag areas."""

    def __post_init__(self) -> None:
        require_range("hs", self.hs, "m", 0.0, 30.0)
        require_range("tp", self.tp, "s", 2.0, 40.0)
        require_range("heading", self.heading, "rad", -FULL_TURN, FULL_TURN)
        if not isinstance(self.gamma, str):
            require_range("gamma", self.gamma, "", 1.0, 10.0)
        elif self.gamma != "dnv":
            raise InvalidValue(f"gamma = {shown(self.gamma)}: must be 'dnv', a number or a tuple in [1, 10]")
        require_number("ramp", self.ramp, "s", low=LEAST_RAMP, high=1e4, or_zero=True)
        require_range("load_mass", self.load_mass, "kg", LEAST_MASS, 1e7)
        require_range("rope_length", self.rope_length, "m", 0.0, 1e5, low_open=True)
        require_range("rope_damping_ratio", self.rope_damping_ratio, "of critical", 0.0, 1.0)
        require_integer("components", self.components, low=1, high=4096)
        require_instance("crane", self.crane, Crane)
        require_instance("sensors", self.sensors, Sensors)
        require_number("window", self.window, "s", low=0.0, high=1e6, low_open=True)
        require_instance("load", self.load, LoadShape)
        if self.target_path is not None:
            require_instance("target_path", self.target_path, TargetPath)
        self._require_crane_and_told()
        self._require_water()
        self._require_records()
        self._require_rope()
        # The corners of the distribution must be scenarios: refuse now rather than in the middle of a run.
        for load, rope in itertools.product((0.0, 1.0), repeat=2):
            self._build(np.full(SUBSTREAM, load), np.full(SUBSTREAM, load), np.full(SUBSTREAM, rope))
        if self.crane.rope.mass_per_length:
            self._build(*self._finest_chain())

    def _finest_chain(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers of the scenario whose rope asks for the shortest steps.

        That of the shortest rope which is a chain, with the greatest damping and the heaviest load beside which it is.
        """
        load, length = np.ones(SUBSTREAM), np.ones(SUBSTREAM)
        rope = self._crane(length).rope
        load[0] = uniform_of(self.load_mass, (1.0 - 1e-9) * SHORT_ROPE * rope.mass_per_length / LIGHT_ROPE)
        # In air, where it is stretched more: in water the very shortest is a hair longer.
        pull = (within(self.load_mass, float(load[0])) + 0.5 * rope.mass_per_length * SHORT_ROPE) * GRAVITY
        length[0] = uniform_of(self.rope_length, SHORT_ROPE * (1.0 + pull / rope.axial_stiffness))
        return load, load, length

    def _require_water(self) -> None:
        """Raise where water, current and what is drawn of them do not go together."""
        require_range("added_mass_factor", self.added_mass_factor, "", 0.0, 100.0)
        require_range("drag_factor", self.drag_factor, "", 0.0, 100.0)
        require_range("current_factor", self.current_factor, "", 0.0, 100.0)
        require_range("current_turn", self.current_turn, "rad", -FULL_TURN, FULL_TURN)
        if self.water is not None:
            require_instance("water", self.water, Water)
        current = () if self.water is None else self.water.current
        for name in _WET:
            value = getattr(self, name)
            if value == getattr(ScenarioDistribution, name):
                continue
            if self.water is None:
                raise InvalidValue(f"{name} = {shown(value)}: goes with water, and there is none")
            if name.startswith("current") and not current:
                raise InvalidValue(f"{name} = {shown(value)}: goes with a current, and the water has none")
        speed = max((math.hypot(x, y) for _, x, y in current), default=0.0) * highest(self.current_factor)
        drawn = self.current_factor != 1.0 or self.current_turn != 0.0
        if drawn and speed > FASTEST_CURRENT:
            raise InvalidValue(
                f"current_factor = {shown(self.current_factor)}: the current would run at {speed:g} m/s: must be at "
                f"most {FASTEST_CURRENT:g} m/s"
            )

    def _require_crane_and_told(self) -> None:
        """Raise where what is drawn of crane, sensors and what is told is out of range."""
        for name, (unit, low, high) in _CRANE.items():
            value = getattr(self, name)
            if value is not None:
                require_range(name, value, unit, low, high)
        if self.told is not None:
            require_instance("told", self.told, Told)
            if self.told.sensor_delay is not None:
                raise InvalidValue(
                    f"told: sensor_delay = {self.told.sensor_delay!r} s: must be None, for the delay of sensors is told"
                )
        for name, told in _ERRORS.items():
            require_number(name, getattr(self, name), "", low=0.0, high=0.9)
            if getattr(self, name) and getattr(self.told, told, None) is not None:
                raise InvalidValue(f"{name} = {getattr(self, name)!r}: must be 0 where told has a {told}")

    def _require_records(self) -> None:
        """Raise where a record is none, or shorter than the stretch that is drawn from it, or a sea is given beside."""
        require_instance("records", self.records, tuple)
        if not self.records:
            if self.window != ScenarioDistribution.window:
                raise InvalidValue(f"window = {self.window:g} s: goes with records, and there are none")
            return
        for name in ("hs", "tp", "heading", "gamma", "spectrum", "spreading", "components"):
            if getattr(self, name) != getattr(ScenarioDistribution, name):
                raise InvalidValue(
                    f"{name} = {getattr(self, name)!r}: goes with seas, and records stand in their place"
                )
        for record in self.records:
            require_instance("records", record, RecordedMotion)
            if record.duration < self.window:
                name = "a record" if record.path is None else str(record.path)
                raise InvalidValue(
                    f"window = {self.window:g} s: must be in (0, {record.duration:g}] s, the length of {name}"
                )

    def _require_rope(self) -> None:
        """Raise where a rope is longer or shorter than the winch allows, in the user's words."""
        least, most = self.crane.winch.min_rope_length, self.crane.winch.max_rope_length
        for length in self.rope_length if isinstance(self.rope_length, tuple) else (self.rope_length,):
            for mass in self.load_mass if isinstance(self.load_mass, tuple) else (self.load_mass,):
                paid_out = self._paid_out(length, mass)
                if not least < paid_out < most:
                    raise InvalidValue(
                        f"rope_length = {self.rope_length!r} m: {length:g} m needs {paid_out:g} m of unstretched rope "
                        f"between drum and load: must be in ({least:g}, {most:g}) m, the winch's limits"
                    )

    def _paid_out(self, rope_length: float, load_mass: float) -> float:
        """Unstretched rope between drum and a load at rest, m; of a heavy rope, as if it were long."""
        crane, weight = self.crane, load_mass * GRAVITY
        if self._is_light:
            return crane.free_length(rope_length, weight)
        density = 0.0 if self.water is None else self.water.density
        weight -= density * self._shape(load_mass, 1.0, 1.0).volume * GRAVITY
        rope_weight = crane.rope.weight_per_length(GRAVITY, density) if crane.rope.mass_per_length else 0.0
        return sum(heavy_lengths(rope_length, crane.drum_to_pulley, weight, crane.rope.axial_stiffness, rope_weight))

    @property
    def _is_light(self) -> bool:
        return self.water is None and not self.crane.rope.mass_per_length

    @property
    def max_drum_speed(self) -> float:
        """Speed limit of the fastest winch, rad/s."""
        return self._crane(np.ones(SUBSTREAM)).winch.max_speed

    def require_known_crane(self, what: str) -> None:
        """Raise where cranes, or what is told of them, differ: ``what`` takes one crane that is told truly."""
        for name in (*_CRANE, "told", *_ERRORS):
            value = getattr(self, name)
            if value != getattr(ScenarioDistribution, name):
                raise InvalidValue(
                    f"{name} = {shown(value)}: {what} take one crane for all, and what is told is true: must be "
                    f"{getattr(ScenarioDistribution, name)}"
                )

    def draw(self, rng: np.random.Generator) -> Scenario:
        """Draw one scenario."""
        return self.at(rng.random(NUMBERS))

    def at(self, uniforms: np.ndarray) -> Scenario:
        """Return the scenario that these numbers (NUMBERS,) in [0, 1) stand for: sea, load and rope."""
        return self._build(uniforms[:SUBSTREAM], uniforms[SUBSTREAM : 2 * SUBSTREAM], uniforms[2 * SUBSTREAM :])

    def nominal(self) -> Scenario:
        """Return the scenario in the middle of every interval, with the first realisation of its sea."""
        half = np.full(SUBSTREAM, 0.5)
        sea = half.copy()
        sea[4] = 0.0
        return self._build(sea, half, half)

    def _build(self, u_sea: np.ndarray, u_load: np.ndarray, u_rope: np.ndarray) -> Scenario:
        m, r = u_load.tolist(), u_rope.tolist()
        load_mass, rope_length = within(self.load_mass, m[0]), within(self.rope_length, r[0])
        ratio = within(self.rope_damping_ratio, r[1])
        weight = load_mass * GRAVITY
        crane = self._crane(u_rope)
        stiffness = crane.rope.axial_stiffness / crane.free_length(rope_length, weight)
        factors = within(self.added_mass_factor, m[1]), within(self.drag_factor, m[2])
        scenario = Scenario(
            crane=crane,
            motion=self._window(u_sea) if self.records else self._sea_motion(u_sea),
            load_mass=load_mass,
            target_level=crane.pulley_position[2] - rope_length,
            rope_damping=ratio * critical_damping(stiffness, load_mass) if self._is_light else 0.0,
            ramp=self.ramp,
            target_path=self.target_path,
            water=self._water(u_sea),
            load=self._shape(load_mass, *factors),
            sensor_delay=None if self.sensor_delay is None else within(self.sensor_delay, float(u_sea[7])),
            told=self._told(m, r, load_mass, crane, factors),
        )
        if self._is_light:
            return scenario
        damping = ratio * critical_damping(scenario.rope_stiffness, scenario.moved_mass)
        return replace(scenario, rope_damping=damping) if damping else scenario

    def _crane(self, u_rope: np.ndarray) -> Crane:
        """The crane with the rope and winch that are drawn."""
        drawn: dict[str, Any] = {
            name: within(value, float(u_rope[place]))
            for name, place in (("axial_stiffness", 2), ("max_rope_speed", 4), ("max_rope_acceleration", 5), ("lag", 6))
            if (value := getattr(self, name)) is not None
        }
        if not drawn:
            return self.crane
        stiffness = drawn.pop("axial_stiffness", self.crane.rope.axial_stiffness)
        rope = replace(self.crane.rope, axial_stiffness=stiffness)
        return replace(self.crane, rope=rope, winch=replace(self.crane.winch, **drawn))

    def _told(
        self, m: list[float], r: list[float], load_mass: float, crane: Crane, factors: tuple[float, float]
    ) -> Told | None:
        """What the operator is told of a load and a crane that are drawn."""
        told: dict[str, Any] = {}
        if self.told_mass_error:
            told["load_mass"] = load_mass * factor(self.told_mass_error, m[3])
        if self.told_stiffness_error:
            told["axial_stiffness"] = crane.rope.axial_stiffness * factor(self.told_stiffness_error, r[3])
        if self.told_added_mass_error or self.told_drag_error:
            added = factors[0] * factor(self.told_added_mass_error, m[4])
            told["load"] = self._shape(load_mass, added, factors[1] * factor(self.told_drag_error, m[5]))
        if self.sensor_delay is not None:
            told["sensor_delay"] = self.sensors.delay
        return replace(self.told or Told(), **told) if told else self.told

    def _shape(self, load_mass: float, added_mass_factor: float, drag_factor: float) -> LoadShape:
        """Shape of a load of this mass."""
        if self.load == LoadShape():
            return self.load
        size = load_mass / within(self.load_mass, 0.5)
        added, area = size * added_mass_factor, size ** (2.0 / 3.0) * drag_factor
        return LoadShape(
            volume=size * self.load.volume,
            added_mass_vertical=added * self.load.added_mass_vertical,
            added_mass_horizontal=added * self.load.added_mass_horizontal,
            drag_area_vertical=area * self.load.drag_area_vertical,
            drag_area_horizontal=area * self.load.drag_area_horizontal,
            height=size ** (1.0 / 3.0) * self.load.height,
            slam_area=size ** (2.0 / 3.0) * self.load.slam_area,
            exit_area=size ** (2.0 / 3.0) * self.load.exit_area,
        )

    def _water(self, u_sea: np.ndarray) -> Water | None:
        """The water with the current that is drawn."""
        if self.water is None or not self.water.current:
            return self.water
        factor, turn = within(self.current_factor, float(u_sea[5])), within(self.current_turn, float(u_sea[6]))
        if factor == 1.0 and turn == 0.0:
            return self.water
        c, s = factor * math.cos(turn), factor * math.sin(turn)
        current = tuple((depth, c * x - s * y, s * x + c * y) for depth, x, y in self.water.current)
        return replace(self.water, current=current)

    def _window(self, u_sea: np.ndarray) -> RecordedWindow:
        """Draw a stretch of a record: every start in every record is as likely as any other."""
        room = np.array([record.duration - self.window for record in self.records])
        shares = np.cumsum(room + 1e-9) / np.sum(room + 1e-9)
        index = min(int(np.searchsorted(shares, u_sea[0], side="right")), len(room) - 1)
        start = float(room[index] * u_sea[1])
        return RecordedWindow(record=self.records[index], start=start, duration=self.window)

    def _sea_motion(self, u_sea: np.ndarray) -> SeaMotion:
        s = u_sea.tolist()
        hs, tp = within(self.hs, s[0]), within(self.tp, s[1])
        gamma = dnv_gamma(hs, tp) if self.gamma == "dnv" else within(self.gamma, s[3])
        sea = Sea(
            hs=hs,
            tp=tp,
            heading=within(self.heading, s[2]),
            spectrum=self.spectrum,
            gamma=gamma,
            spreading=self.spreading,
            components=self.components,
            seed=int(s[4] * 2**53),
        )
        return SeaMotion(sea=sea, vessel=self.vessel)


ScenarioSource = Scenario | ScenarioDistribution
"""One fixed scenario, or the distribution to draw from: an environment takes either."""
