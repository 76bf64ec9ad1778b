"""What a recurrent agent is shown, and what its output does: the hand-written part of it.

A bank of waves that expects the task's seas tells the pulley's motion to come, and Kalman filters the load's state now,
as for predictive control (``agents.control.observer``). The agent sees the forecasts beside the readings that they come
from, and how far each reading was from what had been foretold: what the bank gets wrong is for the network to learn.
Where a wave radar foretells the heave, it sees how far the pulley will have risen by each lead, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.config import TaskConfig
from aframe_env.scenario import ScenarioDistribution, ScenarioSource
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE, quantities
from aframe_env.validation import InvalidValue
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.lateness import require_readings
from agents.control.lift import Lift
from agents.control.observer import KalmanObserver, observer_for
from agents.control.previewed_path import PreviewedPath
from agents.control.regulator import Columns, HoistBatch, Observation
from agents.control.rope_filter import RopeFilter
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
    adapts: bool = False
    """Reckon how much later than told readings and winch are, and look that much further ahead; on sensors alone."""

    chains: bool = False
    """Reckon with the rope's mass and the water's drag in the filter of the load; not together with ``adapts``."""

    def __post_init__(self) -> None:
        require_readings(self.adapts, self.sensors)
        if self.adapts and self.chains:
            raise InvalidValue("adapts = True, chains = True: must be one of both at most")

    @classmethod
    def of(cls, task: TaskConfig) -> LookoutConfig:
        """For the agents of a task."""
        source, sensed = task.source, task.sensors is not None
        adapts = sensed and _is_late(source)
        return cls(
            control_period=task.control_period,
            sensors=task.sensors,
            waves=ExpectedWaves.of(source),
            adapts=adapts,
            chains=sensed and not adapts and bool(source.water or source.crane.rope.mass_per_length),
        )

    @property
    def delay(self) -> int:
        """Of the readings, in control steps."""
        return 0 if self.sensors is None else round(self.sensors.delay / self.control_period)

    @property
    def readings(self) -> tuple[str, ...]:
        """Quantities beside the forecasts, each by its unit's scale: what is read, and what a radar foretells."""
        foretold = quantities(self.sensors)[len(SENSED) :] if self.sensors else ()
        read = tuple(_SENSED_SCALES if self.sensors else _STATE_SCALES)
        of_unit = ("heard", "missed_depth") if self.has_motion_unit else ()
        return (*read, *("lateness",) * self.adapts, *of_unit, *(quantity.name for quantity in foretold))

    @property
    def has_motion_unit(self) -> bool:
        """Whether a motion reference unit with errors of its own tells the heave: then the depth is looked at, too."""
        return self.sensors is not None and self.sensors.motion_unit is not None


_SENSED_SCALES: Final = {"pulley_velocity_z": 1.0, "pulley_heave": 0.5, "roll": 10.0, "pitch": 10.0}
_STATE_SCALES: Final = {"pulley_velocity_z": 1.0, "pulley_heave": 0.5, "pulley_acceleration_z": 1.0}
_PREVIEW_SCALE: Final = 0.5
_SURPRISE_SCALE: Final = 10.0
_LATENESS_SCALE: Final = 5.0
_DEPTH_SCALE: Final = 2.0


def _is_late(source: ScenarioSource) -> bool:
    """Whether winches or readings may be later than told."""
    told = None if source.told is None else source.told.lag
    return source.sensor_delay is not None or told is not None


class Outlook(NamedTuple):
    """What is seen of N lifts at a control step."""

    series: Float32Array
    """(N, S) forecasts, readings and the last one's surprise: what the network remembers."""
    z: FloatArray
    """(N, 4) estimated state of ``RopeModel``."""
    rise: FloatArray
    """(N,) foretold mean speed of the pulley over the coming control step, m/s; at its end, where the winch lags."""
    speed: FloatArray
    """(N,) of the rope at the drum, paid out, m/s; on sensors as reckoned from the commands, all being as told."""


