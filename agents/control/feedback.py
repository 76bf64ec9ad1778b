"""Feed-forward of the pulley's motion with feedback of the load's, as in industrial practice.

The drum takes up whatever the pulley is about to move during the control step, and the regulator moves the rope's end
to bring the load back to its level: proportional and derivative terms on the depth error and on the rope's stretch,
matched to how the load at hand bobs on its rope (see ``regulator``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from aframe_env.scenario import Scenario
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from aframe_env.validation import require_number
from agents.control.observer import PolynomialObserver
from agents.control.regulator import Gains, HoistBatch, Observation, Regulator
from agents.policy import FloatArray, Knowledge

STATE_GAINS = Gains(effort=0.087, share=0.018)
"""Tuned with ``python -m train.tune_control``."""
SENSOR_GAINS = Gains(effort=0.026, share=0.049)
"""Tuned with ``python -m train.tune_control``."""


@dataclass
class StateFeedback:
    """Feed-forward and feedback of the full state: the pulley's velocity and acceleration, the load, the tension."""

    gains: Gains = STATE_GAINS
    name: str = "feed-forward + feedback (state)"
    knows: Knowledge = field(init=False, default=Knowledge.STATE)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _hoists: HoistBatch | None = field(init=False, repr=False, default=None)
    _regulator: Regulator = field(init=False, repr=False)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the crane is looked at."""
        self._scenarios, self._period, self._hoists = scenarios, control_period, None

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, 14) of the full state."""
        if self._hoists is None:
            self._hoists = HoistBatch(len(observation), self._period, STATE)
            self._hoists.start([s.crane for s in self._scenarios], observation)
            self._regulator = self._hoists.regulator(self.gains)
        hoists, period = self._hoists, self._period
        winch, o = hoists.winch, hoists.columns(observation)
        winch.speed = o["drum_speed"]
        rope_end = o["depth_error"] + hoists.stretch(o)
        rope_end_speed = o["pulley_velocity_z"] - winch.radius * o["drum_speed"]
        z = np.stack([o["depth_error"], o["load_velocity_z"], rope_end, rope_end_speed], axis=1)
        rise = period * (o["pulley_velocity_z"] + 0.5 * period * o["pulley_acceleration_z"])
        command, _ = winch.command((rise - period * self._regulator.speed(z)) / winch.radius)
        return command


@dataclass
class SensorFeedback:
    """Feed-forward and feedback of the sensors' readings.

    The readings are late by ``delay``, taken as whole control steps: the rope's model carries the estimates over it,
    with the drum's turns meanwhile and the pulley's motion as its velocity, acceleration and jerk predict it.
    """

    gains: Gains = SENSOR_GAINS
    delay: float = Sensors().delay
    """Delay from a motion to its reading, s."""
    name: str = "feed-forward + feedback"
    knows: Knowledge = field(init=False, default=Knowledge.SENSORS)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _hoists: HoistBatch | None = field(init=False, repr=False, default=None)
    _regulator: Regulator = field(init=False, repr=False)
    _observer: PolynomialObserver = field(init=False, repr=False)
    _turned: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        require_number("delay", self.delay, "s", low=0.0, high=10.0)

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only the crane is looked at."""
        self._scenarios, self._period, self._hoists = scenarios, control_period, None

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for readings (N, 10)."""
        if self._hoists is None:
            hoists = self._hoists = HoistBatch(len(observation), self._period, SENSED)
            o = hoists.start([s.crane for s in self._scenarios], observation)
            self._regulator = hoists.regulator(self.gains)
            self._observer = PolynomialObserver(hoists, self.gains.damping_ratio, self.delay)
            self._observer.start(o)
        else:
            hoists = self._hoists
            self._observer.advance(self._turned, hoists.columns(observation))
        rise = self._observer.rises(1)[0]
        wanted = (rise - self._period * self._regulator.speed(self._observer.state())) / hoists.winch.radius
        command, self._turned = hoists.winch.command(wanted)
        return command
