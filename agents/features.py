"""From observations in physical units to the inputs of a network: numbers of order one, nothing added.

Each feature is a fixed function of the observation and, for sensors, of a short memory of the readings (see
``estimation``), so that an agent needs no running statistics and means the same on every crane and in every sea.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.crane import GRAVITY
from aframe_env.task import SENSED, STATE, Quantity
from aframe_env.validation import InvalidValue
from agents.estimation import Estimator, Readings

Float32Array = npt.NDArray[np.float32]

_TYPICAL_STIFFNESS = 2.0e8  # N, turns tension into stretch: a scale, not a claim about the crane at hand
_LIMIT = 20.0

STATE_FEATURES = (
    "depth_error",
    "load_velocity_z",
    "load_acceleration_z",
    "pulley_velocity_z",
    "pulley_acceleration_z",
    "drum_speed",
    "stretch_deviation",
    "pulley_heave",
    "load_mass",
    "rope_length",
    "bobbing_rate",
)
SENSED_FEATURES = (
    "depth_error_estimate",
    "load_velocity_estimate",
    "load_acceleration_z",
    "pulley_velocity_estimate",
    "pulley_acceleration_estimate",
    "pulley_jerk_estimate",
    "drum_speed",
    "stretch_estimate",
    "pulley_heave",
    "roll",
    "pitch",
    "load_mass",
    "rope_length",
    "bobbing_rate",
)


def feature_names(quantities: tuple[Quantity, ...]) -> tuple[str, ...]:
    """Names of the features of an observation with these quantities."""
    if quantities == STATE:
        return STATE_FEATURES
    if quantities == SENSED:
        return SENSED_FEATURES
    raise InvalidValue(f"no features for an observation of {[q.name for q in quantities]}")


class FeatureMaker:
    """Features of N rows, control step by control step."""

    def __init__(self, quantities: tuple[Quantity, ...], rows: int, control_period: float) -> None:
        self.names = feature_names(quantities)
        self._columns = {q.name: i for i, q in enumerate(quantities)}
        self._estimator = Estimator(rows, control_period) if quantities == SENSED else None

    def start(self, observation: npt.NDArray[np.float32], rows: npt.NDArray[np.int64]) -> Float32Array:
        """Features (n, F) of the first observations (n, K) of these ``rows`` (n,), whose past is forgotten."""
        o = observation.astype(np.float64)
        if self._estimator is None:
            return self._state_features(o)
        self._estimator.start(self._readings(o), rows)
        return self._sensed_features(o, self._estimator, rows)

    def advance(self, observation: npt.NDArray[np.float32]) -> Float32Array:
        """Features (N, F) of all rows, whose observations (N, K) are one control step later."""
        o = observation.astype(np.float64)
        if self._estimator is None:
            return self._state_features(o)
        self._estimator.advance(self._readings(o))
        return self._sensed_features(o, self._estimator, slice(None))

    def _readings(self, o: npt.NDArray[np.float64]) -> Readings:
        mass, length = o[:, self._columns["load_mass"]], o[:, self._columns["rope_length"]]
        excess = o[:, self._columns["rope_tension"]] / (mass * GRAVITY) - 1.0
        return Readings(
            heave_rate=o[:, self._columns["pulley_velocity_z"]],
            drum_angle=o[:, self._columns["drum_angle"]],
            stretch=excess * mass * GRAVITY * length / _TYPICAL_STIFFNESS,
            load_acceleration=excess * GRAVITY,
            depth_error=o[:, self._columns["depth_error"]],
        )

    def _state_features(self, o: npt.NDArray[np.float64]) -> Float32Array:
        return state_features(o, self._columns)

    def _sensed_features(
        self, o: npt.NDArray[np.float64], estimator: Estimator, rows: npt.NDArray[np.int64] | slice
    ) -> Float32Array:
        column = {name: o[:, i] for name, i in self._columns.items()}
        mass, length, drum_speed = column["load_mass"], column["rope_length"], column["drum_speed"]
        excess = column["rope_tension"] / (mass * GRAVITY) - 1.0
        estimate = estimator.estimate(rows)
        derived = (
            _side(estimate.depth_error),
            2.0 * estimate.load_velocity,
            4.0 * excess,
            estimate.pulley_velocity,
            estimate.pulley_acceleration,
            estimate.pulley_jerk,
            0.75 * drum_speed,
            4.0 * estimate.stretch,
            0.5 * column["pulley_heave"],
            10.0 * column["roll"],
            20.0 * column["pitch"],
            *_lift(mass, length),
        )
        return _stacked(derived)


def state_features(o: npt.NDArray[np.float64], columns: dict[str, int]) -> Float32Array:
    """Features (N, F) of the full state (N, K)."""
    column = {name: o[:, i] for name, i in columns.items()}
    mass, length = column["load_mass"], column["rope_length"]
    excess = column["rope_tension"] / (mass * GRAVITY) - 1.0
    derived = (
        _side(column["depth_error"]),
        2.0 * column["load_velocity_z"],
        4.0 * excess,
        column["pulley_velocity_z"],
        column["pulley_acceleration_z"],
        0.75 * column["drum_speed"],
        4.0 * excess * mass * GRAVITY * length / _TYPICAL_STIFFNESS,
        0.5 * column["pulley_heave"],
        *_lift(mass, length),
    )
    return _stacked(derived)


def _side(depth_error: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Depth error; beyond some metres only its side, so that there the agent does what it has learned nearer."""
    return 4.0 * np.tanh(0.5 * depth_error)


def _lift(mass: npt.NDArray[np.float64], length: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], ...]:
    """What stays as it is during a lift: mass, length, rate of the load's bobbing on the rope."""
    return (
        mass / 5.0e4 - 1.2,
        length / 1.0e3 - 0.8,
        0.25 * np.sqrt(_TYPICAL_STIFFNESS / (mass * length)) - 1.0,
    )


def _stacked(derived: tuple[npt.NDArray[np.float64], ...]) -> Float32Array:
    return np.asarray(np.clip(np.stack(derived, axis=1), -_LIMIT, _LIMIT), dtype=np.float32)
