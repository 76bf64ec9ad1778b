"""Lowering, hoisting and luffing: a wrapper by which policies that hold a load follow a target or a frame that moves.

The way of the target is known on board, that of the pulley on the deck too, and so is the rope that holds the load
there. The drum pays that rope out, and the policy sees, and commands, what deviates from it: to the policy the load
hangs at a level that holds, under a pulley that the sea alone moves, on a rope that slowly becomes another one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple, Protocol, runtime_checkable

import numpy as np

from aframe_env.dynamics.start import heavy_lengths
from aframe_env.scenario import Crane, Scenario
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from aframe_env.validation import InvalidValue
from agents.control.lift import LEAST_WEIGHT
from agents.control.regulator import Observation
from agents.control.winch import WinchModel
from agents.policy import FloatArray, Knowledge, Policy

RETUNE_AT: Final = 0.05
"""Change of a rope's length, as a share of it, or of the share of the load under water, after which a policy is tuned
anew."""
BLIND: Final = (Knowledge.NOTHING, Knowledge.CLOCK)
"""What policies know that look at no readings, and so may be put beside any."""


@runtime_checkable
class Retunable(Protocol):
    """A policy that can go on with a rope of another length, and a load that gets wet, without forgetting the waves."""

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Reckon with ropes of ``rope_length`` (N,) m that bear ``growth`` (N,) N more than at the start, and with
        loads of which shares ``wet`` (N,) are under water."""
        ...


class Planned(NamedTuple):
    """Rope that holds a load on its way."""

    length: float
    """Unstretched, between drum and load, m."""
    tension: float
    """At the pulley, N."""
    rate: float
    """Velocity of the load, m/s."""
    wet: float
    """Share of the load that is under water, waves apart."""
    heave: float
    """Height of the pulley above its place at the start, the ship at rest, m."""
    heave_rate: float
    """m/s."""
    heave_acceleration: float
    """m/s²."""


@dataclass(frozen=True)
class PayOut:
    """Plan of one row: the load at rest in still water, or lowered so evenly that only drag holds it up."""

    scenario: Scenario
    """Only what a ``Lift`` has is looked at, and the ways of target and frame."""
    weight: float
    """Of the load where it hangs at the start, N, less what water it is in there carries."""

    @classmethod
    def weighed(cls, scenario: Scenario, tension: float) -> PayOut:
        """Plan for the load that hangs still at ``target_level`` while the pulley bears a ``tension`` [N]."""
        rope_weight, weight = scenario.rope_weight, tension
        for _ in range(4):  # each time the strain, some 1e-3, takes what is wrong
            weight = max(
                tension - rope_weight * cls(scenario, weight)._lengths(scenario.target_level, 0.0, scenario.crane)[0],
                LEAST_WEIGHT,
            )
        return cls(scenario, weight)

    def at(self, time: float) -> Planned:
        """Plan ``time`` s after the start."""
        path = self.scenario.target_path
        change, rate = (0.0, 0.0) if path is None else path.at(time)
        crane, heave = self.scenario.crane, (0.0, 0.0, 0.0)
        if self.scenario.luffing is not None:
            swing = self.scenario.luffing.at(crane.frame, time)
            start = crane.pulley_position[2]
            crane = replace(crane, frame=replace(crane.frame, luffing_angle=float(swing.angle[0])))
            heave = (
                float(swing.pulley[0, 2]) - start,
                float(swing.pulley_velocity[0, 2]),
                float(swing.pulley_acceleration[0, 2]),
            )
        level = self.scenario.target_level + change
        below, drum_part = self._lengths(level, rate, crane)
        weight, rope_weight = self._pull(level, rate)
        return Planned(below + drum_part, weight + rope_weight * below, rate, self.wet(level), *heave)

    def wet(self, level: float) -> float:
        """Share of the load that is under still water at a level [m]."""
        water = self.scenario.water
        return 1.0 if water is None else self.scenario.load.share_under_water(water.surface_level - level)

    @property
    def buoyancy(self) -> float:
        """What the water carries of the load when all of it is wet, N."""
        return self.scenario.density * self.scenario.load.volume * self.scenario.gravity

    def weight_at(self, level: float) -> float:
        """Weight of the load at a level [m], N, less what the water carries there."""
        return self.weight + (self.wet(self.scenario.target_level) - self.wet(level)) * self.buoyancy

    def _lengths(self, level: float, rate: float, crane: Crane) -> tuple[float, float]:
        weight, rope_weight = self._pull(level, rate)
        length = crane.pulley_position[2] - level
        return heavy_lengths(length, crane.drum_to_pulley, weight, crane.rope.axial_stiffness, rope_weight)

    def _pull(self, level: float, rate: float) -> tuple[float, float]:
        """Weight of the load [N] at a level [m] and of a metre of rope [N/m], with their drag at a ``rate`` [m/s]."""
        scenario, rope = self.scenario, self.scenario.crane.rope
        pressure = 0.5 * scenario.density * abs(rate) * rate
        along = pressure * rope.tangential_drag * math.pi * rope.solid_diameter if rope.mass_per_length else 0.0
        load = self.weight_at(level) + pressure * self.wet(level) * scenario.load.drag_area_vertical
        return max(load, LEAST_WEIGHT), scenario.rope_weight + along


