"""Setting down: a wrapper by which policies that lower a load leave it on the seabed once it is there.

A load that is held at the level of the ground is lifted off it and dropped by every wave. So the target that the policy
is told goes on into the ground as fast as it came, until the ground bears half of the load; then the drum pays out as
fast as it can what the rope was stretched by, and what the pulley may rise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from aframe_env.scenario import Crane, Scenario, Sensors, TargetPath
from aframe_env.task import SENSED, STATE
from aframe_env.validation import InvalidValue
from agents.control.filters import ALL, Rows
from agents.control.lowering import BLIND, Following, PayOut
from agents.control.regulator import Observation
from agents.policy import FloatArray, Knowledge

BORNE: Final = 0.5
"""Share of the load's weight that the ground bears when the load counts as landed."""
SLACK: Final = 5.0
"""What is paid out beyond the rope's stretch under the load, and beyond what a frame that luffs may raise it by, m."""
INTO: Final = 1.0
"""How far above the ground a way may end that is a way onto it, m."""
SLOWEST: Final = 0.1
"""Least speed at which the target goes on into the ground, m/s: the last centimetres may come more slowly."""
STRETCH: Final = 0.1
"""Share of its length that half of the load stretches no rope by."""


def way_down(path: TargetPath) -> tuple[tuple[float, float], ...]:
    """Corners of a target's way up to the one at which it has come to rest."""
    corners = path.corners
    while len(corners) > 1 and corners[-1][1] == corners[-2][1]:
        corners = corners[:-1]
    return corners


def lands(scenario: Scenario) -> bool:
    """Whether the target's way ends on the seabed, coming down."""
    if scenario.target_path is None:
        return False
    corners = way_down(scenario.target_path)
    if len(corners) == 1 or corners[-1][1] > corners[-2][1]:
        return False
    end = scenario.target_level + corners[-1][1]
    return end - 0.5 * scenario.load.height < scenario.bed_level + INTO


def into_the_ground(scenario: Scenario, depth: float) -> Scenario:
    """The scenario with its target going on by ``depth`` m, as fast as it came, through a seabed that is not there.

    By a rope that does not part, and no further than it reaches.
    """
    path, water, crane = scenario.target_path, scenario.water, scenario.crane
    assert path is not None
    assert water is not None
    corners = way_down(path)
    (before, high), (time, low) = corners[-2:]
    reach = crane.winch.max_rope_length - max(_to_level_zero(each) for each in scenario.cranes)
    depth = min(depth, reach + scenario.target_level + low)
    if depth > 0.0:
        speed = (high - low) / (time - before)
        kept = corners[:-1] if speed >= SLOWEST else corners
        corners = (*kept, (time + depth / max(speed, SLOWEST), low - depth))
    return replace(
        scenario,
        crane=replace(crane, rope=replace(crane.rope, breaking_load=1e12)),
        water=replace(water, seabed=None),
        target_path=TargetPath(corners=corners, corner_time=path.corner_time),
    )


def _to_level_zero(crane: Crane) -> float:
    """Way of the rope from the drum over the pulley to a load at level 0, m."""
    return crane.drum_to_pulley + crane.pulley_position[2]


