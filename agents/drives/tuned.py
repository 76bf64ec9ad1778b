"""The paper's four drives, S-Ω1, S-Ω2, H-Ω1 and H-Ω2: families of drives, each tuned for an objective."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from aframe_env.scenario import Scenario
from agents.drives.optimisation import Family, ObjectiveName, OptimisedDrive, Optimiser, optimise


@dataclass(frozen=True)
class Tuned:
    """A family of drives, tuned for an objective."""

    family: Family
    objective: ObjectiveName


TUNED: Final[dict[str, Tuned]] = {
    "S-Ω1": Tuned("spline", "omega1"),
    "S-Ω2": Tuned("spline", "omega2"),
    "H-Ω1": Tuned("harmonic", "omega1"),
    "H-Ω2": Tuned("harmonic", "omega2"),
}
"""Tuned families, by the paper's names."""


def optimised(
    tuned: Tuned, duration: float, scenario: Scenario, optimiser: Optimiser = "nelder-mead"
) -> OptimisedDrive:
    """The drive for a scenario over ``duration`` s."""
    return optimise(tuned.family, scenario, tuned.objective, duration, optimiser=optimiser)
