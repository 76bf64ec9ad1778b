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
from agents.control.filters import ALL, Rows
from agents.control.lift import LEAST_WEIGHT, share_under_water
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
        loads of which shares ``wet`` (N,) are under water; where the length is NaN, as before."""
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


def moves(scenario: Scenario) -> bool:
    """Whether target or frame move."""
    return scenario.target_path is not None or scenario.luffing is not None


def at_rest(scenario: Scenario) -> Scenario:
    """The scenario as a policy is told it that does not know the frame to move."""
    return replace(scenario, luffing=None) if scenario.luffing else scenario


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
        return share_under_water(self.scenario, level)

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


class Ways:
    """Ways of N loads that run in step: observations and drum commands, as they are and as deviations from the ways."""

    def __init__(self, rows: int, control_period: float, sensors: Sensors | None) -> None:
        """``sensors`` that make the observations, for their delay; None for the full state."""
        self._period, self._sensors = control_period, sensors
        self._columns = {q.name: i for i, q in enumerate(STATE if sensors is None else SENSED)}
        self._scenarios = np.empty(rows, dtype=object)
        self._weight = np.zeros(rows)
        """(N,) N, as ``PayOut`` has it."""
        self._first = np.zeros((2, rows))
        """Length [m] and tension [N] of the plans at the start."""
        self._buoyancy, self._first_wet = np.zeros((2, rows))
        """(N,) N, as ``PayOut`` has it, and share of the loads that was under water at the start."""
        self._tuned = np.zeros((2, rows))
        """Length [m], and share of the load under water, that the policy is tuned to."""
        self._paid_out, self._angle = np.zeros((2, rows))
        """(N,) m since the start, by the encoder, and rad that it read last."""
        self._radius, self._actual = np.zeros((2, rows))
        """(N,) m, of the drums that the policy knows, and as they are now."""
        self._now, self._wet, self._later = np.zeros((3, rows))
        """(N,) m and shares under water of the plans now, and m after a control step."""
        self._drums, self._deviating = WinchModel(rows, control_period), WinchModel(rows, control_period)
        """``_deviating``: drums that turn as the policy commands."""

    def start(self, scenarios: Sequence[Scenario], observation: Observation, rows: Rows = ALL) -> Observation:
        """Begin ways in these rows; return what the policy sees of the first observations (n, K)."""
        tension = observation[:, self._columns["rope_tension"]].astype(np.float64).tolist()
        plans = [PayOut.weighed(s, each) for s, each in zip(scenarios, tension, strict=True)]
        self._scenarios[rows], self._weight[rows] = scenarios, [plan.weight for plan in plans]
        self._buoyancy[rows] = [plan.buoyancy for plan in plans]
        length, tensions, _, wet, *_ = self._planned(0.0, rows)
        self._first[:, rows], self._tuned[:, rows], self._first_wet[rows] = (length, tensions), (length, wet), wet
        self._paid_out[rows], self._angle[rows] = 0.0, observation[:, self._columns["drum_angle"]].astype(np.float64)
        for drums in (self._drums, self._deviating):
            drums.start([scenario.crane for scenario in scenarios], rows)
        self._radius[rows] = self._drum_radius(rows)
        return self.seen(observation, 0.0, rows)

    def seen(self, observation: Observation, time: FloatArray | float, rows: Rows = ALL) -> Observation:
        """What the policy sees of the observations (n, K) of these rows, ``time`` (n,) s after their starts."""
        o, columns = observation.astype(np.float64), self._columns
        then = time - (0.0 if self._sensors is None else self._sensors.delay)
        length, tension, rate, _, *heaves = self._planned(then, rows)
        for name, heave in zip(("pulley_heave", "pulley_velocity_z", "pulley_acceleration_z"), heaves, strict=True):
            if name in columns:
                o[:, columns[name]] -= heave
        self._now[rows], _, _, self._wet[rows], *_ = self._planned(time, rows)
        self._later[rows] = self._planned(time + self._period, rows)[0]
        angle, radius = o[:, columns["drum_angle"]].copy(), self._radius[rows]
        self._paid_out[rows] += self._drum_radius(rows) * (angle - self._angle[rows])
        self._angle[rows], self._actual[rows] = angle, self._drum_radius(rows)
        actual = self._actual[rows]
        o[:, columns["drum_angle"]] = (self._paid_out[rows] - (length - self._first[0, rows])) / radius
        o[:, columns["rope_tension"]] -= tension - self._first[1, rows]
        if self._sensors is None:
            o[:, columns["load_velocity_z"]] -= rate
            # On another radius a drum that turns as far in a step ends it at another speed: the policy is told that of
            # its own, and by how much the real one missed what was reckoned.
            real = o[:, columns["drum_speed"]].copy()
            self._deviating.speed[rows] += (real - self._drums.speed[rows]) * actual / radius
            self._drums.speed[rows] = real
            o[:, columns["drum_speed"]] = self._deviating.speed[rows]
        else:
            o[:, columns["rope_length"]] = length
            speed = (self._planned(then + 0.05, rows)[0] - self._planned(then - 0.05, rows)[0]) / 0.1
            o[:, columns["drum_speed"]] = (o[:, columns["drum_speed"]] * actual - speed) / radius
        return o.astype(np.float32)

    def retune(self, policy: Retunable) -> None:
        """Tune the policy to those ropes and loads that have become other ones as they are planned now.

        The others are left alone, to the last bit: a law that is hardly stable makes much of little, and no row is to
        depend on another.
        """
        changed = np.maximum(abs(self._now / self._tuned[0] - 1.0), abs(self._wet - self._tuned[1])) > RETUNE_AT
        if changed.any():
            self._tuned[:, changed] = self._now[changed], self._wet[changed]
            length, wet = np.where(changed, self._now, np.nan), self._wet
            rope_weight = np.array([scenario.rope_weight for scenario in self._scenarios])
            lighter = self._buoyancy * (wet - self._first_wet)
            policy.retune(length, rope_weight * (length - self._first[0]) - lighter, wet)

    def command(self, command: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for those of the policy, for what it saw last."""
        turn = self._deviating.turn(command)
        return self._drums.command((self._radius * turn + self._later - self._now) / self._actual)[0]

    def _drum_radius(self, rows: Rows) -> FloatArray:
        """Radius (n,) m at which the ropes run off the drums."""
        length = (self._first[0, rows] + self._paid_out[rows]).tolist()
        return np.array([s.crane.drum_radius(x) for s, x in zip(self._scenarios[rows], length, strict=True)])

    def _planned(self, time: FloatArray | float, rows: Rows) -> FloatArray:
        """What a ``Planned`` holds by the plans of these rows at ``time`` (n,) s after their starts: (7, n)."""
        scenarios, weights = self._scenarios[rows], self._weight[rows].tolist()
        times = np.maximum(np.broadcast_to(time, len(weights)), 0.0).tolist()
        return np.array([PayOut(s, w).at(t) for s, w, t in zip(scenarios, weights, times, strict=True)]).T


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
    _ways: Ways | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        self.name, self.knows = f"{self.policy.name}, following", self.policy.knows
        if self.knows not in BLIND and (self.knows is Knowledge.SENSORS) != (self.sensors is not None):
            raise InvalidValue(
                f"sensors = {'None' if self.sensors is None else 'given'}: {self.policy.name} knows "
                f"{self.knows.value}: must be given to a policy on sensors, and to no other"
            )

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only what a ``Lift`` has and the ways of target and frame count."""
        resting = list(map(at_rest, scenarios))
        knows_pulley = self.policy.knows is Knowledge.FUTURE
        self._scenarios, self._period, self._ways = resting if knows_pulley else scenarios, control_period, None
        self.policy.reset(scenarios if knows_pulley else resting, control_period)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, K)."""
        if self._ways is None:
            self._ways = Ways(len(observation), self._period, self.sensors)
            seen = self._ways.start(self._scenarios, observation)
        else:
            seen = self._ways.seen(observation, time)
        if isinstance(self.policy, Retunable):
            self._ways.retune(self.policy)
        return self._ways.command(self.policy.act(seen, time))
