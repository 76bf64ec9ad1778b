"""Motion of the ship's deck: sums of harmonics, and the interface of every kind of ship motion.

The six coordinates of the deck frame {D} are in the order of ``Coordinate``: surge (x, outboard), sway (y),
heave (z, up) [m], roll, pitch, yaw [rad], ZYX Euler angles, eq. (38).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt
from typing_extensions import TypeIs

from aframe_env.validation import InvalidValue, require_choice, require_instance, require_number

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
FloatOrComplex = TypeVar("FloatOrComplex", FloatArray, ComplexArray)


class Coordinate(IntEnum):
    """The deck's coordinates."""

    SURGE = 0
    SWAY = 1
    HEAVE = 2
    ROLL = 3
    PITCH = 4
    YAW = 5


COORDINATES = tuple(c.name.lower() for c in Coordinate)


def point_heave(coordinates: FloatOrComplex, position: tuple[float, float, float]) -> FloatOrComplex:
    """Linear heave (K,) of a point at this ``position`` [m] along the deck's axes.

    Or its rate, for the deck's coordinates or their rates (K, 6).
    """
    x, y, _ = position
    return coordinates[:, Coordinate.HEAVE] + y * coordinates[:, Coordinate.ROLL] - x * coordinates[:, Coordinate.PITCH]


@dataclass(frozen=True)
class Components:
    """A motion as a sum of components: q_d(t) = Σ_k Re(response[k, d] · exp(i frequency[k] t))."""

    frequency: FloatArray
    """(K,) rad/s."""
    response: ComplexArray
    """(K, 6) complex amplitudes, m and rad, phases as at time 0."""

    def at(self, times: npt.ArrayLike) -> FloatArray:
        """Coordinates, rates and accelerations at ``times`` (T,) s: array (3, T, 6)."""
        t = np.atleast_1d(np.asarray(times, dtype=np.float64))
        phase = np.exp(1j * np.outer(t, self.frequency))
        factor = 1j * self.frequency[:, None]
        return np.stack(
            [
                (phase @ self.response).real,
                (phase @ (self.response * factor)).real,
                (phase @ (self.response * factor**2)).real,
            ]
        )


class ComponentMotion(Protocol):
    """A ship motion that is a sum of components."""

    def components(self) -> Components:
        """Return the components, phases as at time 0."""
        ...


class TabledMotion(Protocol):
    """A ship motion that is known on a table of times."""

    @property
    def duration(self) -> float:
        """Time over which the motion is known, s."""
        ...

    def table(self, period: float) -> FloatArray:
        """Coordinates, rates and accelerations every ``period`` s from time 0: (T, 18)."""
        ...


ShipMotion = ComponentMotion | TabledMotion


# Attributes, not isinstance: with a protocol that costs as much as the rest of a row's reset.
def has_components(motion: Any) -> TypeIs[ComponentMotion]:
    """Return whether a motion is a sum of components."""
    return callable(getattr(motion, "components", None))


def is_tabled(motion: Any) -> TypeIs[TabledMotion]:
    """Return whether a motion is known on a table of times."""
    return callable(getattr(motion, "table", None)) and hasattr(motion, "duration")


def require_coverage(motion: ShipMotion, name: str, duration: float) -> None:
    """Raise unless the motion is known for ``duration`` s, which the user calls ``name``."""
    known = getattr(motion, "duration", math.inf)
    if known < duration * (1.0 - 1e-9):
        record = getattr(motion, "origin", "the recorded motion")
        raise InvalidValue(f"{name} = {duration:g} s: must be in (0, {known:g}] s, the length of {record}")


@dataclass(frozen=True, kw_only=True)
class Harmonic:
    """One term amplitude · sin(2π t / period + phase) of one coordinate."""

    coordinate: str
    """One of surge, sway, heave, roll, pitch, yaw."""
    amplitude: float
    """m, or rad."""
    period: float
    """s."""
    phase: float = 0.0
    """rad."""

    def __post_init__(self) -> None:
        require_choice("coordinate", self.coordinate, COORDINATES)
        angular = self.coordinate in COORDINATES[3:]
        require_number(
            "amplitude",
            self.amplitude,
            "rad" if angular else "m",
            low=-math.pi if angular else -100.0,
            high=math.pi if angular else 100.0,
        )
        require_number("period", self.period, "s", low=1.0, high=1e6)
        require_number("phase", self.phase, "rad", low=-1e6, high=1e6)


@dataclass(frozen=True, kw_only=True)
class HarmonicMotion:
    """Any sum of harmonics for each coordinate; no harmonics: a ship at rest."""

    harmonics: tuple[Harmonic, ...] = ()

    def __post_init__(self) -> None:
        require_instance("harmonics", self.harmonics, tuple)
        for item in self.harmonics:
            require_instance("harmonics", item, Harmonic)

    @classmethod
    def paper(cls) -> HarmonicMotion:
        """Motion (42): surge of 1 m and 6 s, heave of 2 m and 12 s, both starting upwards from zero."""
        return cls(
            harmonics=(
                Harmonic(coordinate="surge", amplitude=1.0, period=6.0),
                Harmonic(coordinate="heave", amplitude=2.0, period=12.0),
            )
        )

    def components(self) -> Components:
        """Return one component for each harmonic."""
        frequency = np.array([2.0 * math.pi / item.period for item in self.harmonics])
        response = np.zeros((len(self.harmonics), 6), dtype=np.complex128)
        for k, item in enumerate(self.harmonics):
            # sin(x) = Re(-i exp(ix))
            response[k, COORDINATES.index(item.coordinate)] = (
                -1j * item.amplitude * complex(math.cos(item.phase), math.sin(item.phase))
            )
        return Components(frequency, response)
