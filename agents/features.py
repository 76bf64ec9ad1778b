"""From an observation in physical units to the inputs of a network: numbers of order one, nothing added.

Each feature is a fixed function of the observation, so that an agent needs no running statistics and means the same
on every crane and in every sea.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.crane import GRAVITY
from aframe_env.task import SENSED, STATE, Quantity
from aframe_env.validation import InvalidValue

Float32Array = npt.NDArray[np.float32]

_TYPICAL_STIFFNESS = 2.0e8  # N, turns tension into stretch: a scale, not a claim about the crane at hand


def feature_names(quantities: tuple[Quantity, ...]) -> tuple[str, ...]:
    """Names of the features of an observation with these quantities."""
    if quantities == STATE:
        return (
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
    if quantities == SENSED:
        return (
            "depth_error",
            "load_acceleration_z",
            "pulley_velocity_z",
            "drum_speed",
            "stretch_deviation",
            "pulley_heave",
            "roll",
            "pitch",
            "load_mass",
            "rope_length",
            "bobbing_rate",
        )
    raise InvalidValue(f"no features for an observation of {[q.name for q in quantities]}")


def features(observation: npt.NDArray[np.float32], quantities: tuple[Quantity, ...]) -> Float32Array:
    """Features (N, F) of observations (N, K)."""
    o = observation.astype(np.float64)
    column = {q.name: o[:, i] for i, q in enumerate(quantities)}
    mass, length = column["load_mass"], column["rope_length"]
    excess = column["rope_tension"] / (mass * GRAVITY) - 1.0
    derived = {
        # Beyond some metres only the side: there the agent does what it has learned nearer.
        "depth_error": 4.0 * np.tanh(0.5 * column["depth_error"]),
        "load_velocity_z": 2.0 * column["load_velocity_z"] if "load_velocity_z" in column else None,
        "load_acceleration_z": 4.0 * excess,
        "pulley_velocity_z": column["pulley_velocity_z"],
        "pulley_acceleration_z": column.get("pulley_acceleration_z"),
        "drum_speed": 0.75 * column["drum_speed"],
        "stretch_deviation": 4.0 * excess * mass * GRAVITY * length / _TYPICAL_STIFFNESS,
        "pulley_heave": 0.5 * column["pulley_heave"],
        "roll": 10.0 * column["roll"] if "roll" in column else None,
        "pitch": 20.0 * column["pitch"] if "pitch" in column else None,
        "load_mass": mass / 5.0e4 - 1.2,
        "rope_length": length / 1.0e3 - 0.8,
        "bobbing_rate": 0.25 * np.sqrt(_TYPICAL_STIFFNESS / (mass * length)) - 1.0,
    }
    stack = np.stack([np.asarray(derived[name]) for name in feature_names(quantities)], axis=1)
    return np.asarray(np.clip(stack, -20.0, 20.0), dtype=np.float32)
