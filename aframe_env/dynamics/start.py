"""Load and rope of a row at the start of an episode.

Plain functions of floats: the engine calls them as they are, once an episode; the rows on a GPU call them compiled.
"""

from __future__ import annotations

import math
from typing import Any, Final

from aframe_env.dynamics import layout as at

MAX_INNER_STEP: Final = 0.02
"""Longest inner step, s."""
INNER_STEP_PHASE: Final = 0.1
"""Greatest phase of the load's bobbing on the rope in one inner step, rad: RK4's phase error is then below 1e-6
of the angle turned."""
INNER_STEP_DECAY: Final = 1.0
"""Greatest decay of the load's bobbing by an overdamped rope in one inner step; RK4 is stable up to 2.78."""


def free_length(rope_length: float, drum_to_pulley: float, weight: float, axial_stiffness: float) -> float:
    """Unstretched length between drum and a load of ``weight`` N that hangs ``rope_length`` m below the pulley, m.

    ``drum_to_pulley`` in m, the rope's ``axial_stiffness`` E F in N.
    """
    return (rope_length + drum_to_pulley) / (1.0 + weight / axial_stiffness)


def critical_damping(stiffness: float, mass: float) -> float:
    """Damping [N s/m] at which ``mass`` kg no longer bobs on a rope of ``stiffness`` N/m."""
    return 2.0 * math.sqrt(stiffness * mass)


def longest_inner_step(rope_frequency: float, damping_rate: float) -> float:
    """Longest inner step [s] for a load that bobs on its rope at ``rope_frequency`` rad/s.

    ``damping_rate``: the rope's damping for each kilogram of load, 1/s; above five times critical it is what counts.
    """
    longest = min(MAX_INNER_STEP, INNER_STEP_PHASE / rope_frequency)
    return INNER_STEP_DECAY / damping_rate if damping_rate * longest > INNER_STEP_DECAY else longest


def inner_steps(segment: float, longest: float) -> int:
    """Equal inner steps that a motion segment of ``segment`` s is divided into, none longer than ``longest`` s."""
    return max(1, math.ceil(segment / longest - 1e-9))


def write_lift(
    row: Any,
    lanes: int,
    j: int,
    mass: float,
    target: float,
    rope_damping: float,
    length: float,
    least_length: float,
    most_length: float,
    substeps: int,
) -> None:
    """Write what depends on load and rope into lane j, whose crane is there already.

    ``mass`` in kg, ``target`` level in m, ``rope_damping`` in N s/m; unstretched ``length`` between drum and load, and
    its limits, in m; ``substeps`` inner steps in a motion segment.
    """
    radius, lag = row[at.DRUM_RADIUS * lanes + j], row[at.LAG * lanes + j]
    inner_step = row[at.CONTROL_PERIOD * lanes + j] / substeps
    row[at.MASS * lanes + j] = mass
    row[at.TARGET * lanes + j] = target
    row[at.ROPE_DAMPING * lanes + j] = rope_damping
    row[at.FREE_LENGTH * lanes + j] = length
    row[at.MIN_ANGLE * lanes + j] = (least_length - length) / radius
    row[at.MAX_ANGLE * lanes + j] = (most_length - length) / radius
    row[at.SUBSTEPS * lanes + j] = substeps
    row[at.INNER_STEP * lanes + j] = inner_step
    row[at.HALF_STEP_DECAY * lanes + j] = math.exp(-0.5 * inner_step / lag) if lag > 0.0 else 0.0


def hang_load(row: Any, lanes: int, j: int, comoving: bool) -> None:
    """Hang lane j's load under the pulley, where the pulley is at the start; at rest unless ``comoving`` with it."""
    for axis in range(3):
        row[(at.LOAD_POSITION + axis) * lanes + j] = row[(at.PULLEY + axis) * lanes + j]
        if comoving:
            row[(at.LOAD_VELOCITY + axis) * lanes + j] = row[(at.PULLEY + 3 + axis) * lanes + j]
    target = row[at.TARGET * lanes + j]
    row[(at.LOAD_POSITION + 2) * lanes + j] -= row[(at.PULLEY_ON_DECK + 2) * lanes + j] - target
    row[at.OMEGA2 * lanes + j] = abs(row[(at.LOAD_POSITION + 2) * lanes + j] - target)
