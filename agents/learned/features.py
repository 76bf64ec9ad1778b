"""Features of the learned agents: from observations to a network's inputs, and from its output to a drum speed.

The inputs are numbers of order one, each a fixed function of the observations since the start, so that an agent needs
no running statistics and means the same on every crane and in every sea. A bank of waves, fitted to the pulley's heave
rate as it comes, foretells the pulley's motion; on sensors, Kalman filters tell the present from the readings. The
output says how fast the rope's upper end is to go up or down in space: with the residual action, a feed-forward takes
up what the pulley is about to move meanwhile, so that with an output of zero the drum only follows the pulley; with the
speed action there is nothing below the network, and the output is the drum's speed itself.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from aframe_env.scenario.crane import Crane
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE, Quantity
from aframe_env.validation import InvalidValue
from agents.control.expected_waves import ExpectedWaves
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.kalman import WaveBank, WaveFilter
from agents.control.observer import KalmanObserver
from agents.control.regulator import GRID, Columns, Gains, HoistBatch, Observation, gain_table, regulated_speed

Float32Array = npt.NDArray[np.float32]
Action = Literal["residual", "speed"]

LIMIT = 20.0
"""Features are clipped to ± this."""
AUTHORITY = 0.25
"""Speed of the rope's end for a small output, over that output and the winch's greatest acceleration, s."""
FAR_AUTHORITY = 1.25
"""The same for an output of 1: a fine hand near zero, and room to anticipate what the winch will not be able to do."""
AHEAD = (0.3, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0)
"""Times from now at which the pulley's velocity is foretold, s."""
RISES = (1.0, 2.0, 3.0, 4.0, 6.0)
"""Times from now by which the pulley's rise is foretold, s."""
STATE_REGULATOR = Gains(effort=0.01, share=0.02)
"""Regulator whose answer is a feature, on the full state."""
SENSED_REGULATOR = Gains(effort=0.03, share=0.02)
"""And on sensors."""

PRESENT = (
    "depth_error",
    "depth_error_near_zero",
    "load_velocity_z",
    "stretch_deviation",
    "rope_end_speed",
    "regulator",
    "pulley_velocity_z",
    "pulley_acceleration_z",
    "pulley_heave",
    "load_mass",
    "rope_length",
    "bobbing_rate",
    "max_rope_speed",
    "max_rope_acceleration",
    "drum_speed_share",
    "wanted_speed_change",
)
FORETOLD = (
    *(f"pulley_velocity_z_in_{t:g}_s" for t in AHEAD),
    *(f"pulley_rise_in_{t:g}_s" for t in RISES),
)
STATE_FEATURES = (*PRESENT, *FORETOLD)
SENSED_FEATURES = (*STATE_FEATURES, "heave_rate_innovation")


def feature_names(quantities: tuple[Quantity, ...]) -> tuple[str, ...]:
    """Names of the features of an observation with these quantities."""
    if quantities == STATE:
        return STATE_FEATURES
    if quantities == SENSED:
        return SENSED_FEATURES
    raise InvalidValue(f"no features for an observation of {[q.name for q in quantities]}")


