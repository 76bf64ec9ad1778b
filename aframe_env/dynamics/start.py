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

SHORT_ROPE: Final = 100.0
"""Length below which a rope's own waves are too fast to matter, m: its first frequency is then right within 0.2 %."""
LIGHT_ROPE: Final = 1e-3
"""Mass of a rope, as a share of its load's, below which the same holds."""
CHAIN_PHASE: Final = 2.4
"""Greatest rate of a chain's fastest mode times the inner step; RK4 is stable up to some 2.6 in all directions."""


def free_length(rope_length: float, drum_to_pulley: float, weight: float, axial_stiffness: float) -> float:
    """Unstretched length between drum and a load of ``weight`` N that hangs ``rope_length`` m below the pulley, m.

    ``drum_to_pulley`` in m, the rope's ``axial_stiffness`` E F in N.
    """
    return (rope_length + drum_to_pulley) / (1.0 + weight / axial_stiffness)


def heavy_lengths(
    rope_length: float, drum_to_pulley: float, weight: float, axial_stiffness: float, rope_weight: float
) -> tuple[float, float]:
    """Unstretched lengths of a rope of ``rope_weight`` N/m, below the pulley and from there to the drum, m.

    The load's ``weight`` [N] hangs ``rope_length`` m below the pulley at rest; the strain grows with the rope above it.
    """
    softness = 1.0 / axial_stiffness
    stretched = 1.0 + weight * softness
    root = math.sqrt(stretched * stretched + 2.0 * rope_weight * softness * rope_length)
    below = 2.0 * rope_length / (stretched + root)
    return below, drum_to_pulley / (1.0 + (weight + rope_weight * below) * softness)


def springs_of_rope(below: float, mass_per_length: float, load_mass: float) -> int:
    """Springs of a rope with ``below`` m under the pulley, one more than its lumps.

    The lumps give its first two frequencies within 1 %, with loads of 20 t and more; no more of them where the inner
    step would have to be shorter for them. None, with a third of the rope's mass at the load, where the rope is short
    or light beside its load.
    """
    if below < SHORT_ROPE or mass_per_length * below < LIGHT_ROPE * load_mass:
        return 1
    if below < 190.0:
        return 7
    return 8 if below < 500.0 else at.SPRINGS_MOST


def radius_of_layer(length: float, height: float, turns: float, innermost: float, rope: float) -> float:
    """Radius [m] at which the rope runs off a drum from which ``length`` m have been paid out.

    Layers of ``turns`` turns each, the centre line of the ``innermost`` at that radius [m], each ``height`` m further
    out; ``rope`` m in all, the inner layers filled first.
    """
    radius, left = innermost, rope - length
    while left > 2.0 * math.pi * radius * turns:
        left -= 2.0 * math.pi * radius * turns
        radius += height
    return radius


def share_under_water(depth: float, height: float) -> float:
    """Share of a load under water, the middle of its ``height`` m being ``depth`` m deep; without height all of it."""
    return min(max(depth / height + 0.5, 0.0), 1.0) if height > 0.0 else 1.0


def longest_chain_step(
    element: float, mass_per_length: float, axial_stiffness: float, load_mass: float, loss_time: float
) -> float:
    """Longest inner step [s] with which RK4 is stable for a rope of elements of ``element`` m.

    ``load_mass`` with added mass, kg; ``loss_time`` of the rope's material, s. The chain's fastest mode is a little
    faster than 2 c / l_e, more so above a light load; damped beyond the critical it decays faster than it would swing.
    """
    mass = mass_per_length * element
    fastest = math.sqrt(axial_stiffness / element * (4.4 / mass + 2.0 / (load_mass + mass / 6.0)))
    over = 0.5 * loss_time * fastest
    rate = fastest * (over + math.sqrt(over * over - 1.0)) if over > 1.0 else fastest
    return CHAIN_PHASE / rate


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
    row[at.START_LENGTH * lanes + j] = length
    row[at.MIN_ANGLE * lanes + j] = (least_length - length) / radius
    row[at.MAX_ANGLE * lanes + j] = (most_length - length) / radius
    row[at.SUBSTEPS * lanes + j] = substeps
    row[at.INNER_STEP * lanes + j] = inner_step
    row[at.HALF_STEP_DECAY * lanes + j] = math.exp(-0.5 * inner_step / lag) if lag > 0.0 else 0.0


