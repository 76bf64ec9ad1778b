"""Feed-forward of the pulley's motion with feedback of the load's: what industry runs.

The drum takes up whatever the pulley is about to move during the control step, and the linear-quadratic regulator of
the rope's linear model (see ``rope``) moves the rope's end to bring the load back to its level: a proportional and a
derivative term on the depth error and one on the rope's stretch, matched to how the load at hand bobs on its rope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from aframe_env.crane import GRAVITY
from aframe_env.scenario import Scenario
from aframe_env.sensors import Sensors
from aframe_env.task import SENSED, STATE, Quantity
from aframe_env.validation import InvalidValue, require_number
from agents.control.rope import RopeModel
from agents.control.winch import WinchModel
from agents.estimation import DRUM_RADIUS, Estimator, Readings
from agents.policy import FloatArray, Knowledge

Observation = npt.NDArray[np.float32]


@dataclass(frozen=True, kw_only=True)
class Gains:
    """What is tuned of the law."""

    effort: float
    """Price of moving the rope's end, (mean square error) / (mean square movement in a control step)."""
    damping_ratio: float = 0.03
    """Damping of the load's bobbing on the rope that the law counts on, share of critical."""
    lead: float = 0.0
    """How much later than the model says the pulley's motion is predicted for, s."""

    def __post_init__(self) -> None:
        require_number("effort", self.effort, "", low=0.0, high=1e6, low_open=True)
        require_number("damping_ratio", self.damping_ratio, "of critical", low=0.0, high=1.0)
        require_number("lead", self.lead, "s", low=-1.0, high=1.0)


STATE_GAINS = Gains(effort=0.1)
SENSOR_GAINS = Gains(effort=1.0)


class Lifts:
    """What is fixed during the lifts of N rows: winches, weights, ropes."""

    def __init__(self, scenarios: Sequence[Scenario], control_period: float, quantities: tuple[Quantity, ...]) -> None:
        self.period = control_period
        self.winch = WinchModel(scenarios, control_period)
        self.axial_stiffness = np.array([s.crane.rope.axial_stiffness for s in scenarios])
        """(N,) N."""
        self._columns = {q.name: i for i, q in enumerate(quantities)}

    def columns(self, observation: Observation) -> dict[str, FloatArray]:
        """The observation (N, K) by the names of its quantities, each (N,)."""
        if observation.shape[1] != len(self._columns):
            raise InvalidValue(
                f"observation: {observation.shape[1]} quantities, the policy reads {len(self._columns)}: "
                f"{', '.join(self._columns)}"
            )
        return {name: observation[:, i].astype(np.float64) for name, i in self._columns.items()}

    def model(self, o: dict[str, FloatArray], damping_ratio: float) -> RopeModel:
        """Linear model of the loads and ropes."""
        frequency = np.sqrt(self.axial_stiffness / (o["rope_length"] * o["load_mass"]))
        return RopeModel.of(frequency, damping_ratio, self.period)

    def stretch(self, o: dict[str, FloatArray]) -> FloatArray:
        """Stretch of the rope beyond that under the load's weight, as the tension tells, m."""
        weight = o["load_mass"] * GRAVITY
        return (o["rope_tension"] - weight) * o["rope_length"] / self.axial_stiffness


@dataclass
class StateFeedback:
    """Feed-forward and feedback of the full state: the pulley's velocity and acceleration, the load, the tension."""

    gains: Gains = STATE_GAINS
    name: str = "feed-forward + feedback (state)"
    knows: Knowledge = field(init=False, default=Knowledge.STATE)
    _lifts: Lifts = field(init=False, repr=False)
    _k: FloatArray | None = field(init=False, repr=False, default=None)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the crane is looked at."""
        self._lifts = Lifts(scenarios, control_period, STATE)
        self._k = None

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s."""
        lifts, o = self._lifts, self._lifts.columns(observation)
        if self._k is None:
            self._k = lifts.model(o, self.gains.damping_ratio).gains(self.gains.effort)
        period = lifts.period
        lifts.winch.speed = o["drum_speed"]
        rope_end_speed = o["pulley_velocity_z"] - lifts.winch.radius * o["drum_speed"]
        rope_end = o["depth_error"] + lifts.stretch(o)
        z = np.stack([o["depth_error"], o["load_velocity_z"], rope_end, rope_end_speed], axis=1)
        lead = 0.5 * period + self.gains.lead
        pulley = period * (o["pulley_velocity_z"] + lead * o["pulley_acceleration_z"])
        command, _ = lifts.winch.command((pulley - period * (rope_end_speed - (self._k * z).sum(axis=1))) / lifts.winch.radius)
        return command


@dataclass
class SensorFeedback:
    """Feed-forward and feedback of what the sensors tell.

    The readings are late by ``delay``, whole control steps: the rope's model carries the estimates over it, with the
    commands given meanwhile and the pulley's motion as its velocity, acceleration and jerk foretell it.
    """

    gains: Gains = SENSOR_GAINS
    delay: float = Sensors().delay
    """From a motion to its reading, s."""
    name: str = "feed-forward + feedback"
    knows: Knowledge = field(init=False, default=Knowledge.SENSORS)
    _lifts: Lifts = field(init=False, repr=False)
    _model: RopeModel | None = field(init=False, repr=False, default=None)
    _k: FloatArray = field(init=False, repr=False)
    _estimator: Estimator = field(init=False, repr=False)
    _turns: FloatArray = field(init=False, repr=False)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the crane is looked at."""
        self._lifts = Lifts(scenarios, control_period, SENSED)
        self._estimator = Estimator(len(scenarios), control_period)
        self._turns = np.zeros((round(self.delay / control_period), len(scenarios)))
        self._model = None

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s."""
        lifts, o = self._lifts, self._lifts.columns(observation)
        radius, rows = lifts.winch.radius, slice(None)
        readings = Readings(
            heave_rate=o["pulley_velocity_z"],
            drum_angle=o["drum_angle"] * radius / DRUM_RADIUS,
            stretch=lifts.stretch(o),
            load_acceleration=(o["rope_tension"] / o["load_mass"] - GRAVITY),
            depth_error=o["depth_error"],
        )
        if self._model is None:
            self._model = lifts.model(o, self.gains.damping_ratio)
            self._k = self._model.gains(self.gains.effort)
            self._estimator.start(readings, rows)
        else:
            self._estimator.advance(readings)
        estimate = self._estimator.estimate(rows)
        late, period = len(self._turns), lifts.period
        times = period * np.arange(late + 2) + self.gains.lead
        path = times[:, None] * (
            estimate.pulley_velocity
            + times[:, None] * (estimate.pulley_acceleration / 2.0 + times[:, None] * estimate.pulley_jerk / 6.0)
        )
        pulley = np.diff(path, axis=0)
        rope_end = estimate.depth_error + estimate.stretch
        z = np.stack([estimate.depth_error, estimate.load_velocity, rope_end, np.zeros(len(rope_end))], axis=1)
        for i in range(late):
            z[:, 3] = 0.0
            z = self._model.advance(z, (pulley[i] - radius * self._turns[i]) / period)
        t = period * late + self.gains.lead
        z[:, 3] = estimate.pulley_velocity + t * (estimate.pulley_acceleration + t * estimate.pulley_jerk / 2.0)
        z[:, 3] -= radius * lifts.winch.speed
        command, turned = lifts.winch.command((pulley[late] - period * (z[:, 3] - (self._k * z).sum(axis=1))) / radius)
        self._turns = np.concatenate([self._turns, turned[None]])[1:] if late else self._turns
        return command