@dataclass
class Following:
    """Let ``policy`` follow the ``target_path`` and the ``luffing`` of its scenarios.

    A policy that knows the future knows where the pulley will be, and is left to meet that by itself.
    """

    policy: Policy
    sensors: Sensors | None = None
    """Sensors that it acts on, for their delay, or that are put before a blind one; None for the full state."""
    name: str = field(init=False)
    knows: Knowledge = field(init=False)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _plans: list[PayOut] = field(init=False, repr=False, default_factory=list)
    _first: tuple[FloatArray, FloatArray, FloatArray] = field(init=False, repr=False)
    """(N,) m, N and shares under water, of the plans at the start."""
    _tuned: tuple[FloatArray, FloatArray] = field(init=False, repr=False)
    """(N,) m, and shares under water, that the policy is tuned to."""
    _paid_out: FloatArray = field(init=False, repr=False)
    """(N,) m since the start, by the encoder."""
    _angle: FloatArray = field(init=False, repr=False)
    """(N,) rad that it read last."""
    _radius: FloatArray = field(init=False, repr=False)
    """(N,) m, of the drums that the policy knows."""
    _drums: WinchModel = field(init=False, repr=False)
    _deviating: WinchModel = field(init=False, repr=False)
    """Drums that turn as the policy commands."""

    def __post_init__(self) -> None:
        self.name, self.knows = f"{self.policy.name}, following", self.policy.knows
        if self.knows not in BLIND and (self.knows is Knowledge.SENSORS) != (self.sensors is not None):
            raise InvalidValue(
                f"sensors = {'None' if self.sensors is None else 'given'}: {self.policy.name} knows "
                f"{self.knows.value}: must be given to a policy on sensors, and to no other"
            )

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only what a ``Lift`` has and the ways of target and frame count."""
        at_rest = [replace(scenario, luffing=None) if scenario.luffing else scenario for scenario in scenarios]
        knows_pulley = self.policy.knows is Knowledge.FUTURE
        self._scenarios, self._period, self._plans = at_rest if knows_pulley else scenarios, control_period, []
        self.policy.reset(scenarios if knows_pulley else at_rest, control_period)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, K)."""
        o = observation.astype(np.float64)
        columns = {q.name: i for i, q in enumerate(STATE if self.sensors is None else SENSED)}
        if not self._plans:
            self._start(o, columns)
        then = time - (0.0 if self.sensors is None else self.sensors.delay)
        length, tension, rate, _, *heaves = self._planned(then)
        for name, heave in zip(("pulley_heave", "pulley_velocity_z", "pulley_acceleration_z"), heaves, strict=True):
            if name in columns:
                o[:, columns[name]] -= heave
        (now, _, _, wet, *_), later = self._planned(time), self._planned(time + self._period)[0]
        angle = o[:, columns["drum_angle"]].copy()
        self._paid_out += self._drum_radius() * (angle - self._angle)
        self._angle, actual = angle, self._drum_radius()
        o[:, columns["drum_angle"]] = (self._paid_out - (length - self._first[0])) / self._radius
        o[:, columns["rope_tension"]] -= tension - self._first[1]
        if self.sensors is None:
            o[:, columns["load_velocity_z"]] -= rate
            # On another radius a drum that turns as far in a step ends it at another speed: the policy is told that of
            # its own, and by how much the real one missed what was reckoned.
            real = o[:, columns["drum_speed"]].copy()
            self._deviating.speed += (real - self._drums.speed) * actual / self._radius
            self._drums.speed = real
            o[:, columns["drum_speed"]] = self._deviating.speed
        else:
            o[:, columns["rope_length"]] = length
            speed = (self._planned(then + 0.05)[0] - self._planned(then - 0.05)[0]) / 0.1
            o[:, columns["drum_speed"]] = (o[:, columns["drum_speed"]] * actual - speed) / self._radius
        changed = np.maximum(abs(now / self._tuned[0] - 1.0), abs(wet - self._tuned[1]))
        if np.any(changed > RETUNE_AT) and isinstance(self.policy, Retunable):
            rope_weight = np.array([scenario.rope_weight for scenario in self._scenarios])
            lighter = np.array([plan.buoyancy for plan in self._plans]) * (wet - self._first[2])
            self.policy.retune(now, rope_weight * (now - self._first[0]) - lighter, wet)
            self._tuned = now, wet
        turn = self._deviating.turn(self.policy.act(o.astype(np.float32), time))
        command, _ = self._drums.command((self._radius * turn + later - now) / actual)
        return command

    def _start(self, o: FloatArray, columns: dict[str, int]) -> None:
        tension = o[:, columns["rope_tension"]].tolist()
        self._plans = [PayOut.weighed(s, each) for s, each in zip(self._scenarios, tension, strict=True)]
        length, tensions, _, wet, *_ = self._planned(0.0)
        self._first, self._tuned = (length, tensions, wet), (length, wet)
        self._paid_out, self._angle = np.zeros(len(o)), o[:, columns["drum_angle"]].copy()
        cranes = [scenario.crane for scenario in self._scenarios]
        self._drums, self._deviating = WinchModel(len(o), self._period), WinchModel(len(o), self._period)
        self._drums.start(cranes)
        self._deviating.start(cranes)
        self._radius = self._drum_radius()

    def _drum_radius(self) -> FloatArray:
        """Radius (N,) m at which the ropes run off the drums."""
        length = self._first[0] + self._paid_out
        return np.array([s.crane.drum_radius(x) for s, x in zip(self._scenarios, length.tolist(), strict=True)])

    def _planned(self, time: float) -> FloatArray:
        """What a ``Planned`` holds by the plans of all rows: (7, N)."""
        return np.array([plan.at(max(time, 0.0)) for plan in self._plans]).T
