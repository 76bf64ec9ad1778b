"""What is known on board of a lift before it begins, and what its weight leaves unsaid with a heavy rope in water.

The load is weighed: at rest the tension at the pulley is W + w L, the submerged weight of load and rope. What bobs on
the rope is m + m_a + μ L / 3, which differs from the mass that would weigh as much in air by what the data of rope,
water and load's shape tell, whatever the load's mass. Both are the paper's m g and m for a light rope in air.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple, Protocol

from aframe_env.scenario.crane import Crane
from aframe_env.scenario.water import LoadShape, Water

LEAST_WEIGHT: Final = 1.0
"""Least weight of a load, N: a reading of nothing stands for that."""


class Lift(Protocol):
    """Crane, water and load's shape, as a scenario has them."""

    @property
    def crane(self) -> Crane:
        """The crane with its rope."""
        ...

    @property
    def water(self) -> Water | None:
        """The water; None for air."""
        ...

    @property
    def load(self) -> LoadShape:
        """What the water feels of the load."""
        ...


class Unweighed(NamedTuple):
    """Mass that bobs on the rope beyond that which its tension at rest would weigh in air, and the rope's strain."""

    fixed: float
    """ρ V + m_a, kg, of a load that is all under water."""
    by_length: float
    """μ / 3 - w / g for each metre of rope below the pulley, kg/m."""
    drum_part: float
    """Rope between drum and pulley, m."""
    softness: float
    """Strain at the pulley for each newton of tension at rest, 1/N; 0 for a light rope in air, whose strain the laws
    have never reckoned with."""
    slowness: float
    """√(μ / E F), time of a wave for each metre of rope, s/m."""


def share_under_water(lift: Lift, level: float) -> float:
    """Share of the load that is under still water at a level [m].

    1 without water, which carries nothing then.
    """
    if lift.water is None:
        return 1.0
    return lift.load.share_under_water(lift.water.surface_level - level)


def unweighed(lift: Lift) -> Unweighed:
    """What the tension at rest leaves unsaid of a lift."""
    rope, water, load = lift.crane.rope, lift.water, lift.load
    if water is None and not rope.mass_per_length:
        return Unweighed(0.0, 0.0, 0.0, 0.0, 0.0)
    density = 0.0 if water is None else water.density
    by_length = rope.mass_per_length / 3.0 - rope.weight_per_length(1.0, density) if rope.mass_per_length else 0.0
    return Unweighed(
        fixed=density * load.volume + load.added_mass_vertical,
        by_length=by_length,
        drum_part=lift.crane.drum_to_pulley,
        softness=1.0 / rope.axial_stiffness,
        slowness=math.sqrt(rope.mass_per_length / rope.axial_stiffness),
    )
