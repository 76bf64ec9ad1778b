"""Model-predictive control: the regulator's problem over a horizon, with the winch's limits.

Minimise Σ e² + effort c² + zᵀ P z at the horizon's end, over the changes c of the rope end's speed, so that the drum's
speed and acceleration stay within the winch's limits while the pulley moves as predicted. Where the regulator itself
keeps the limits all along the horizon, its answer is the problem's; only the other rows need a quadratic program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from aframe_env.validation import require_integer, require_number
from agents.control.expected_waves import ExpectedWaves
from agents.control.interior_point import BoundedTracking
from agents.control.observer import Observer, observer_for
from agents.control.regulator import HoistBatch, Observation
from agents.control.rope import RopeModel
from agents.policy import FloatArray, Knowledge

STATE_EFFORT = 0.0094
"""Tuned with ``python -m train.tune_control``, s²."""
SENSOR_EFFORT = 0.017
"""Tuned with ``python -m train.tune_control``, s²."""


@dataclass
class PredictiveControl:
    """Model-predictive control; the agents' Kalman filters predict the motion."""

    sensors: Sensors | None = field(default_factory=Sensors)
    """Delay and noise that the law is designed for; None for the full state, which has neither."""
    effort: float | None = None
    """Weight on changes of the rope end's speed, s²; None for the one that was tuned."""
    horizon: int = 50
    """Control steps."""
    damping_ratio: float = 0.03
    """Damping of the load's bobbing on the rope that the law is designed for, share of critical."""
    waves: ExpectedWaves = field(default_factory=lambda: ExpectedWaves.of(ScenarioDistribution()))
    """Motion that it is designed for."""
    name: str = field(init=False)
    knows: Knowledge = field(init=False)
    _price: float = field(init=False, repr=False)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _hoists: HoistBatch | None = field(init=False, repr=False, default=None)
    _model: RopeModel = field(init=False, repr=False)
    _k: FloatArray = field(init=False, repr=False)
    _cost_to_go: FloatArray = field(init=False, repr=False)
    _observer: Observer = field(init=False, repr=False)
    _turned: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.knows = Knowledge.STATE if self.sensors is None else Knowledge.SENSORS
        self.name = "predictive control (state)" if self.sensors is None else "predictive control"
        self._price = self.effort or (STATE_EFFORT if self.sensors is None else SENSOR_EFFORT)
        require_number("effort", self._price, "s²", low=1e-8, high=1e8)
        require_integer("horizon", self.horizon, low=2, high=1000)
        require_number("damping_ratio", self.damping_ratio, "of critical", low=0.0, high=1.0)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the crane is looked at."""
        self._scenarios, self._period, self._hoists = scenarios, control_period, None

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for readings (N, 10), or observations (N, 14) of the full state."""
        if self._hoists is None:
            quantities = STATE if self.sensors is None else SENSED
            hoists = self._hoists = HoistBatch(len(observation), self._period, quantities)
            o = hoists.start([s.crane for s in self._scenarios], observation)
            self._observer = observer_for(hoists, self.damping_ratio, self.sensors, self.waves)
            self._observer.start(o)
            self._model = self._observer.model
            self._k = self._model.gains(self._price)
            self._cost_to_go = self._model.costs_to_go(self._price)
        else:
            hoists = self._hoists
            self._observer.advance(self._turned, hoists.columns(observation))
        z, pulley = self._observer.state(), self._observer.rises(self.horizon).T / self._period
        change = self.first_change(z, pulley, hoists.winch.speed)
        speed = pulley[:, 0] - z[:, 3] - change
        command, self._turned = hoists.winch.command(self._period * speed / hoists.winch.radius)
        return command

    def first_change(self, z: FloatArray, pulley: FloatArray, drum_speed: FloatArray) -> FloatArray:
        """Change (N,) m/s of the rope end's speed, from states z (N, 4) and mean pulley speeds (N, H) m/s to come."""
        problem = self.problem(z, pulley, drum_speed)
        regulated = np.empty_like(pulley)
        state = z
        for k in range(self.horizon):
            regulated[:, k] = -(self._k * state).sum(axis=1)
            state = self._model.advance(state, regulated[:, k])
        inputs, speeds = problem.inputs + regulated, problem.state + np.cumsum(regulated, axis=1)
        beyond = (abs(inputs) > problem.input_limit) | (abs(speeds) > problem.state_limit[:, None])
        rows = np.flatnonzero(beyond.any(axis=1))
        first = regulated[:, 0]
        if len(rows):
            first[rows] = problem.rows(rows).solve()[0][:, 0]
        return first

    def problem(self, z: FloatArray, pulley: FloatArray, drum_speed: FloatArray) -> BoundedTracking:
        """The problem of every row, in changes (N, H) m/s of the rope end's speed."""
        assert self._hoists is not None
        winch, (count, horizon) = self._hoists.winch, pulley.shape
        free = np.empty((horizon, count, 4))
        state = z
        for k in range(horizon):
            state = free[k] = self._model.advance(state, np.zeros(count))
        # The drum's mean speed in a control step is the pulley's less the rope end's. From its speed now it can
        # come by half of what it can gain in a whole step, and from step to step by all of it.
        inputs = -np.diff(pulley, axis=1, prepend=0.0)
        inputs[:, 0] += z[:, 3] + winch.radius * drum_speed
        gain = np.repeat((self._period * winch.radius * winch.max_acceleration)[:, None], horizon, axis=1)
        gain[:, 0] *= 0.5
        return BoundedTracking(
            a=self._model.a,
            b=np.repeat(self._model.b[:, None], horizon, axis=1),
            middle=np.zeros((count, 4)),
            middle_input=np.zeros((count, horizon)),
            error=np.ascontiguousarray(free[:, :, 0].T),
            error_middle=np.zeros((count, horizon)),
            weights=(1.0, 0.0, self._price),
            inputs=inputs,
            state=z[:, 3:] - pulley,
            input_limit=gain,
            state_limit=winch.radius * winch.max_speed,
            last_state=free[-1],
            # The error at the horizon's end is among those of the steps already.
            cost_to_go=self._cost_to_go - np.diag([1.0, 0.0, 0.0, 0.0]),
        )
