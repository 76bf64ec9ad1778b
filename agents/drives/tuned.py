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


INTERVALS: Final = 96
"""Intervals of a spline that is optimised for one scenario under the winch's limits."""
HARMONICS: Final = 16
"""Harmonics of a pseudo-harmonic drive that is optimised so."""
EVALUATIONS: Final = 2_000
"""Most evaluations for such a drive."""


def optimised(
    tuned: Tuned, duration: float, scenario: Scenario, optimiser: Optimiser = "nelder-mead"
) -> OptimisedDrive:
    """The drive for a scenario over ``duration`` s, which the drum follows exactly."""
    return optimise(tuned.family, scenario, tuned.objective, duration, optimiser=optimiser)


def optimised_as_played(
    tuned: Tuned, duration: float, control_period: float, optimiser: Optimiser, scenario: Scenario
) -> OptimisedDrive:
    """The drive for a scenario over ``duration`` s under the winch's limits, with all the variables that pay."""
    return optimise(
        tuned.family,
        scenario,
        tuned.objective,
        duration,
        INTERVALS,
        HARMONICS,
        max_evaluations=EVALUATIONS,
        optimiser=optimiser,
        control_period=control_period,
    )
