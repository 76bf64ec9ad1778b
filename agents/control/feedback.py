"""Feed-forward of the pulley's motion with feedback of the load's, as in industrial practice.

The drum takes up whatever the pulley is about to move during the control step, and the regulator moves the rope's end
to bring the load back to its level: proportional and derivative terms on the depth error and on the rope's stretch,
matched to how the load at hand bobs on its rope (see ``regulator``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from agents.control.expected_waves import ExpectedWaves
from agents.control.observer import Observer, observer_for
from agents.control.regulator import Gains, HoistBatch, Observation, Regulator
from agents.policy import FloatArray, Knowledge

STATE_GAINS = Gains(effort=0.093, share=0.017)
"""Tuned with ``python -m train.tune_control``."""
SENSOR_GAINS = Gains(effort=0.15, share=0.019)
"""Tuned with ``python -m train.tune_control``."""


@dataclass
class Feedback:
    """Feed-forward and feedback of the full state, or of the sensors' readings through the agents' Kalman filters."""

    sensors: Sensors | None = field(default_factory=Sensors)
    """Delay and noise that the law is designed for; None for the full state, which has neither."""
    gains: Gains | None = None
    """None for those that were tuned."""
    waves: ExpectedWaves = field(default_factory=lambda: ExpectedWaves.of(ScenarioDistribution()))
    """Motion that the filters expect."""
    name: str = field(init=False)
    knows: Knowledge = field(init=False)
    _scenarios: Sequence[Scenario] = field(init=False, repr=False, default=())
    _period: float = field(init=False, repr=False, default=0.1)
    _hoists: HoistBatch | None = field(init=False, repr=False, default=None)
    _regulator: Regulator = field(init=False, repr=False)
    _observer: Observer = field(init=False, repr=False)
    _turned: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.sensors is None:
            self.name, self.knows = "feed-forward + feedback (state)", Knowledge.STATE
        else:
            self.name, self.knows = "feed-forward + feedback", Knowledge.SENSORS

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios only what a ``Lift`` has is looked at."""
        self._scenarios, self._period, self._hoists = scenarios, control_period, None

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        if self._hoists is not None:
            self._observer.retune(self._hoists.retune(rope_length, growth, wet))
            self._regulator = self._hoists.regulator(self._tuned)

    @property
    def _tuned(self) -> Gains:
        return self.gains or (STATE_GAINS if self.sensors is None else SENSOR_GAINS)

    def act(self, observation: Observation, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for readings (N, 10), or observations (N, 14) of the full state."""
        if self._hoists is None:
            quantities = STATE if self.sensors is None else SENSED
            hoists = self._hoists = HoistBatch(len(observation), self._period, quantities)
            o = hoists.start(self._scenarios, observation)
            self._regulator = hoists.regulator(self._tuned)
            self._observer = observer_for(hoists, self._tuned.damping_ratio, self.sensors, self.waves)
            self._observer.start(o)
        else:
            hoists = self._hoists
            self._observer.advance(self._turned, hoists.columns(observation))
        rise = self._observer.rises(1)[0]
        wanted = (rise - self._period * self._regulator.speed(self._observer.state())) / hoists.winch.radius
        command, self._turned = hoists.winch.command(wanted)
        return command
