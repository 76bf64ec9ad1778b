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

from aframe_env.scenario import Crane, Scenario, TargetPath
from aframe_env.task import SENSED, STATE
from aframe_env.validation import InvalidValue
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


@dataclass
class SettingDown:
    """Let a policy that follows its targets leave those loads on the ground that land on it."""

    policy: Following
    name: str = field(init=False)
    knows: Knowledge = field(init=False)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _told: Sequence[Scenario] = field(init=False, repr=False, default=())
    """The same as the policy is told them: other ones where the load lands."""
    _most: FloatArray = field(init=False, repr=False)
    """(N,) greatest speeds of the drums, rad/s."""
    _period: float = field(init=False, repr=False, default=0.1)
    _least: FloatArray = field(init=False, repr=False)
    """(N,) tension at the pulley below which a load has landed, N; -inf where none does."""
    _from: FloatArray = field(init=False, repr=False)
    """(N,) time of arrival, before which a slack rope is no sign of it, s."""
    _slack: FloatArray = field(init=False, repr=False)
    """(N,) rad to be paid out then."""
    _left: FloatArray = field(init=False, repr=False)
    """(N,) rad still to be paid out; NaN before the load has landed."""

    def __post_init__(self) -> None:
        self.name, self.knows = f"{self.policy.name}, setting down", self.policy.knows
        if self.knows in BLIND:
            raise InvalidValue(
                f"policy = {self.policy.name!r}: knows {self.knows.value}: must have readings, which tell that a load "
                "has landed"
            )

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only what a ``Lift`` has, target and seabed count."""
        self._scenarios, self._period = scenarios, control_period
        self._told = [into_the_ground(s, 2.0 * SLACK + STRETCH * s.rope_length) if lands(s) else s for s in scenarios]
        self._most = np.array([scenario.crane.winch.max_speed for scenario in scenarios])
        self._least = np.zeros(0)
        self.policy.reset(self._told, control_period)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, K)."""
        sensors = self.policy.sensors
        columns = [q.name for q in (STATE if sensors is None else SENSED)]
        tension = observation[:, columns.index("rope_tension")].astype(np.float64)
        if not len(self._least):
            self._start(tension)
        landed = np.isnan(self._left) & (tension < self._least) & (time >= self._from)
        self._left[landed] = self._slack[landed]
        then = time - (0.0 if sensors is None else sensors.delay)
        seen = observation.copy()
        seen[:, columns.index("depth_error")] += self._above(then)
        command = self.policy.act(seen, time)
        leaving = np.minimum(self._most, self._left / self._period)
        self._left -= self._period * leaving
        return np.asarray(np.where(np.isnan(leaving), command, leaving))

    def _above(self, time: float) -> FloatArray:
        """(N,) m that the targets are above those that the policy is told."""
        true, told = (
            np.array([0.0 if s.target_path is None else s.target_path.at(time)[0] for s in scenarios])
            for scenarios in (self._scenarios, self._told)
        )
        return np.asarray(true - told)

    def _start(self, tension: FloatArray) -> None:
        plans = [PayOut.weighed(s, each) for s, each in zip(self._scenarios, tension.tolist(), strict=True)]
        ends = [plan.at(plan.scenario.target_path.duration if plan.scenario.target_path else 0.0) for plan in plans]
        changes = [s.target_path.corners[-1][1] if s.target_path else 0.0 for s in self._scenarios]
        weights = np.array([p.weight_at(p.scenario.target_level + x) for p, x in zip(plans, changes, strict=True)])
        down = np.array([told is not true for told, true in zip(self._told, self._scenarios, strict=True)])
        self._from = np.array([way_down(s.target_path)[-1][0] if s.target_path else 0.0 for s in self._scenarios])
        self._least = np.where(down, np.array([end.tension for end in ends]) - BORNE * weights, -np.inf)
        stiffness = np.array([scenario.crane.rope.axial_stiffness for scenario in self._scenarios])
        stretch = weights * np.array([end.length for end in ends]) / stiffness
        ways = [[_to_level_zero(crane) for crane in scenario.cranes] for scenario in self._scenarios]
        rise = np.array([max(way) - min(way) for way in ways])
        radius = [s.crane.drum_radius(end.length) for s, end in zip(self._scenarios, ends, strict=True)]
        self._slack = (stretch + SLACK + rise) / np.array(radius)
        self._left = np.full(len(tension), np.nan)
