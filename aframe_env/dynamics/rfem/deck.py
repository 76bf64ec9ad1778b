"""Motion of the deck as the full model's stand-alone runs take it: a sum of harmonics in six directions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from aframe_env.dynamics.rfem.beam import Array
from aframe_env.validation import require_choice, require_number

DIRECTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")


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


class DeckMotion(Protocol):
    """Whatever knows where the deck is."""

    def states(self, times: Array) -> DeckStates:
        """Return the deck's states at ``times``, (k,), s."""
        ...


@dataclass(frozen=True, kw_only=True)
class DeckHarmonic:
    """amplitude · sin(2π t / period + phase) in one direction."""

    direction: str
    """surge, sway, heave (m), roll, pitch or yaw (rad)."""
    amplitude: float
    """m or rad."""
    period: float
    """s, above 0."""
    phase: float = 0.0
    """rad."""

    def __post_init__(self) -> None:
        require_choice("direction", self.direction, DIRECTIONS)
        require_number("amplitude", self.amplitude, "m or rad")
        require_number("period", self.period, "s", low=0.0, low_open=True)
        require_number("phase", self.phase, "rad")


@dataclass(frozen=True)
class HarmonicDeck:
    """Sum of harmonics; without any, the deck is at rest."""

    components: tuple[DeckHarmonic, ...] = ()

    def states(self, times: Array) -> DeckStates:
        """Return the deck's states at ``times``, (k,), s."""
        values = np.zeros((3, 6, times.size))
        for item in self.components:
            row, rate = DIRECTIONS.index(item.direction), 2.0 * math.pi / item.period
            angle = rate * times + item.phase
            values[0, row] += item.amplitude * np.sin(angle)
            values[1, row] += item.amplitude * rate * np.cos(angle)
            values[2, row] -= item.amplitude * rate**2 * np.sin(angle)
        place, speed, acceleration = values[:, :3].transpose(0, 2, 1)
        rotation, turning, spin_up = _euler(*values[:, 3:])
        return DeckStates(
            position=place,
            velocity=speed,
            acceleration=acceleration,
            rotation=rotation,
            angular_velocity=turning,
            angular_acceleration=spin_up,
        )


def _euler(angles: Array, rates: Array, seconds: Array) -> tuple[Array, Array, Array]:
    """Rotation matrix, angular velocity and acceleration along {D} of roll, pitch, yaw, each (3, k)."""
    (roll, pitch, yaw), (p, q, r), (pp, qq, rr) = angles, rates, seconds
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    ).transpose(2, 0, 1)
    velocity = np.array([p - r * sp, q * cr + r * cp * sr, -q * sr + r * cp * cr]).T
    acceleration = np.array(
        [
            pp - rr * sp - r * cp * q,
            qq * cr - q * sr * p + rr * cp * sr - r * sp * q * sr + r * cp * cr * p,
            -qq * sr - q * cr * p + rr * cp * cr - r * sp * q * cr - r * cp * sr * p,
        ]
    ).T
    return rotation, velocity, acceleration


def paper_motion() -> HarmonicDeck:
    """Ship motion (42): surge 1 m with a period of 6 s, heave 2 m with a period of 12 s, both sines."""
    return HarmonicDeck(
        (
            DeckHarmonic(direction="surge", amplitude=1.0, period=6.0),
            DeckHarmonic(direction="heave", amplitude=2.0, period=12.0),
        )
    )
