"""The deck of a scenario over a stand-alone run of the full model."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from aframe_env.dynamics.motion import smooth_ramp
from aframe_env.dynamics.transforms import turn
from aframe_env.rfem.beam import Array
from aframe_env.scenario import Scenario
from aframe_env.scenario.motion import Coordinate, has_components, require_coverage


@dataclass(frozen=True, kw_only=True)
class DeckStates:
    """The deck at k times. Base frame = {D} at rest."""

    position: Array
    """Origin of {D}, (k, 3), m."""
    velocity: Array
    """(k, 3), m/s."""
    acceleration: Array
    """(k, 3), m/s²."""
    rotation: Array
    """{D} → base frame, (k, 3, 3), R_z R_y R_x of eq. (38)."""
    angular_velocity: Array
    """Along {D}, (k, 3), rad/s."""
    angular_acceleration: Array
    """Along {D}, (k, 3), rad/s²."""

    def every(self, stride: int) -> DeckStates:
        """Every ``stride``-th of them from the first."""
        return DeckStates(**{item.name: getattr(self, item.name)[::stride] for item in fields(self)})


def deck_coordinates(scenario: Scenario, step: float, count: int) -> Array:
    """The deck's six coordinates with the scenario's ramp, their rates and accelerations: (3, count, 6).

    A record's yaw builds up about its first.

    Args:
        scenario: Its motion and its ramp.
        step: Of the times 0, step, 2 step, ...; s.
        count: How many times.

    Raises:
        InvalidValue: The motion is a record that is too short.
    """
    times = step * np.arange(count, dtype=np.float64)
    if has_components(scenario.motion):
        motion = scenario.motion.components().at(times)
    else:
        require_coverage(scenario.motion, "duration", float(times[-1]))
        motion = scenario.motion.table(step)[:count].reshape(count, 3, 6).transpose(1, 0, 2)
    if not scenario.ramp:
        return motion
    place, rate, acceleration = motion
    r, dr, ddr = np.array([smooth_ramp(time, 1.0 / scenario.ramp, 0.0) for time in times.tolist()]).T[:, :, None]
    start = np.zeros(6)
    if not has_components(scenario.motion):
        start[Coordinate.YAW] = place[0, Coordinate.YAW]
    place = place - start
    return np.stack([start + r * place, r * rate + dr * place, r * acceleration + 2.0 * dr * rate + ddr * place])


def deck_states(coordinates: Array) -> DeckStates:
    """Pose, velocities and accelerations of a deck with these coordinates, rates and accelerations, (3, k, 6)."""
    place, speed, acceleration = coordinates[:, :, :3]
    angles = coordinates[:, :, 3:].transpose(1, 0, 2).reshape(-1, 9)
    rotation, turning, spin_up = zip(*(turn(*row) for row in angles.tolist()), strict=True)
    return DeckStates(
        position=place,
        velocity=speed,
        acceleration=acceleration,
        rotation=np.array(rotation).reshape(-1, 3, 3),
        angular_velocity=np.array(turning),
        angular_acceleration=np.array(spin_up),
    )