class Lookout:
    """Filters of N lifts that run in step, and the commands for a network's output."""

    def __init__(self, rows: int, config: LookoutConfig) -> None:
        self._hoists = HoistBatch(rows, config.control_period, STATE if config.sensors is None else SENSED)
        self._observer = observer_for(
            self._hoists, DAMPING_RATIO, config.sensors, config.waves, config.adapts, config.chains
        )
        self._previewed = PreviewedPath.of(config.sensors, rows, config.control_period)
        self._scales = _SENSED_SCALES if config.sensors else _STATE_SCALES
        self._has_motion_unit = config.has_motion_unit
        self._period = config.control_period
        # The bank's time is that of the latest reading's moment of measurement.
        delay = config.delay * self._period
        self._rates_at = delay + np.array(RATES_AHEAD)
        self._rises_at = delay + np.array((0.0, *RISES_AHEAD))
        self._step_ends_at = delay + np.array((self._period,))
        self.turned = np.zeros(rows)
        """(N,) rad: turn of the drums in the latest control step, as reckoned."""
        self.figures = np.zeros((rows, len(FIGURES)), dtype=np.float32)
        """(N, F) ``FIGURES``."""
        self.gains = np.zeros((rows, 4))
        """(N, 4) of the regulator."""

    @property
    def load_gain(self) -> FloatArray:
        """(N, 4) gain of the filter of the load at the latest readings, on sensors."""
        assert isinstance(self._observer, KalmanObserver)
        assert isinstance(self._observer.load, RopeFilter)
        return self._observer.load.gain

    @property
    def told_transition(self) -> FloatArray:
        """(N, 3, 4) of depth error, its rate and rope's end, of these and of its mean speed, as the filter has it."""
        return self._observer.model.a[:, :3]

    @property
    def most_speed(self) -> FloatArray:
        """(N,) greatest speed of the rope at the drum, m/s."""
        return self._hoists.winch.radius * self._hoists.winch.max_speed

    @property
    def lag(self) -> FloatArray:
        """(N,) of the winches, in control steps."""
        return self._hoists.winch.lag / self._period

    @property
    def most_change(self) -> FloatArray:
        """(N,) greatest change of it in a control step, m/s."""
        return self._period * self._hoists.winch.radius * self._hoists.winch.max_acceleration

    def start(self, observation: Observation, lifts: Sequence[Lift], rows: Rows = ALL) -> Outlook:
        """Begin with first observations (n, K) in these ``rows``, whose past is forgotten; what is seen of them."""
        o = self._hoists.start(lifts, observation, rows)
        self._observer.start(o, rows)
        self._tune(o, rows)
        return self._look(observation, o, np.zeros(len(observation)), rows)

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        self._observer.retune(self._hoists.retune(rope_length, growth, wet))
        self._tune({"rope_length": rope_length, "pulley_heave": np.zeros(len(rope_length))}, ALL)

    def _tune(self, o: Columns, rows: Rows) -> None:
        hoists = self._hoists
        self.gains[rows] = hoists.model(DAMPING_RATIO, rows).gains(hoists.efforts(EFFORT, rows))
        speed, acceleration, lag = (each[rows] for each in winch_features(hoists.winch))
        _, *lift = lift_features(o["pulley_heave"], hoists.mass[rows], o["rope_length"], hoists.frequency[rows])
        # Of order one, and about zero, for the winches of the tasks.
        figures = (4.0 * (speed - 1.0), 2.0 * (acceleration - 1.5), lag, *lift)
        self.figures[rows] = np.stack(figures, axis=1)

    def advance(self, observation: Observation) -> Outlook:
        """Take the observations (N, K), one control step later."""
        o = self._hoists.columns(observation)
        foretold = self._observer.waves.rate(np.array([self._period]))[0]
        self._observer.advance(self.turned, o)
        return self._look(observation, o, o["pulley_velocity_z"] - foretold, ALL)

    def command(self, share: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s: change the speed by this share (N,) of what the winch can in a step.

        A winch with a lag ramps all through a step if the command is ahead by what it would gain over its lag, too.
        """
        winch = self._hoists.winch
        wanted = winch.speed + (self._period + winch.lag) * winch.max_acceleration * np.clip(share, -1.0, 1.0)
        command = np.clip(wanted, -winch.max_speed, winch.max_speed)
        return self.follow(command)

    def follow(self, command: FloatArray) -> FloatArray:
        """Reckon with commands (N,) rad/s that are given, by whomever; return them."""
        self.turned = self._hoists.winch.turn(command)
        return command

    def _look(self, observation: Observation, o: Columns, surprise: FloatArray, rows: Rows) -> Outlook:
        waves, winch, lateness = self._observer.waves, self._hoists.winch, self._observer.lateness
        rates_at, rises_at, ends_at = self._rates_at, self._rises_at, self._step_ends_at
        if lateness is not None:
            rates_at, rises_at, ends_at = (each[:, None] + lateness.seconds for each in (rates_at, rises_at, ends_at))
        path = waves.path(rises_at)
        foretold = np.zeros((0, len(self.turned)))
        if self._previewed is not None:
            self._previewed.take(observation, rows)
            foretold = self._previewed.rises_at_leads(waves)
        series = (
            *waves.rate(rates_at)[:, rows],
            *(path[1:] - path[0])[:, rows],
            *(scale * o[name] for name, scale in self._scales.items()),
            *(() if lateness is None else (_LATENESS_SCALE * lateness.seconds[rows],)),
            *(each[rows] for each in self._of_unit()),
            *(_PREVIEW_SCALE * foretold[:, rows]),
            _SURPRISE_SCALE * surprise,
        )
        z = self._observer.state()[rows]
        rise = self._observer.rises(1)[0] / self._period
        if (winch.lag > 0.0).any():
            rise = np.where(winch.lag > 0.0, waves.rate(ends_at)[0], rise)
        return Outlook(np.stack(series, axis=1).astype(np.float32), z, rise[rows], (winch.radius * winch.speed)[rows])

    def _of_unit(self) -> tuple[FloatArray, ...]:
        """What is seen of a motion reference unit: whether it is heard, and what the depth says against it."""
        if not self._has_motion_unit:
            return ()
        assert isinstance(self._observer, KalmanObserver)
        return self._observer.heard.astype(np.float64), _DEPTH_SCALE * self._observer.waves.missed
