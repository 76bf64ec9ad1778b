"""Model-predictive control: the regulator's problem over a horizon, with the winch's limits.

Minimise Σ e² + effort c² + zᵀ P z at the horizon's end, over the changes c of the rope end's speed, so that the drum's
speed and acceleration stay within the winch's limits while the pulley moves as predicted. Where the regulator itself
keeps the limits all along the horizon, its answer is the problem's; only the other rows need a quadratic program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from aframe_env.validation import require_integer, require_number
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, Rows
from agents.control.interior_point import BoundedTracking
from agents.control.lateness import require_readings
from agents.control.lift import Lift
from agents.control.observer import observer_for
from agents.control.previewed_path import PreviewedPath
from agents.control.regulator import QUICKEST, Columns, HoistBatch, Observation
from agents.control.rope import RopeModel
from agents.policy import FloatArray, Knowledge

STATE_EFFORT = 0.0094
"""Tuned with ``python -m train.tune_control``, s²."""
SENSOR_EFFORT = 0.017
"""Tuned with ``python -m train.tune_control``, s²."""
ADAPTIVE_EFFORT: Final = 1.5
"""s². Where lag, delay and stiffness are not as told a quick answer to the load drives it on: on 60 validation
scenarios of Unknown 0.017 leaves 81 % of the ceiling and -16 % in the worst 5 %, 1 to 2.5 leave 96 and 85 %."""
SLOW_HORIZON: Final = 80
"""Control steps that are planned on a heavy rope, whose load bobs slowly. Against the 50 of light ropes it has 2 points
more of the mean share, and 10 of that in the worst cases, on 40 validation scenarios of DeepRope."""
PREVIEW_HORIZON: Final = 100
"""Control steps that are planned where a wave radar foretells the heave. Against 50 it has 0.6 points more of the mean
share, and 0.3 less of that in the worst cases, on 40 validation scenarios of Preview; 150 give nothing."""
QUICKEST_SENSED: Final = 0.36
"""``QUICKEST`` on sensors: with 0.4 it drives the rope's own waves on from 1,500 to 2,000 m with 100 t."""


@dataclass(frozen=True, kw_only=True)
class PlanningConfig:
    """What predictive control is designed for."""

    sensors: Sensors | None = field(default_factory=Sensors)
    """Delay and noise; None for the full state, which has neither."""
    effort: float | None = None
    """Weight on changes of the rope end's speed, s²; None for the one that was tuned."""
    horizon: int = 50
    """Control steps."""
    damping_ratio: float = 0.03
    """Damping of the load's bobbing on the rope, share of critical."""
    waves: ExpectedWaves = field(default_factory=lambda: ExpectedWaves.of(ScenarioDistribution()))
    """Motion of the pulley."""
    adapts: bool = False
    """Reckon how much later than told readings and winch are, and look that much further ahead; on sensors alone."""
    chains: bool = False
    """Reckon with the rope's mass and the water's drag in the filter of the load, on sensors."""

    def __post_init__(self) -> None:
        require_number("effort", self.price, "s²", low=1e-8, high=1e8)
        require_integer("horizon", self.horizon, low=2, high=1000)
        require_number("damping_ratio", self.damping_ratio, "of critical", low=0.0, high=1.0)
        require_readings(self.adapts, self.sensors)

    @classmethod
    def of(cls, sensors: Sensors | None, waves: ExpectedWaves, *, light: bool, adapts: bool = False) -> PlanningConfig:
        """For lifts with these sensors in these waves; ``light``: all of them are, as ``Scenario.is_light`` says."""
        horizon = cls.horizon
        if sensors is not None and sensors.preview is not None:
            horizon = PREVIEW_HORIZON
        elif not light:
            horizon = SLOW_HORIZON
        chains = sensors is not None and not light
        return cls(sensors=sensors, horizon=horizon, waves=waves, adapts=adapts, chains=chains)

    @property
    def price(self) -> float:
        """The effort, or the one that was tuned, s²."""
        if self.effort is not None:
            return self.effort
        if self.adapts:
            return ADAPTIVE_EFFORT
        return STATE_EFFORT if self.sensors is None else SENSOR_EFFORT


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is planned for N hoists over the H control steps to come."""

    state: FloatArray
    """(N, 4) z of ``RopeModel``, now."""
    pulley: FloatArray
    """(N, H) mean speeds of the pulley, m/s."""
    regulated: FloatArray
    """(N, H) changes of the rope end's speed that the regulator would make, the winch's limits apart, m/s."""
    change: FloatArray
    """(N, H) changes that are planned, m/s."""
    depth_error: FloatArray
    """(N, H) depth errors that these lead to, at the steps' ends, m."""
    acceleration_demand: FloatArray
    """(N, H) what the regulator would ask of the drum, as a share of what the winch can gain of speed in a step."""
    speed_demand: FloatArray
    """(N, H) likewise, of the winch's greatest speed."""
    drum_change: FloatArray
    """(N, H) changes of the drum's mean speed from step to step that are planned, m/s upwards."""

    @property
    def rope_speed(self) -> FloatArray:
        """Mean speed (N,) m/s at which the drum is to pay out in the coming step."""
        return np.asarray(self.pulley[:, 0] - self.state[:, 3] - self.change[:, 0])

    @property
    def regulated_rope_speed(self) -> FloatArray:
        """The regulator's."""
        return np.asarray(self.pulley[:, 0] - self.state[:, 3] - self.regulated[:, 0])


