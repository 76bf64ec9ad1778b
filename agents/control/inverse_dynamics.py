"""Inverse dynamics: the drum's motion that holds the load at rest, from the ship's exact motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.scenario import Scenario
from aframe_env.task import STATE
from agents.control.regulator import Gains, HoistBatch, Observation, Regulator
from agents.policy import FloatArray, Knowledge

GAINS = Gains(effort=0.095, share=0.012)
"""Tuned with ``python -m train.tune_control``."""


class RequiredRope:
    """Length of rope that holds the load at its level, every half control step.

    The pulley's path is the simulation's own. A load held at its level swings below the pulley S as a pendulum whose
    rope bears its weight: x'' = g (S_x - x) / (S_z - h), y likewise. The rope bears m g / cos θ, and is as much
    longer than its unstretched length as that stretches it.

    A heavy rope at rest in space stays at rest while what is paid out, longer by the strain at the pulley, makes up for
    the pulley's way: nothing in it moves. Its load swings as with the drum still: added mass, drag, current and the
    rope's weight are the simulation's own.
    """

    def __init__(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        self._half = 0.5 * control_period
        held = [_held(scenario) for scenario in scenarios]
        self._heavy = np.array([not s.is_light for s in held])
        # Of light ropes only the pulley is looked at: their loads may bob as they like.
        self._engine = Engine(len(scenarios), self._half, max_inner_step=None if self._heavy.any() else 0.2)
        for i, scenario in enumerate(held):
            self._engine.reset_row(i, scenario)
        self._still = np.zeros(len(scenarios))
        self._level = np.array([s.target_level for s in scenarios])
        self._weight = np.array([s.weight for s in scenarios])
        self._gravity = np.array([s.gravity for s in scenarios])
        self._axial_stiffness = np.array([s.crane.rope.axial_stiffness for s in scenarios])
        self._reach = self._engine.read(at.REACH)
        self._free_length = np.array([s.free_length for s in scenarios])
        self._rope_length = np.array([s.rope_length for s in scenarios])
        self._stretch = np.array([s.rope_length - s.lengths[0] for s in scenarios])
        self._strain = np.array([s.pulley_strain for s in scenarios])
        self._place = self._engine.read_many(at.LOAD_POSITION, 2)
        self._velocity = self._engine.read_many(at.LOAD_VELOCITY, 2)

    def now(self) -> FloatArray:
        """Rope to be paid out since the start, (N,) m."""
        pulley = self._engine.read_many(at.PULLEY, 3)
        height = pulley[:, 2] - self._level
        length = np.sqrt(((pulley[:, :2] - self._place) ** 2).sum(axis=1) + height**2)
        stretched = 1.0 + self._weight * length / height / self._axial_stiffness
        reach = self._engine.read(at.REACH)
        light = (length + reach) / stretched - self._free_length
        # Aslant the rope bears more, and is stretched by as much more.
        further = length - self._rope_length + reach - self._reach - self._stretch * (length / height - 1.0)
        return np.asarray(np.where(self._heavy, further / (1.0 + self._strain), light))

    def advance(self) -> None:
        """Go on by half a control step."""
        # The pulley's place enters twice: a step of the Störmer-Verlet method.
        self._velocity += 0.5 * self._half * self._pull()
        self._place += self._half * self._velocity
        self._engine.step(self._still)
        self._velocity += 0.5 * self._half * self._pull()
        self._place[self._heavy] = self._engine.read_many(at.LOAD_POSITION, 2)[self._heavy]

    def _pull(self) -> FloatArray:
        pulley = self._engine.read_many(at.PULLEY, 3)
        rate = self._gravity / (pulley[:, 2] - self._level)
        return np.asarray(rate[:, None] * (pulley[:, :2] - self._place))


def _held(scenario: Scenario) -> Scenario:
    """The scenario with a drum that stands still, and a heavy rope that does not part, however its load may bob."""
    if scenario.crane.winch.drive is not None:
        scenario = replace(scenario, crane=replace(scenario.crane, winch=replace(scenario.crane.winch, drive=None)))
    if scenario.is_light:
        return scenario
    rope = replace(scenario.crane.rope, breaking_load=1e12)
    return replace(scenario, crane=replace(scenario.crane, rope=rope))


@dataclass
class InverseDynamics:
    """Pay out the rope that holds the load at its level, its tension at the weight: the whole future is known.

    Errors remain only where the winch's limits cause them; the regulator damps these.
    """

    gains: Gains = GAINS
    name: str = "inverse dynamics"
    knows: Knowledge = field(init=False, default=Knowledge.FUTURE)
    _hoists: HoistBatch | None = field(init=False, repr=False, default=None)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _regulator: Regulator = field(init=False, repr=False)
    _rope: RequiredRope = field(init=False, repr=False)
    _required: FloatArray = field(init=False, repr=False)
    """(3, N) rope to be paid out half a control step ago, now, and in half a control step, m."""
    _lengthened: FloatArray = field(init=False, repr=False)
    """(N,) length below the pulley of a metre that the drum pays out, 1 for light ropes, which say it in ``_rope``."""

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes."""
        self._scenarios, self._period, self._hoists = scenarios, control_period, None
        self._rope = RequiredRope(scenarios, control_period)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, 14) of the full state."""
        if self._hoists is None:
            self._hoists = HoistBatch(len(observation), self._period, STATE)
            self._hoists.start(self._scenarios, observation)
            radius = np.array([s.crane.drum_radius(s.free_length) for s in self._scenarios])
            self._lengthened = self._hoists.winch.radius / radius
            self._regulator = self._hoists.regulator(self.gains)
            now = self._wanted()
            self._rope.advance()
            later = self._wanted()
            self._required = np.stack([2.0 * now - later, now, later])
        hoists, winch, period = self._hoists, self._hoists.winch, self._period
        o = hoists.columns(observation)
        winch.speed = o["drum_speed"]
        before, now, later = self._required
        rope_end = now - winch.radius * o["drum_angle"]
        rope_end_speed = (later - before) / period - winch.radius * o["drum_speed"]
        z = np.stack([o["depth_error"], o["load_velocity_z"], rope_end, rope_end_speed], axis=1)
        self._rope.advance()
        end = self._wanted()
        command, _ = winch.command((end - now - period * self._regulator.speed(z)) / winch.radius)
        self._rope.advance()
        self._required = np.stack([later, end, self._wanted()])
        return command

    def _wanted(self) -> FloatArray:
        """Rope to be paid out since the start, as long as it is below the pulley, (N,) m."""
        return self._lengthened * self._rope.now()
