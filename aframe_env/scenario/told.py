"""What the operator was told of a lift, apart from what is."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from aframe_env.scenario.crane import Crane
from aframe_env.scenario.water import LoadShape


@dataclass(frozen=True, kw_only=True)
class Told:
    """What the operator was told where it may not be what is; None: he was told the truth.

    The target's level and way are given, and the rope counter is an instrument: these are never told wrongly.
    """

    load_mass: float | None = None
    """m_L, kg."""
    load: LoadShape | None = None
    """What the water feels of the load."""
    axial_stiffness: float | None = None
    """E_R F_R of the rope, N."""
    mass_per_length: float | None = None
    """μ of the rope, kg/m."""
    lag: float | None = None
    """Time constant of the winch, s."""
    max_rope_speed: float | None = None
    """Speed limit of the winch, m/s of rope."""
    max_rope_acceleration: float | None = None
    """Acceleration limit of the winch, m/s² of rope."""
    sensor_delay: float | None = None
    """Time from a motion to its reading, s."""

    def of(self, true: Crane) -> Crane:
        """Return the crane as the operator was told it; ``true`` itself where nothing differs."""
        rope = self.differences(true.rope, "axial_stiffness", "mass_per_length")
        winch = self.differences(true.winch, "lag", "max_rope_speed", "max_rope_acceleration")
        if not (rope or winch):
            return true
        return replace(true, rope=replace(true.rope, **rope), winch=replace(true.winch, **winch))

    def differences(self, true: Any, *names: str) -> dict[str, Any]:
        """Return what was told of these fields of ``true`` and is not so."""
        told = {name: getattr(self, name) for name in names}
        return {name: value for name, value in told.items() if value not in (None, getattr(true, name))}
