"""What goes into an exported controller and what comes out: names, units, ranges, and the places in its tensors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import torch

from aframe_env.scenario.crane import Crane
from aframe_env.task import SENSED, STATE
from agents.learned.agent import AgentCard


@dataclass(frozen=True, kw_only=True)
class Field:
    """A quantity in one of the tensors."""

    name: str
    unit: str = ""
    shape: tuple[int, ...] = (1,)
    low: float = -math.inf
    high: float = math.inf

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.shape)


@dataclass(frozen=True)
class Tensor:
    """A tensor of one dimension in float64, with the quantities that lie in it one after the other."""

    name: str
    fields: tuple[Field, ...]

    @property
    def size(self) -> int:
        """Number of values."""
        return sum(field.size for field in self.fields)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the quantities."""
        return tuple(field.name for field in self.fields)

    def split(self, values: torch.Tensor) -> dict[str, torch.Tensor]:
        """The quantities by their names, each in its shape."""
        parts = torch.split(values, [field.size for field in self.fields])
        return {
            field.name: part if len(field.shape) == 1 else part.reshape(field.shape)
            for field, part in zip(self.fields, parts, strict=True)
        }

    def join(self, quantities: Mapping[str, torch.Tensor]) -> torch.Tensor:
        """The reverse of ``split``."""
        return torch.cat([quantities[field.name].flatten() for field in self.fields])

    def within(self, values: torch.Tensor) -> torch.Tensor:
        """True, as a tensor (1,), if every value is a number within its range."""
        low, high = (
            torch.tensor([getattr(field, end) for field in self.fields for _ in range(field.size)], dtype=torch.float64)
            for end in ("low", "high")
        )
        return ((values >= low) & (values <= high)).all(dim=0, keepdim=True)

    def described(self) -> dict[str, Any]:
        """Shape and quantities as plain values for JSON; a range without an end has null there."""
        start, quantities = 0, []
        for field in self.fields:
            ends = (end if math.isfinite(end) else None for end in (field.low, field.high))
            quantities.append(
                {"name": field.name, "unit": field.unit, "start": start, "shape": list(field.shape), "range": [*ends]}
            )
            start += field.size
        return {"name": self.name, "type": "float64", "shape": [self.size], "quantities": quantities}


_READ: Final = {
    "state": (
        "depth_error",
        "load_velocity_z",
        "pulley_heave",
        "pulley_velocity_z",
        "pulley_acceleration_z",
        "drum_speed",
        "rope_tension",
        "rope_length",
    ),
    "sensors": ("pulley_heave", "pulley_velocity_z", "drum_angle", "rope_tension", "depth_error"),
}
"""Quantities of each observation that its agents look at; the others are left out."""

_ROPE_LENGTH: Final = Field(name="rope_length", unit="m", low=1e-3, high=1e5)
_CRANE: Final = (
    Field(name="axial_stiffness", unit="N", low=1.0, high=1e12),
    Field(name="drum_radius", unit="m", low=1e-3, high=1e3),
    Field(name="max_speed", unit="rad/s", low=1e-6, high=1e3),
    Field(name="max_acceleration", unit="rad/s²", low=1e-6, high=1e6),
    Field(name="lag", unit="s", low=0.0, high=1e4),
)
DRUM_SPEED: Final = Tensor("drum_speed", (Field(name="drum_speed", unit="rad/s"),))
FAULT: Final = Tensor("fault", (Field(name="fault", low=0.0, high=1.0),))


def readings_of(card: AgentCard) -> Tensor:
    """What is measured at every step."""
    sensed = card.sensors is not None
    known = {quantity.name: quantity for quantity in (SENSED if sensed else STATE)}
    read = [known[name] for name in _READ["sensors" if sensed else "state"]]
    # A rope of no length, as nobody has it, is a reading that is missing.
    return Tensor(
        "readings",
        tuple(
            _ROPE_LENGTH if q.name == "rope_length" else Field(name=q.name, unit=q.unit, low=q.low, high=q.high)
            for q in read
        ),
    )


def told_of(card: AgentCard) -> Tensor:
    """What is told before a lift: the crane, and the rope's length where it is not read at every step."""
    return Tensor("told", (*((_ROPE_LENGTH,) if card.sensors is not None else ()), *_CRANE))


def crane_values(crane: Crane) -> dict[str, float]:
    """Values of the crane that are told."""
    winch = crane.winch
    return {
        "axial_stiffness": crane.rope.axial_stiffness,
        "drum_radius": winch.drum_radius,
        "max_speed": winch.max_speed,
        "max_acceleration": winch.max_acceleration,
        "lag": winch.lag,
    }