def write_heavy(
    row: Any,
    lanes: int,
    j: int,
    springs: int,
    drum_part: float,
    rope: tuple[float, float, float, float],
    inertia: tuple[float, float],
    weight: float,
    drag: tuple[float, float],
    across_drag: float,
) -> None:
    """Write what a rope with mass and its load need beside ``write_lift`` into lane j; in deep water, if in any.

    ``springs`` of the rope; ``drum_part`` unstretched from drum to pulley, m; ``rope``: mass kg/m, weight N/m, drag
    N s²/m³, loss time s; the load's ``inertia`` [kg], ``weight`` [N] and ``drag`` [N s²/m²], horizontal and vertical;
    ``across_drag`` of the rope, N s²/m³.
    """
    below = row[at.FREE_LENGTH * lanes + j] - drum_part
    half_weight = 0.5 * rope[1] * below if springs == 1 else 0.0
    third = rope[0] * below / 3.0 if springs == 1 else 0.0
    row[at.SPRINGS * lanes + j] = springs
    row[at.DRUM_PART * lanes + j] = drum_part
    row[at.ROPE_MASS * lanes + j] = rope[0]
    row[at.ROPE_WEIGHT * lanes + j] = rope[1]
    row[at.ROPE_DRAG * lanes + j] = rope[2]
    row[at.LOSS_TIME * lanes + j] = rope[3]
    row[at.HALF_WEIGHT * lanes + j] = half_weight
    row[at.LOAD_INERTIA * lanes + j] = inertia[0] + third
    row[(at.LOAD_INERTIA + 1) * lanes + j] = inertia[1] + third
    row[at.LOAD_WEIGHT * lanes + j] = weight + half_weight
    row[at.LOAD_DRAG * lanes + j] = drag[0]
    row[(at.LOAD_DRAG + 1) * lanes + j] = drag[1]
    row[at.ACROSS_DRAG * lanes + j] = across_drag


def hang_rope(row: Any, lanes: int, j: int, comoving: bool) -> None:
    """Hang the lumps of lane j's rope where they are at rest; they move with the pulley if ``comoving``."""
    lumps = int(row[at.SPRINGS * lanes + j]) - 1
    if lumps < 1:
        return
    drum_part, softness = row[at.DRUM_PART * lanes + j], 1.0 / row[at.AXIAL_STIFFNESS * lanes + j]
    element = (row[at.FREE_LENGTH * lanes + j] - drum_part) / lumps
    place, length = -row[at.DRUM_TO_PULLEY * lanes + j], drum_part + 0.5 * element
    for i in range(lumps, 0, -1):
        force = row[at.LOAD_WEIGHT * lanes + j] + i * row[at.ROPE_WEIGHT * lanes + j] * element
        place += length * (1.0 + force * softness)
        length = element
        row[(at.LIFT + i) * lanes + j] = place
        if comoving:
            row[(at.LIFT + at.SPRINGS_MOST + i) * lanes + j] = -row[(at.PULLEY + 5) * lanes + j]


def hang_load(row: Any, lanes: int, j: int, comoving: bool) -> None:
    """Hang lane j's load under the pulley, where the pulley is at the start; at rest unless ``comoving`` with it."""
    for axis in range(3):
        row[(at.LOAD_POSITION + axis) * lanes + j] = row[(at.PULLEY + axis) * lanes + j]
        if comoving:
            row[(at.LOAD_VELOCITY + axis) * lanes + j] = row[(at.PULLEY + 3 + axis) * lanes + j]
    target = row[at.TARGET * lanes + j]
    row[(at.LOAD_POSITION + 2) * lanes + j] -= row[(at.PULLEY_ON_DECK + 2) * lanes + j] - target
    row[at.OMEGA2 * lanes + j] = abs(row[(at.LOAD_POSITION + 2) * lanes + j] - target)
