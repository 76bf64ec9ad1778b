"""The distribution that scenarios are drawn from."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np

from aframe_env.dynamics.start import critical_damping
from aframe_env.scenario.crane import GRAVITY, Crane
from aframe_env.scenario.recorded_motion import RecordedMotion, RecordedWindow
from aframe_env.scenario.scenario import LEAST_MASS, LEAST_RAMP, Scenario
from aframe_env.scenario.sea import FULL_TURN, Sea, SeaMotion, dnv_gamma
from aframe_env.scenario.sensors import Sensors
from aframe_env.scenario.vessel import Vessel
from aframe_env.validation import InvalidValue, require_instance, require_integer, require_number, shown

Range = float | tuple[float, float]
"""One exact value, or the interval that a value is drawn from uniformly."""

SUBSTREAM: Final = 8
"""Numbers that sea, load and rope each take from the generator, however many they need."""
NUMBERS: Final = 3 * SUBSTREAM
"""Random numbers that a scenario is drawn with."""


def _require_range(name: str, value: Any, unit: str, low: float, high: float, low_open: bool = False) -> None:
    if isinstance(value, tuple):
        if len(value) != 2:
            raise InvalidValue(f"{name} = {shown(value)}: must be a number or a tuple (low, high) in {unit}")
        for part, item in zip(("low", "high"), value, strict=True):
            require_number(f"{name} ({part})", item, unit, low=low, high=high, low_open=low_open)
        if value[0] > value[1]:
            raise InvalidValue(f"{name} = {shown(value)} {unit}: the low end is above the high end")
    elif isinstance(value, list):
        raise InvalidValue(f"{name} = {shown(value)}: must be a number or a tuple (low, high) in {unit}")
    else:
        require_number(name, value, unit, low=low, high=high, low_open=low_open)


def _draw(value: Range, uniform: float) -> float:
    return value[0] + (value[1] - value[0]) * uniform if isinstance(value, tuple) else value


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

    def __post_init__(self) -> None:
        _require_range("hs", self.hs, "m", 0.0, 30.0)
        _require_range("tp", self.tp, "s", 2.0, 40.0)
        _require_range("heading", self.heading, "rad", -FULL_TURN, FULL_TURN)
        if not isinstance(self.gamma, str):
            _require_range("gamma", self.gamma, "", 1.0, 10.0)
        elif self.gamma != "dnv":
            raise InvalidValue(f"gamma = {shown(self.gamma)}: must be 'dnv', a number or a tuple in [1, 10]")
        require_number("ramp", self.ramp, "s", low=LEAST_RAMP, high=1e4, or_zero=True)
        _require_range("load_mass", self.load_mass, "kg", LEAST_MASS, 1e7)
        _require_range("rope_length", self.rope_length, "m", 0.0, 1e5, low_open=True)
        _require_range("rope_damping_ratio", self.rope_damping_ratio, "of critical", 0.0, 1.0)
        require_integer("components", self.components, low=1, high=4096)
        require_instance("crane", self.crane, Crane)
        require_instance("sensors", self.sensors, Sensors)
        require_number("window", self.window, "s", low=0.0, high=1e6, low_open=True)
        self._require_records()
        self._require_rope()
        # The corners of the distribution must be scenarios: refuse now rather than in the middle of a run.
        for load, rope in itertools.product((0.0, 1.0), repeat=2):
            self._build(np.full(SUBSTREAM, load), np.full(SUBSTREAM, load), np.full(SUBSTREAM, rope))

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
                paid_out = self.crane.free_length(length, mass * GRAVITY)
                if not least < paid_out < most:
                    raise InvalidValue(
                        f"rope_length = {self.rope_length!r} m: {length:g} m needs {paid_out:g} m of unstretched rope "
                        f"between drum and load: must be in ({least:g}, {most:g}) m, the winch's limits"
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
        load_mass, rope_length = _draw(self.load_mass, m[0]), _draw(self.rope_length, r[0])
        weight = load_mass * GRAVITY
        stiffness = self.crane.rope.axial_stiffness / self.crane.free_length(rope_length, weight)
        return Scenario(
            crane=self.crane,
            motion=self._window(u_sea) if self.records else self._sea_motion(u_sea),
            load_mass=load_mass,
            target_level=self.crane.pulley_position[2] - rope_length,
            rope_damping=_draw(self.rope_damping_ratio, r[1]) * critical_damping(stiffness, load_mass),
            ramp=self.ramp,
        )

    def _window(self, u_sea: np.ndarray) -> RecordedWindow:
        """Draw a stretch of a record: every start in every record is as likely as any other."""
        room = np.array([record.duration - self.window for record in self.records])
        shares = np.cumsum(room + 1e-9) / np.sum(room + 1e-9)
        index = min(int(np.searchsorted(shares, u_sea[0], side="right")), len(room) - 1)
        start = float(room[index] * u_sea[1])
        return RecordedWindow(record=self.records[index], start=start, duration=self.window)

    def _sea_motion(self, u_sea: np.ndarray) -> SeaMotion:
        s = u_sea.tolist()
        hs, tp = _draw(self.hs, s[0]), _draw(self.tp, s[1])
        gamma = dnv_gamma(hs, tp) if self.gamma == "dnv" else _draw(self.gamma, s[3])
        sea = Sea(
            hs=hs,
            tp=tp,
            heading=_draw(self.heading, s[2]),
            spectrum=self.spectrum,
            gamma=gamma,
            spreading=self.spreading,
            components=self.components,
            seed=int(s[4] * 2**53),
        )
        return SeaMotion(sea=sea, vessel=self.vessel)


ScenarioSource = Scenario | ScenarioDistribution
"""One fixed scenario, or the distribution to draw from: an environment takes either."""