class Features(ABC):
    """Features of N rows, and what their outputs ask of the winches."""

    names: tuple[str, ...]

    def __init__(self, hoists: HoistBatch, action: Action, gains: Gains) -> None:
        self._hoists, self._action, self._gains = hoists, action, gains
        self._table = gain_table(gains.damping_ratio, gains.effort, hoists.period)
        self._k = np.zeros((4, len(hoists.mass)))
        """Gains of the regulator."""
        self._rise = np.zeros(len(hoists.mass))
        """Rise of the pulley during the coming control step, (N,) m."""

    @abstractmethod
    def start(self, observation: Observation, cranes: Sequence[Crane], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, whose past is forgotten."""

    @abstractmethod
    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), in [-1, 1]."""
        winch, period = self._hoists.winch, self._hoists.period
        if self._action == "speed":
            return self._speed(np.clip(output, -1.0, 1.0) * winch.max_speed)
        return self._turn(wanted_turn(np, self._rise, output, winch.radius, winch.max_acceleration, period))

    @abstractmethod
    def _turn(self, turn: FloatArray) -> FloatArray:
        """Commands (N,) rad/s that turn the drums by ``turn`` (N,) rad, as nearly as may be."""

    @abstractmethod
    def _speed(self, speed: FloatArray) -> FloatArray:
        """Commands (N,) rad/s, which these are; take note of what they do."""

    def _start(self, observation: Observation, cranes: Sequence[Crane], rows: Rows) -> Columns:
        o = self._hoists.start(cranes, observation, rows)
        frequency = self._hoists.frequency[rows]
        self._k[:, rows] = [np.interp(frequency, GRID, line) for line in self._table]
        return o

    def _stacked(
        self,
        o: Columns,
        rows: Rows,
        z: Sequence[FloatArray],
        pulley: Sequence[FloatArray],
        foretold: FloatArray,
    ) -> Float32Array:
        """Features (n, F) in the order of the names, from the rope's state z, 4 of (n,), and what is foretold.

        ``pulley``: its velocity and acceleration now, each (n,).
        """
        hoists, winch = self._hoists, self._hoists.winch
        acceleration = self._gains.share * winch.radius[rows] * winch.max_acceleration[rows]
        amplitude = acceleration / hoists.frequency[rows] ** 2
        up = regulated_speed(np, self._k[:, rows], amplitude, acceleration, z)
        of_the_load = (
            *load_features(np, z[0], z[1], z[2] - z[0], z[3]),
            output_for(np, up, winch.radius[rows], winch.max_acceleration[rows]),
            *pulley,
        )
        of_the_lift = lift_features(
            o["pulley_heave"],
            hoists.mass[rows],
            o["rope_length"],
            hoists.frequency[rows],
            winch.radius[rows],
            winch.max_speed[rows],
            winch.max_acceleration[rows],
            winch.speed[rows],
            self._rise[rows] / hoists.period,
            hoists.period,
            np,
        )
        features = np.stack([*of_the_load, *of_the_lift, *foretold], axis=1)
        return np.asarray(np.clip(features, -LIMIT, LIMIT), dtype=np.float32)


class StateFeatures(Features):
    """Features of N rows that observe the full state."""

    names = STATE_FEATURES

    def __init__(self, rows: int, control_period: float, waves: ExpectedWaves, action: Action = "residual") -> None:
        super().__init__(HoistBatch(rows, control_period, STATE), action, STATE_REGULATOR)
        self._waves = WaveFilter(rows, control_period, 1, WaveBank.of(waves, None))

    def start(self, observation: Observation, cranes: Sequence[Crane], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, whose past is forgotten."""
        o = self._start(observation, cranes, rows)
        self._waves.start(rows)
        return self._look(o, rows)

    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        o = self._hoists.columns(observation)
        self._waves.advance(o["pulley_velocity_z"])
        return self._look(o, ALL)

    def _turn(self, turn: FloatArray) -> FloatArray:
        return self._hoists.winch.invert(turn)

    def _speed(self, speed: FloatArray) -> FloatArray:
        return speed

    def _look(self, o: Columns, rows: Rows) -> Float32Array:
        hoists = self._hoists
        hoists.winch.speed[rows] = o["drum_speed"]
        self._rise[rows] = coming_rise(o, hoists.period)
        return self._stacked(
            o,
            rows,
            (
                o["depth_error"],
                o["load_velocity_z"],
                o["depth_error"] + hoists.stretch(o, rows),
                o["pulley_velocity_z"] - hoists.winch.radius[rows] * o["drum_speed"],
            ),
            (o["pulley_velocity_z"], o["pulley_acceleration_z"]),
            self._waves.foretold(np.array(AHEAD), np.array(RISES), rows),
        )


class SensedFeatures(Features):
    """Features of N rows that have sensors: estimates of the present from the readings and the commands since."""

    names = SENSED_FEATURES

    def __init__(
        self,
        rows: int,
        control_period: float,
        waves: ExpectedWaves,
        sensors: Sensors,
        action: Action = "residual",
    ) -> None:
        super().__init__(HoistBatch(rows, control_period, SENSED), action, SENSED_REGULATOR)
        self._observer = KalmanObserver(self._hoists, SENSED_REGULATOR.damping_ratio, sensors, waves)
        self._delay = control_period * round(sensors.delay / control_period)
        self._turned = np.zeros(rows)
        """Turn of the drums in this control step, rad."""

    def start(self, observation: Observation, cranes: Sequence[Crane], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, whose past is forgotten."""
        o = self._start(observation, cranes, rows)
        self._observer.start(o, rows)
        return self._look(o, rows)

    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        o = self._hoists.columns(observation)
        self._observer.advance(self._turned, o)
        return self._look(o, ALL)

    def _turn(self, turn: FloatArray) -> FloatArray:
        command, self._turned = self._hoists.winch.command(turn)
        return command

    def _speed(self, speed: FloatArray) -> FloatArray:
        self._turned = self._hoists.winch.turn(speed)
        return speed

    def _look(self, o: Columns, rows: Rows) -> Float32Array:
        hoists, observer = self._hoists, self._observer
        self._rise[rows] = observer.rises(1)[0, rows]
        velocity = observer.pulley_velocity(2)[:, rows]
        foretold = observer.waves.foretold(np.array(AHEAD), np.array(RISES), rows, self._delay)
        return self._stacked(
            o,
            rows,
            list(observer.state()[rows].T),
            (velocity[0], (velocity[1] - velocity[0]) / hoists.period),
            np.concatenate([foretold, 10.0 * observer.waves.innovation[None, rows]]),
        )


def features_for(
    rows: int,
    control_period: float,
    sensors: Sensors | None,
    waves: ExpectedWaves,
    action: Action = "residual",
) -> Features:
    """Features of N rows with these sensors; None where the full state is observed."""
    if sensors is None:
        return StateFeatures(rows, control_period, waves, action)
    return SensedFeatures(rows, control_period, waves, sensors, action)


# For arrays of numpy (``xp`` = numpy) and tensors of torch (``xp`` = torch) alike, all (N,).


def load_features(xp: Any, depth_error: Any, velocity: Any, stretch: Any, rope_end_speed: Any) -> tuple[Any, ...]:
    """The first of PRESENT, not clipped yet; ``stretch`` of the ropes beyond that under the loads' weight, m."""
    return (
        # Beyond some metres only the side of the error: there the agent does what it has learned nearer.
        4.0 * xp.tanh(0.5 * depth_error),
        2.0 * xp.tanh(10.0 * depth_error),
        5.0 * velocity,
        20.0 * stretch,
        10.0 * rope_end_speed,
    )


def lift_features(
    pulley_heave: Any,
    mass: Any,
    rope_length: Any,
    frequency: Any,
    radius: Any,
    max_speed: Any,
    max_acceleration: Any,
    drum_speed: Any,
    pulley_speed: Any,
    period: float,
    xp: Any,
) -> tuple[Any, ...]:
    """The last of PRESENT, not clipped yet.

    ``frequency`` of the loads' bobbing and the drums' speeds and limits in rad/s, rad/s²; mean ``pulley_speed`` in the
    coming control step, m/s.
    """
    change = (pulley_speed - radius * drum_speed) / (radius * max_acceleration * period)
    return (
        0.5 * pulley_heave,
        mass / 5.0e4 - 1.2,
        rope_length / 1.0e3 - 0.8,
        0.25 * frequency - 1.0,
        radius * max_speed - 2.0,
        radius * max_acceleration - 1.0,
        drum_speed / max_speed,
        4.0 * xp.tanh(0.5 * change),
    )


def coming_rise(o: Mapping[str, Any], period: float) -> Any:
    """Rise of the pulleys during a coming control step of ``period`` s, m, as the full state tells."""
    return period * (o["pulley_velocity_z"] + 0.5 * period * o["pulley_acceleration_z"])


def wanted_turn(xp: Any, rise: Any, output: Any, radius: Any, max_acceleration: Any, period: float) -> Any:
    """Turn of the drums, rad, while the pulleys ``rise`` m, for a network's ``output`` in [-1, 1]."""
    output = xp.clip(output, -1.0, 1.0)
    up = max_acceleration * radius * output * (AUTHORITY + (FAR_AUTHORITY - AUTHORITY) * output * output)
    return (rise - period * up) / radius


def output_for(xp: Any, up: Any, radius: Any, max_acceleration: Any) -> Any:
    """Output in [-1, 1] at which the rope's end goes up at ``up`` m/s, or as near as may be: inverse of the above."""
    # The real root of (F - A) x³ + A x = y, by Cardano's formula in its hyperbolic form, which loses no digits near 0.
    y = xp.clip(up / (max_acceleration * radius), -FAR_AUTHORITY, FAR_AUTHORITY)
    p = AUTHORITY / (FAR_AUTHORITY - AUTHORITY)
    scale = 2.0 * math.sqrt(p / 3.0)
    return scale * xp.sinh(xp.arcsinh(4.0 * y / (scale**3 * (FAR_AUTHORITY - AUTHORITY))) / 3.0)
