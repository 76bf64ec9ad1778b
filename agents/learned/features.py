"""Features of the learned agents: from observations to a network's inputs, and from its output to a drum speed.

The inputs are numbers of order one, each a fixed function of the observation and, for sensors, of a short memory of
the readings, so that an agent needs no running statistics and means the same on every crane and in every sea. The
output says how fast the rope's upper end is to go up or down in space. A feed-forward takes up what the pulley is about
to move meanwhile: with an output of zero the drum only follows the pulley.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from aframe_env.scenario.crane import Crane
from aframe_env.scenario.sensors import Sensors
from aframe_env.task import SENSED, STATE, Quantity
from aframe_env.validation import InvalidValue
from agents.control.filters import ALL, HEAVE_MEMORY, FadingPolynomial, FloatArray, Rows
from agents.control.observer import KalmanObserver
from agents.control.regulator import Columns, HoistBatch, Observation

Float32Array = npt.NDArray[np.float32]

LIMIT = 20.0
"""Features are clipped to ± this."""
AUTHORITY = 0.25
"""Speed of the rope's end for an output of 1 over the winch's greatest acceleration, s."""
_DAMPING_RATIO = 0.03  # of the load's bobbing on the rope, share of critical

STATE_FEATURES = (
    "depth_error",
    "depth_error_near_zero",
    "load_velocity_z",
    "stretch_deviation",
    "rope_end_speed",
    "pulley_velocity_z",
    "pulley_acceleration_z",
    "pulley_heave",
    "load_mass",
    "rope_length",
    "bobbing_rate",
)
SENSED_FEATURES = (
    *STATE_FEATURES[:-3],
    "pulley_acceleration_to_come",
    "pulley_acceleration_after_that",
    *STATE_FEATURES[-3:],
)


def feature_names(quantities: tuple[Quantity, ...]) -> tuple[str, ...]:
    """Names of the features of an observation with these quantities."""
    if quantities == STATE:
        return STATE_FEATURES
    if quantities == SENSED:
        return SENSED_FEATURES
    raise InvalidValue(f"no features for an observation of {[q.name for q in quantities]}")


class StateFeatures:
    """Features of N rows that observe the full state."""

    names = STATE_FEATURES

    def __init__(self, rows: int, control_period: float) -> None:
        self._hoists = HoistBatch(rows, control_period, STATE)
        self._rise = np.zeros(rows)
        """Rise of the pulley during the coming control step, (N,) m."""

    def start(self, observation: Observation, cranes: Sequence[Crane], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, hoists with these ``cranes`` (n)."""
        return self._look(self._hoists.start(cranes, observation, rows), rows)

    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        return self._look(self._hoists.columns(observation), ALL)

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), in [-1, 1]."""
        return self._hoists.winch.invert(_turn(self._rise, output, self._hoists))

    def _look(self, o: Columns, rows: Rows) -> Float32Array:
        hoists = self._hoists
        hoists.winch.speed[rows] = o["drum_speed"]
        self._rise[rows] = coming_rise(o, hoists.period)
        return _stacked(
            *of_the_state(np, o, hoists.winch.radius[rows], hoists.stretch(o, rows), hoists.frequency[rows])
        )


class SensedFeatures:
    """Features of N rows that have sensors: estimates of the present from the readings and the commands since."""

    names = SENSED_FEATURES

    def __init__(self, rows: int, control_period: float, sensors: Sensors) -> None:
        self._hoists = HoistBatch(rows, control_period, SENSED)
        self._observer = KalmanObserver(self._hoists, _DAMPING_RATIO, sensors)
        self._pulley = FadingPolynomial(rows, HEAVE_MEMORY, control_period)
        self._ahead = control_period * round(sensors.delay / control_period) + 0.5 * control_period
        """Time from the moment of measurement to the middle of the coming control step, s."""
        self._turned = np.zeros(rows)
        """Turn of the drums in this control step, rad."""
        self._rise = np.zeros(rows)
        """Rise of the pulley during the coming control step, (N,) m."""

    def start(self, observation: Observation, cranes: Sequence[Crane], rows: Rows = ALL) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows``, whose past is forgotten."""
        o = self._hoists.start(cranes, observation, rows)
        self._observer.start(o, rows)
        self._pulley.start(o["pulley_velocity_z"], rows)
        return self._look(o, rows)

    def advance(self, observation: Observation) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        o = self._hoists.columns(observation)
        self._observer.advance(self._turned, o)
        self._pulley.advance(o["pulley_velocity_z"])
        return self._look(o, ALL)

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), in [-1, 1]."""
        command, self._turned = self._hoists.winch.command(_turn(self._rise, output, self._hoists))
        return command

    def _look(self, o: Columns, rows: Rows) -> Float32Array:
        hoists = self._hoists
        depth_error, load_velocity, rope_end, rope_end_speed = self._observer.state()[rows].T
        self._rise[rows] = self._observer.rises(1)[0, rows]
        velocity = self._observer.pulley_velocity(3)[:, rows]
        soon, later = np.diff(velocity, axis=0) / hoists.period
        return _stacked(
            *_of_the_load(np, depth_error, load_velocity, rope_end - depth_error),
            10.0 * rope_end_speed,
            velocity[0],
            self._pulley.rate(rows) + self._ahead * self._pulley.second_derivative(rows),
            soon,
            later,
            *_of_the_lift(o, hoists.frequency[rows]),
        )


Features = StateFeatures | SensedFeatures


def features_for(rows: int, control_period: float, sensors: Sensors | None) -> Features:
    """Features of N rows with these sensors; None where the full state is observed."""
    return SensedFeatures(rows, control_period, sensors) if sensors else StateFeatures(rows, control_period)


def _turn(rise: FloatArray, output: FloatArray, hoists: HoistBatch) -> FloatArray:
    winch = hoists.winch
    return np.asarray(wanted_turn(np, rise, output, winch.radius, winch.max_acceleration, hoists.period))


# For arrays of numpy (``xp`` = numpy) and tensors of torch (``xp`` = torch) alike, all (N,).


def of_the_state(xp: Any, o: Mapping[str, Any], radius: Any, stretch: Any, frequency: Any) -> tuple[Any, ...]:
    """STATE_FEATURES, not clipped yet, of full states ``o``, by the names of their quantities.

    The drums' ``radius``, m; ``stretch`` of the ropes beyond that under the loads' weight, m; ``frequency`` of the
    loads' bobbing, rad/s.
    """
    return (
        *_of_the_load(xp, o["depth_error"], o["load_velocity_z"], stretch),
        10.0 * (o["pulley_velocity_z"] - radius * o["drum_speed"]),
        o["pulley_velocity_z"],
        o["pulley_acceleration_z"],
        *_of_the_lift(o, frequency),
    )


def coming_rise(o: Mapping[str, Any], period: float) -> Any:
    """Rise of the pulleys during a coming control step of ``period`` s, m, as the full state tells."""
    return period * (o["pulley_velocity_z"] + 0.5 * period * o["pulley_acceleration_z"])


def wanted_turn(xp: Any, rise: Any, output: Any, radius: Any, max_acceleration: Any, period: float) -> Any:
    """Turn of the drums, rad, while the pulleys ``rise`` m, for a network's ``output`` in [-1, 1]."""
    up = AUTHORITY * max_acceleration * radius * xp.clip(output, -1.0, 1.0)
    return (rise - period * up) / radius


def _of_the_load(xp: Any, depth_error: Any, velocity: Any, stretch: Any) -> tuple[Any, ...]:
    # Beyond some metres only the side of the error: there the agent does what it has learned nearer.
    return 4.0 * xp.tanh(0.5 * depth_error), 2.0 * xp.tanh(10.0 * depth_error), 5.0 * velocity, 20.0 * stretch


def _of_the_lift(o: Mapping[str, Any], frequency: Any) -> tuple[Any, ...]:
    return (
        0.5 * o["pulley_heave"],
        o["load_mass"] / 5.0e4 - 1.2,
        o["rope_length"] / 1.0e3 - 0.8,
        0.25 * frequency - 1.0,
    )


def _stacked(*features: FloatArray) -> Float32Array:
    return np.asarray(np.clip(np.stack(features, axis=1), -LIMIT, LIMIT), dtype=np.float32)
