"""The task, apart from the physics: what is observed, what it costs, when it ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel, scalar
from aframe_env.dynamics.flexible import readout
from aframe_env.scenario.sensors import CHANNELS, Sensors

FloatArray = npt.NDArray[np.float64]

Observation = Literal["state", "sensors"] | Sensors


@dataclass(frozen=True)
class Quantity:
    """One entry of the observation."""

    name: str
    unit: str
    low: float
    high: float


STATE: Final = (
    Quantity("depth_error", "m", -1e3, 1e3),
    Quantity("load_velocity_z", "m/s", -100.0, 100.0),
    Quantity("load_offset_x", "m", -1e3, 1e3),
    Quantity("load_offset_y", "m", -1e3, 1e3),
    Quantity("load_velocity_x", "m/s", -100.0, 100.0),
    Quantity("load_velocity_y", "m/s", -100.0, 100.0),
    Quantity("pulley_heave", "m", -100.0, 100.0),
    Quantity("pulley_velocity_z", "m/s", -100.0, 100.0),
    Quantity("pulley_acceleration_z", "m/s²", -100.0, 100.0),
    Quantity("drum_angle", "rad", -1e5, 1e5),
    Quantity("drum_speed", "rad/s", -1e3, 1e3),
    Quantity("rope_tension", "N", 0.0, 1e8),
    Quantity("load_mass", "kg", 0.0, 1e7),
    Quantity("rope_length", "m", 0.0, 1e5),
)
"""Observation "state". Order and ranges; a value beyond its range is clipped to it."""
(
    DEPTH_ERROR,
    LOAD_VELOCITY_Z,
    LOAD_OFFSET_X,
    LOAD_OFFSET_Y,
    LOAD_VELOCITY_X,
    LOAD_VELOCITY_Y,
    PULLEY_HEAVE,
    PULLEY_VELOCITY_Z,
    PULLEY_ACCELERATION_Z,
    DRUM_ANGLE,
    DRUM_SPEED,
    ROPE_TENSION,
    LOAD_MASS,
    ROPE_LENGTH,
) = range(len(STATE))
# The columns of STATE, in its order.

_RANGES: Final = {
    "heave": Quantity("pulley_heave", "m", -100.0, 100.0),
    "heave_rate": Quantity("pulley_velocity_z", "m/s", -100.0, 100.0),
    "roll": Quantity("roll", "rad", -math.pi, math.pi),
    "pitch": Quantity("pitch", "rad", -math.pi, math.pi),
    "drum_angle": Quantity("drum_angle", "rad", -1e5, 1e5),
    "drum_speed": Quantity("drum_speed", "rad/s", -1e3, 1e3),
    "tension": Quantity("rope_tension", "N", -1e8, 1e8),
    "depth_error": Quantity("depth_error", "m", -1e3, 1e3),
}
SENSED: Final = (
    *(_RANGES[name] for name in CHANNELS),
    Quantity("load_mass", "kg", 0.0, 1e7),
    Quantity("rope_length", "m", 0.0, 1e5),
)
"""Observation "sensors": the readings, and what the operator knows of the lift before it begins. A preview comes after
them."""


def quantities(sensors: Sensors | None) -> tuple[Quantity, ...]:
    """Quantities that are observed with these sensors; None: of the full state."""
    if sensors is None:
        return STATE
    leads = () if sensors.preview is None else sensors.preview.leads
    return (*SENSED, *(Quantity(f"pulley_heave_in_{lead:g}_s", "m", -100.0, 100.0) for lead in leads))


# Columns of the results: what a step reports beside the observation, in double precision.
TIME, LOAD, TENSION, SLACK, OMEGA1, OMEGA2, COST, PARTED = 0, 1, 4, 5, 6, 7, 8, 9
LOAD_TENSION, TARGET, CONTACT, LANDINGS, LIFT_OFFS, LANDING_SPEED = 10, 11, 12, 13, 14, 15
PULLEY, LUFFING_ANGLE = 16, 19
DRIVE_TORQUE, DRIVE_POWER = 20, 21
RESULTS: Final = 22


def box(quantities: tuple[Quantity, ...]) -> spaces.Box:
    """Return the space of an observation."""
    return spaces.Box(
        np.array([q.low for q in quantities], dtype=np.float32),
        np.array([q.high for q in quantities], dtype=np.float32),
        dtype=np.float32,
    )


LEAST_FALL: Final = 10.0
"""Shortest fall of a lost load that is charged for, s: 13 000 m² s or more, whatever the load was doing."""


@scalar
def free_fall_cost(error: float, velocity: float, gravity: float, duration: float) -> float:
    """∫ (e + v τ - g τ²/2)² dτ over ``duration``, m² s: the cost of a load that falls freely."""
    t = duration
    return t * (
        error * error
        + t
        * (
            error * velocity
            + t
            * (
                (velocity * velocity - error * gravity) / 3.0
                + t * (-0.25 * velocity * gravity + t * 0.05 * gravity * gravity)
            )
        )
    )


@scalar
def free_fall_peak(error: float, velocity: float, gravity: float, duration: float) -> float:
    """Greatest \\|e + v τ - g τ²/2\\| over ``duration``, m."""
    rise = velocity / gravity
    rise = 0.0 if rise < 0.0 else (duration if rise > duration else rise)
    top = abs(error + velocity * rise - 0.5 * gravity * rise * rise)
    end = abs(error + velocity * duration - 0.5 * gravity * duration * duration)
    return max(abs(error), top, end)


@scalar
def charge_parted(row: Any, episode_duration: float, lanes: int, j: int) -> None:
    """Charge a row whose rope has parted with the free fall of its load, once.

    The fall lasts until the episode's end and at least LEAST_FALL: the return is -Ω1 of all that time, and to lose
    the load is never the cheaper way out, not even at the end.
    """
    if row[at.PARTED * lanes + j] == 1.0 and row[at.CHARGED * lanes + j] == 0.0:
        row[at.CHARGED * lanes + j] = 1.0
        left = episode_duration - row[at.TIME * lanes + j]
        left = left if left > LEAST_FALL else LEAST_FALL
        error = row[(at.LOAD_POSITION + 2) * lanes + j] - row[at.TARGET * lanes + j]
        velocity = row[(at.LOAD_VELOCITY + 2) * lanes + j]
        gravity = row[at.GRAVITY * lanes + j]
        cost = free_fall_cost(error, velocity, gravity, left)
        row[at.STEP_COST * lanes + j] += cost
        row[at.OMEGA1 * lanes + j] += cost
        peak = free_fall_peak(error, velocity, gravity, left)
        if peak > row[at.OMEGA2 * lanes + j]:
            row[at.OMEGA2 * lanes + j] = peak


@scalar
def read_out(row: Any, lanes: int, j: int, state: Any, results: Any, i: int) -> None:
    """Copy what is known of lane j into line i of state (N, 14) and results (N, RESULTS)."""
    state[i, DEPTH_ERROR] = row[(at.LOAD_POSITION + 2) * lanes + j] - row[at.TARGET * lanes + j]
    state[i, LOAD_VELOCITY_Z] = row[(at.LOAD_VELOCITY + 2) * lanes + j]
    state[i, LOAD_OFFSET_X] = row[at.LOAD_POSITION * lanes + j] - row[at.PULLEY * lanes + j]
    state[i, LOAD_OFFSET_Y] = row[(at.LOAD_POSITION + 1) * lanes + j] - row[(at.PULLEY + 1) * lanes + j]
    state[i, LOAD_VELOCITY_X] = row[at.LOAD_VELOCITY * lanes + j]
    state[i, LOAD_VELOCITY_Y] = row[(at.LOAD_VELOCITY + 1) * lanes + j]
    state[i, PULLEY_HEAVE] = row[(at.PULLEY + 2) * lanes + j] - row[(at.PULLEY_ON_DECK + 2) * lanes + j]
    state[i, PULLEY_VELOCITY_Z] = row[(at.PULLEY + 5) * lanes + j]
    state[i, PULLEY_ACCELERATION_Z] = row[(at.PULLEY + 8) * lanes + j]
    state[i, DRUM_ANGLE] = row[at.DRUM_ANGLE * lanes + j]
    state[i, DRUM_SPEED] = row[at.DRUM_SPEED * lanes + j]
    state[i, ROPE_TENSION] = row[at.TENSION * lanes + j]
    state[i, LOAD_MASS] = row[at.MASS * lanes + j]
    state[i, ROPE_LENGTH] = (
        row[at.FREE_LENGTH * lanes + j] + row[at.DRUM_RADIUS * lanes + j] * row[at.DRUM_ANGLE * lanes + j]
    )
    results[i, TIME] = row[at.TIME * lanes + j]
    for k in range(3):
        results[i, LOAD + k] = row[(at.LOAD_POSITION + k) * lanes + j]
    results[i, TENSION] = row[at.TENSION * lanes + j]
    results[i, SLACK] = row[at.SLACK * lanes + j]
    results[i, OMEGA1] = row[at.OMEGA1 * lanes + j]
    results[i, OMEGA2] = row[at.OMEGA2 * lanes + j]
    results[i, COST] = row[at.STEP_COST * lanes + j]
    results[i, PARTED] = row[at.PARTED * lanes + j]
    # A rope without mass pulls at its load as at the pulley.
    plain = row[at.SPRINGS * lanes + j] == 0.0
    results[i, LOAD_TENSION] = row[at.TENSION * lanes + j] if plain else row[at.LOAD_TENSION * lanes + j]
    results[i, TARGET] = row[at.TARGET * lanes + j]
    results[i, CONTACT] = row[at.CONTACT * lanes + j]
    results[i, LANDINGS] = row[at.LANDINGS * lanes + j]
    results[i, LIFT_OFFS] = row[at.LIFT_OFFS * lanes + j]
    results[i, LANDING_SPEED] = row[at.LANDING_SPEED * lanes + j]
    for k in range(3):
        results[i, PULLEY + k] = row[(at.PULLEY + k) * lanes + j]
    results[i, LUFFING_ANGLE] = row[at.LUFFING_ANGLE * lanes + j]
    results[i, DRIVE_TORQUE] = row[at.DRIVE_TORQUE * lanes + j]
    results[i, DRIVE_POWER] = row[at.DRIVE_POWER * lanes + j]


@cache
def report_kernel(lanes: int) -> Callable[..., None]:
    """Kernel (blocks, episode duration, rows (n,), state (N, 14), results (N, RESULTS)) that reads rows out."""

    @kernel
    def report(blocks, episode_duration, rows, state, results):  # type: ignore[no-untyped-def]
        for i in rows:
            charge_parted(blocks[i // lanes], episode_duration, lanes, i % lanes)
            read_out(blocks[i // lanes], lanes, i % lanes, state, results, i)

    return report


@scalar
def clip_row(values: Any, low: Any, high: Any, observation: Any, i: int) -> None:
    """Round line i of values (N, K) float64 into an observation (N, K) float32, within low and high (K,) float32."""
    for k in range(values.shape[1]):
        value = np.float32(values[i, k])
        value = low[k] if value < low[k] else value
        observation[i, k] = high[k] if value > high[k] else value


@kernel
def clip(values: Any, low: Any, high: Any, observation: Any) -> None:
    """Round values (N, K) float64 into an observation (N, K) float32, within low and high (K,) float32."""
    for i in range(values.shape[0]):
        clip_row(values, low, high, observation, i)


def info(results: FloatArray, frames: FloatArray | None) -> dict[str, npt.NDArray[Any]]:
    """Information of an environment's rows, each value (N, ...).

    ``results`` (N, RESULTS); ``frames`` (N, READOUTS), or None on the simplified model.
    """
    found: dict[str, npt.NDArray[Any]] = {
        "time": results[:, TIME],
        "load_position": results[:, LOAD : LOAD + 3],
        "rope_tension": results[:, TENSION],
        "slack": results[:, SLACK] > 0.0,
        "omega1": results[:, OMEGA1],
        "omega2": results[:, OMEGA2],
        "load_tension": results[:, LOAD_TENSION],
        "target_level": results[:, TARGET],
        "contact_force": results[:, CONTACT],
        "landings": results[:, LANDINGS].astype(np.int64),
        "lift_offs": results[:, LIFT_OFFS].astype(np.int64),
        "landing_speed": results[:, LANDING_SPEED],
        "pulley_position": results[:, PULLEY : PULLEY + 3],
        "luffing_angle": results[:, LUFFING_ANGLE],
        "drive_torque": results[:, DRIVE_TORQUE],
        "drive_power": results[:, DRIVE_POWER],
    }
    if frames is not None:
        found |= {
            "pulley_deflection": frames[:, readout.DEFLECTION : readout.DEFLECTION + 3],
            "foot_reactions": frames[:, readout.FEET : readout.FEET + 6].reshape(-1, 2, 3),
            "servomotor_tensions": frames[:, readout.SERVOMOTORS : readout.SERVOMOTORS + 2],
            "utilisation": frames[:, readout.UTILISATION],
        }
    return found


def sensed_truth(state: FloatArray, angles: FloatArray) -> FloatArray:
    """True values of the sensors' channels, from the state (N, 14) and roll and pitch (N, 2): (N, channels)."""
    columns = (
        state[:, PULLEY_HEAVE],
        state[:, PULLEY_VELOCITY_Z],
        angles[:, 0],
        angles[:, 1],
        state[:, DRUM_ANGLE],
        state[:, DRUM_SPEED],
        state[:, ROPE_TENSION],
        state[:, DEPTH_ERROR],
    )
    return np.stack(columns, axis=1)
