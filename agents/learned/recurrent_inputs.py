"""What a recurrent agent is shown, and what its output does: the hand-written part of it.

A bank of waves that expects the task's seas tells the pulley's motion to come, and Kalman filters the load's state now,
as for predictive control (``agents.control.observer``). The agent sees the forecasts beside the readings that they come
from, and how far each reading was from what had been foretold: what the bank gets wrong is for the network to learn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.scenario import ScenarioDistribution
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import FloatArray
from agents.control.lift import Lift
from agents.control.observer import observer_for
from agents.control.regulator import Columns, HoistBatch, Observation
from agents.learned.features import DAMPING_RATIO, lift_features, winch_features

Float32Array = npt.NDArray[np.float32]

RATES_AHEAD: Final = (0.0, 0.1, 0.3, 0.6, 1.0, 1.4, 1.8, 2.2, 2.6, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0)
"""Times from now at which the pulley's heave rate is foretold, s."""
RISES_AHEAD: Final = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
"""Times from now over which its rise is, s."""
FORECASTS: Final = len(RATES_AHEAD) + len(RISES_AHEAD)
FIGURES: Final = ("winch_speed", "winch_acceleration", "winch_lag", "load_mass", "rope_length", "bobbing_rate")
"""What is told of a lift, as features."""
EFFORT: Final = 0.4
"""Of the regulator that the network's output is added to, s²; see ``RopeModel.gains``."""


@dataclass(frozen=True, kw_only=True)
class LookoutConfig:
    """What a recurrent agent's inputs are made for."""

    control_period: float = TaskConfig.control_period
    """s."""
    sensors: Sensors | None = None
    """Sensors that measure the observation; None where the full state is observed."""
    waves: ExpectedWaves = field(default_factory=lambda: ExpectedWaves.of(ScenarioDistribution()))
    """Motion of the pulley that is expected."""

    @classmethod
    def of(cls, task: TaskConfig) -> LookoutConfig:
        """For the agents of a task."""
        return cls(control_period=task.control_period, sensors=task.sensors, waves=ExpectedWaves.of(task.source))

    @property
    def readings(self) -> tuple[str, ...]:
        """Quantities beside the forecasts, each by its unit's scale."""
        return tuple(_SENSED_SCALES if self.sensors else _STATE_SCALES)


_SENSED_SCALES: Final = {"pulley_velocity_z": 1.0, "pulley_heave": 0.5, "roll": 10.0, "pitch": 10.0}
_STATE_SCALES: Final = {"pulley_velocity_z": 1.0, "pulley_heave": 0.5, "pulley_acceleration_z": 1.0}
_SURPRISE_SCALE: Final = 10.0


class Outlook(NamedTuple):
    """What is seen of N lifts at a control step."""

    series: Float32Array
    """(N, S) forecasts, readings and the last one's surprise: what the network remembers."""
    z: FloatArray
    """(N, 4) estimated state of ``RopeModel``."""
    rise: FloatArray
    """(N,) foretold mean speed of the pulley over the coming control step, m/s."""
    speed: FloatArray
    """(N,) of the rope at the drum, paid out, m/s."""


class Lookout:
    """Filters of N lifts that run in step, and the commands for a network's output."""

    def __init__(self, rows: int, config: LookoutConfig) -> None:
        self._hoists = HoistBatch(rows, config.control_period, STATE if config.sensors is None else SENSED)
        self._observer = observer_for(self._hoists, DAMPING_RATIO, config.sensors, config.waves)
        self._scales = _SENSED_SCALES if config.sensors else _STATE_SCALES
        self._period = config.control_period
        # The bank's time is that of the latest reading's moment of measurement.
        delay = 0.0 if config.sensors is None else round(config.sensors.delay / self._period) * self._period
        self._rates_at = delay + np.array(RATES_AHEAD)
        self._rises_at = delay + np.array((0.0, *RISES_AHEAD))
        self._turned = np.zeros(rows)
        self.figures = np.zeros((rows, len(FIGURES)), dtype=np.float32)
        """(N, F) ``FIGURES``."""
        self.gains = np.zeros((rows, 4))
        """(N, 4) of the regulator."""

    @property
    def most_speed(self) -> FloatArray:
        """(N,) greatest speed of the rope at the drum, m/s."""
        return self._hoists.winch.radius * self._hoists.winch.max_speed

    @property
    def most_change(self) -> FloatArray:
        """(N,) greatest change of it in a control step, m/s."""
        return self._period * self._hoists.winch.radius * self._hoists.winch.max_acceleration

    def start(self, observation: Observation, lifts: Sequence[Lift]) -> Outlook:
        """Begin with first observations (N, K)."""
        hoists = self._hoists
        o = hoists.start(lifts, observation)
        self._observer.start(o)
        self._tune(o)
        return self._look(o, np.zeros(len(observation)))

    def retune(self, rope_length: FloatArray, growth: FloatArray) -> None:
        """Go on with other ropes, as by ``HoistBatch.retune``."""
        self._observer.retune(self._hoists.retune(rope_length, growth))
        self._tune({"rope_length": rope_length, "pulley_heave": np.zeros(len(rope_length))})

    def _tune(self, o: Columns) -> None:
        hoists = self._hoists
        self.gains = hoists.model(DAMPING_RATIO).gains(hoists.efforts(EFFORT))
        speed, acceleration, lag = winch_features(hoists.winch)
        _, *lift = lift_features(o["pulley_heave"], hoists.mass, o["rope_length"], hoists.frequency)
        # Of order one, and about zero, for the winches of the tasks.
        figures = (4.0 * (speed - 1.0), 2.0 * (acceleration - 1.5), lag, *lift)
        self.figures = np.stack(figures, axis=1).astype(np.float32)

    def advance(self, observation: Observation) -> Outlook:
        """Take the observations (N, K), one control step later."""
        o = self._hoists.columns(observation)
        foretold = self._observer.waves.rate(np.array([self._period]))[0]
        self._observer.advance(self._turned, o)
        return self._look(o, o["pulley_velocity_z"] - foretold)

    def command(self, share: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s: change the speed by this share (N,) of what the winch can in a step."""
        winch = self._hoists.winch
        wanted = winch.speed + self._period * winch.max_acceleration * np.clip(share, -1.0, 1.0)
        command = np.clip(wanted, -winch.max_speed, winch.max_speed)
        return self.follow(command)

    def follow(self, command: FloatArray) -> FloatArray:
        """Reckon with commands (N,) rad/s that are given, by whomever; return them."""
        self._turned = self._hoists.winch.turn(command)
        return command

    def _look(self, o: Columns, surprise: FloatArray) -> Outlook:
        waves, winch = self._observer.waves, self._hoists.winch
        path = waves.path(self._rises_at)
        series = (
            *waves.rate(self._rates_at),
            *(path[1:] - path[0]),
            *(scale * o[name] for name, scale in self._scales.items()),
            _SURPRISE_SCALE * surprise,
        )
        z = self._observer.state()
        rise = self._observer.rises(1)[0] / self._period
        return Outlook(np.stack(series, axis=1).astype(np.float32), z, rise, winch.radius * winch.speed)