class Planner:
    """Predictive control of N hoists: what it knows of them, what it plans, and the commands that come of it."""

    def __init__(self, rows: int, control_period: float, config: PlanningConfig) -> None:
        self._config = config
        self.period = control_period
        self.hoists = HoistBatch(rows, control_period, STATE if config.sensors is None else SENSED)
        self._observer = observer_for(
            self.hoists, config.damping_ratio, config.sensors, config.waves, config.adapts, config.chains
        )
        self._previewed = PreviewedPath.of(config.sensors, rows, control_period)
        self._turned, self._efforts = np.zeros(rows), np.ones(rows)
        self._k, self._cost_to_go = np.zeros((rows, 4)), np.zeros((rows, 4, 4))

    def start(self, observation: Observation, lifts: Sequence[Lift], rows: Rows = ALL) -> Columns:
        """Begin hoists in these rows with first observations (n, K); return these by their names."""
        o = self.hoists.start(lifts, observation, rows)
        self._observer.start(o, rows)
        if self._previewed is not None:
            self._previewed.take(observation, rows)
        self._tune(rows)
        return o

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        self._observer.retune(self.hoists.retune(rope_length, growth, wet))
        self._tune(ALL)

    def _tune(self, rows: Rows) -> None:
        model = self.hoists.model(self._config.damping_ratio, rows)
        quickest = QUICKEST if self._config.sensors is None else QUICKEST_SENSED
        self._efforts[rows] = efforts = self.hoists.efforts(self._config.price, rows, quickest)
        self._cost_to_go[rows] = cost_to_go = model.costs_to_go(efforts)
        self._k[rows] = model.gains_for(cost_to_go, efforts)

    def advance(self, observation: Observation) -> Columns:
        """Take the observations (N, K) of all rows, one control step later; return them by their names."""
        o = self.hoists.columns(observation)
        self._observer.advance(self._turned, o)
        if self._previewed is not None:
            self._previewed.take(observation)
        return o

    def plan(self, correction: FloatArray | None = None) -> Plan:
        """The plan, as things stand.

        ``correction`` (N, H) m/s of the pulley's mean speeds in the steps to come, as the wave bank foretells them.
        """
        rises = self._observer.rises(self._config.horizon)
        if self._previewed is not None:
            foretold = self._previewed.rises(self._observer.waves, len(rises))
            rises[: len(foretold)] = foretold
        pulley = rises.T / self.period
        if correction is not None:
            pulley = pulley + correction
        return self.plan_for(self._observer.state(), pulley, self.hoists.winch.speed)

    def command(self, rope_speed: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s by which the drums pay out at a mean ``rope_speed`` (N,) m/s."""
        command, self._turned = self.hoists.winch.command(self.period * rope_speed / self.hoists.winch.radius)
        return command

    def plan_for(self, z: FloatArray, pulley: FloatArray, drum_speed: FloatArray) -> Plan:
        """The plan for states z (N, 4), mean pulley speeds (N, H) m/s to come and drum speeds (N,) rad/s."""
        model = self._observer.model
        regulated, error = np.empty_like(pulley), np.empty_like(pulley)
        state = z
        for k in range(pulley.shape[1]):
            regulated[:, k] = -(self._k * state).sum(axis=1)
            state = model.advance(state, regulated[:, k])
            error[:, k] = state[:, 0]
        inputs, speed = self._nominal(z, pulley, drum_speed)
        acceleration_demand = abs(inputs + regulated) / self._gain(pulley.shape[1])
        winch = self.hoists.winch
        speed_demand = abs(speed + np.cumsum(regulated, axis=1)) / (winch.radius * winch.max_speed)[:, None]
        beyond = np.flatnonzero(((acceleration_demand > 1.0) | (speed_demand > 1.0)).any(axis=1))
        change = regulated
        if len(beyond):
            change = regulated.copy()
            for effort in np.unique(self._efforts[beyond]):
                alike = beyond[self._efforts[beyond] == effort]
                change[alike] = self.problem(z, pulley, drum_speed, alike).solve()[0]
            some, state = model.some(beyond), z[beyond]
            for k in range(pulley.shape[1]):
                state = some.advance(state, change[beyond, k])
                error[beyond, k] = state[:, 0]
        return Plan(
            state=z,
            pulley=pulley,
            regulated=regulated,
            change=change,
            depth_error=error,
            acceleration_demand=acceleration_demand,
            speed_demand=speed_demand,
            drum_change=inputs + change,
        )

    def problem(self, z: FloatArray, pulley: FloatArray, drum_speed: FloatArray, rows: Rows = ALL) -> BoundedTracking:
        """The problem of these rows, in changes (n, H) m/s of the rope end's speed; arguments of all rows.

        They must be rows of one effort.
        """
        winch = self.hoists.winch
        return bounded_problem(
            self._observer.model.some(rows),
            z[rows],
            pulley[rows],
            (winch.radius * drum_speed)[rows],
            change_limit=(self.period * winch.radius * winch.max_acceleration)[rows],
            speed_limit=(winch.radius * winch.max_speed)[rows],
            effort=float(self._efforts[rows][0]),
            cost_to_go=self._cost_to_go[rows],
        )

    def _nominal(self, z: FloatArray, pulley: FloatArray, drum_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
        return nominal(z, pulley, self.hoists.winch.radius * drum_speed)

    def _gain(self, horizon: int) -> FloatArray:
        winch = self.hoists.winch
        return gains_of_speed(self.period * winch.radius * winch.max_acceleration, horizon)


def nominal(z: FloatArray, pulley: FloatArray, rope_speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Changes of the drum's speed and its speeds, both (N, H) m/s upwards, as long as the rope's end keeps its.

    ``rope_speed`` (N,) m/s at which the drum pays out now.
    """
    # The drum's mean speed in a control step is the pulley's less the rope end's.
    inputs = -np.diff(pulley, axis=1, prepend=0.0)
    inputs[:, 0] += z[:, 3] + rope_speed
    return inputs, z[:, 3:] - pulley


def gains_of_speed(change_limit: FloatArray, horizon: int) -> FloatArray:
    """Speed (N, H) m/s that drums can gain, that of their ropes changing by ``change_limit`` (N,) m/s in a step.

    From its speed now a drum's mean speed in a step can come by half of what it can gain in a whole step, and from
    step to step by all of it.
    """
    gain = np.repeat(change_limit[:, None], horizon, axis=1)
    gain[:, 0] *= 0.5
    return gain


def bounded_problem(
    model: RopeModel,
    z: FloatArray,
    pulley: FloatArray,
    rope_speed: FloatArray,
    *,
    change_limit: FloatArray,
    speed_limit: FloatArray,
    effort: float,
    cost_to_go: FloatArray,
) -> BoundedTracking:
    """The problem of N hoists over H steps, in changes (N, H) m/s of the rope end's speed.

    ``z`` (N, 4): state of the rope's model; ``pulley`` (N, H) mean speeds to come, m/s; ``rope_speed``,
    ``change_limit`` (in a step) and ``speed_limit``: (N,) m/s at the drum; ``cost_to_go`` (N, 4, 4) at the end.
    """
    inputs, speed = nominal(z, pulley, rope_speed)
    count, horizon = speed.shape
    free = np.empty((horizon, count, 4))
    state = z
    for k in range(horizon):
        state = free[k] = model.advance(state, np.zeros(count))
    return BoundedTracking(
        a=model.a,
        b=np.repeat(model.b[:, None], horizon, axis=1),
        middle=np.zeros((count, 4)),
        middle_input=np.zeros((count, horizon)),
        error=np.ascontiguousarray(free[:, :, 0].T),
        error_middle=np.zeros((count, horizon)),
        weights=(1.0, 0.0, effort),
        inputs=inputs,
        state=speed,
        input_limit=gains_of_speed(change_limit, horizon),
        state_limit=speed_limit,
        last_state=free[-1],
        # The error at the horizon's end is among those of the steps already.
        cost_to_go=cost_to_go - np.diag([1.0, 0.0, 0.0, 0.0]),
    )


class PredictiveControl:
    """Model-predictive control; the agents' Kalman filters predict the motion."""

    def __init__(self, config: PlanningConfig | None = None) -> None:
        self.config = config or PlanningConfig()
        sensed, adapts = self.config.sensors is not None, self.config.adapts
        self.name = "adaptive " * adapts + ("predictive control" if sensed else "predictive control (state)")
        self.knows = Knowledge.SENSORS if sensed else Knowledge.STATE
        self._lifts: Sequence[Lift] = ()
        self._period = 0.1
        self._planner: Planner | None = None

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only what a ``Lift`` has is looked at."""
        self._lifts, self._period, self._planner = scenarios, control_period, None

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        if self._planner is not None:
            self._planner.retune(rope_length, growth, wet)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for readings (N, 10), or observations (N, 14) of the full state."""
        if self._planner is None:
            self._planner = Planner(len(observation), self._period, self.config)
            self._planner.start(observation, self._lifts)
        else:
            self._planner.advance(observation)
        return self._planner.command(self._planner.plan().rope_speed)