class SetDown:
    """The setting down of N loads that run in step: what those who follow their targets see, and what they command."""

    def __init__(self, rows: int, control_period: float, sensors: Sensors | None) -> None:
        """``sensors`` that make the observations, for their delay; None for the full state."""
        self._period, self._delay = control_period, 0.0 if sensors is None else sensors.delay
        columns = [q.name for q in (STATE if sensors is None else SENSED)]
        self._tension, self._depth_error = columns.index("rope_tension"), columns.index("depth_error")
        self._scenarios, self._told = np.empty((2, rows), dtype=object)
        """The loads' scenarios, and as those who follow them are told: other ones where the load lands."""
        self._most = np.zeros(rows)
        """(N,) greatest speeds of the drums, rad/s."""
        self._least = np.zeros(rows)
        """(N,) tension at the pulley below which a load has landed, N; -inf where none does."""
        self._from = np.zeros(rows)
        """(N,) time of arrival, before which a slack rope is no sign of it, s."""
        self._slack = np.zeros(rows)
        """(N,) rad to be paid out then."""
        self._left = np.full(rows, np.nan)
        """(N,) rad still to be paid out; NaN before the load has landed."""

    def start(self, scenarios: Sequence[Scenario], observation: Observation, rows: Rows = ALL) -> Observation:
        """Begin in these rows; return what is seen of the first observations (n, K)."""
        told = list(map(told_of, scenarios))
        tension = observation[:, self._tension].astype(np.float64).tolist()
        self._scenarios[rows], self._told[rows] = scenarios, told
        self._most[rows] = [scenario.crane.winch.max_speed for scenario in scenarios]
        plans = [PayOut.weighed(s, each) for s, each in zip(scenarios, tension, strict=True)]
        ends = [plan.at(plan.scenario.target_path.duration if plan.scenario.target_path else 0.0) for plan in plans]
        changes = [s.target_path.corners[-1][1] if s.target_path else 0.0 for s in scenarios]
        weights = np.array([p.weight_at(p.scenario.target_level + x) for p, x in zip(plans, changes, strict=True)])
        down = np.array([other is not true for other, true in zip(told, scenarios, strict=True)])
        self._from[rows] = [way_down(s.target_path)[-1][0] if s.target_path else 0.0 for s in scenarios]
        self._least[rows] = np.where(down, np.array([end.tension for end in ends]) - BORNE * weights, -np.inf)
        stiffness = np.array([scenario.crane.rope.axial_stiffness for scenario in scenarios])
        stretch = weights * np.array([end.length for end in ends]) / stiffness
        ways = [[_to_level_zero(crane) for crane in scenario.cranes] for scenario in scenarios]
        rise = np.array([max(way) - min(way) for way in ways])
        radius = [s.crane.drum_radius(end.length) for s, end in zip(scenarios, ends, strict=True)]
        self._slack[rows] = (stretch + SLACK + rise) / np.array(radius)
        self._left[rows] = np.nan
        return self.seen(observation, 0.0, rows)

    def seen(self, observation: Observation, time: FloatArray | float, rows: Rows = ALL) -> Observation:
        """What is seen of the observations (n, K) of these rows, ``time`` (n,) s after their starts."""
        left, tension = self._left[rows], observation[:, self._tension].astype(np.float64)
        landed = np.isnan(left) & (tension < self._least[rows]) & (time >= self._from[rows])
        self._left[rows] = np.where(landed, self._slack[rows], left)
        seen = observation.copy()
        seen[:, self._depth_error] += self._above(time - self._delay, rows)
        return seen

    def command(self, command: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for those of who follows the targets."""
        leaving = np.minimum(self._most, self._left / self._period)
        self._left = self._left - self._period * leaving
        return np.asarray(np.where(np.isnan(leaving), command, leaving))

    def _above(self, time: FloatArray | float, rows: Rows) -> FloatArray:
        """(n,) m that the targets are above those that are told."""
        true, told = self._scenarios[rows].tolist(), self._told[rows].tolist()
        times = np.broadcast_to(time, len(true)).tolist()
        return np.asarray(_targets(true, times) - _targets(told, times))


def told_of(scenario: Scenario) -> Scenario:
    """The scenario as who follows its target is told it: where the load lands, the target goes on into the ground."""
    if not lands(scenario):
        return scenario
    return into_the_ground(scenario, 2.0 * SLACK + STRETCH * scenario.rope_length)


def _targets(scenarios: Sequence[Scenario], times: Sequence[float]) -> FloatArray:
    """(n,) m that the targets are above where they were at the start."""
    paths = [scenario.target_path for scenario in scenarios]
    return np.array([0.0 if path is None else path.at(time)[0] for path, time in zip(paths, times, strict=True)])


@dataclass
class SettingDown:
    """Let a policy that follows its targets leave those loads on the ground that land on it."""

    policy: Following
    name: str = field(init=False)
    knows: Knowledge = field(init=False)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _rows: SetDown | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        self.name, self.knows = f"{self.policy.name}, setting down", self.policy.knows
        if self.knows in BLIND:
            raise InvalidValue(
                f"policy = {self.policy.name!r}: knows {self.knows.value}: must have readings, which tell that a load "
                "has landed"
            )

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only what a ``Lift`` has, target and seabed count."""
        self._scenarios, self._period, self._rows = scenarios, control_period, None
        self.policy.reset(list(map(told_of, scenarios)), control_period)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, K)."""
        if self._rows is None:
            self._rows = SetDown(len(observation), self._period, self.policy.sensors)
            seen = self._rows.start(self._scenarios, observation)
        else:
            seen = self._rows.seen(observation, time)
        return self._rows.command(self.policy.act(seen, time))
