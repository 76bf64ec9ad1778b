"""The load at the rope's end: weight and buoyancy, the water's drag and pushes, its surface, and the seabed."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.blocks import three
from aframe_env.dynamics.compiling import fma, larger, scalar, select, smaller
from aframe_env.dynamics.lift import (
    COST,
    END_ACCELERATION,
    END_TARGET,
    GROUND,
    LOAD_SHARE,
    PEAK,
    POSITION,
    SLACKEST,
    VELOCITY,
    Line,
    Pull,
    Rope,
    advance_slot,
)
from aframe_env.dynamics.vector import Vector, add, along, difference, inner

Array = npt.NDArray[np.float64]


@scalar
def pull_load(
    row: Array,
    source: int,
    target: int,
    end: int,
    fraction: float,
    weight: float,
    lanes: int,
    j: int,
    line: Line,
    rope: Rope,
    pull: Pull,
) -> None:
    """Accelerate the load by the rope's lowest spring, by weight, water and ground, and by the rope's turning."""
    axis, turn = line.axis, line.turn
    velocity = three(row, source + VELOCITY, lanes, j)
    bare = rope.springs == 1.0
    element = select(bare, 0.0, rope.element)
    rope_mass, rope_weight = row[at.ROPE_MASS * lanes + j] * element, rope.weight * element
    # What the rope's lumps, held on the line, hand on to the load by the lever rule.
    squared = pull.mass_lever_squared
    carried = rope_mass * (squared - pull.mass_lever)
    spun = -2.0 * rope_mass * pull.mass_lever_rate
    pulley = three(row, end + END_ACCELERATION, lanes, j)
    handed = Vector(
        fma(carried, pulley.x, spun * turn.x),
        fma(carried, pulley.y, spun * turn.y),
        fma(carried, pulley.z, spun * turn.z) - rope_weight * pull.lever,
    )
    handed = add(handed, three(row, at.PUSH, lanes, j))
    bottom = pull.bottom
    along_line = -bottom - inner(axis, handed)
    moment = row[at.MOMENT * lanes + j]
    whirl = three(row, at.FLOW_RATE, lanes, j)
    flow = difference(velocity, along(three(row, at.FLOW, lanes, j), moment, whirl))
    level, rising = row[at.SURFACE * lanes + j], row[(at.SURFACE + 1) * lanes + j]
    above = row[(source + POSITION + 2) * lanes + j] - fma(rising, moment, level)
    inverse_height = row[at.INVERSE_HEIGHT * lanes + j]
    wet = select(inverse_height > 0.0, smaller(larger(fma(-above, inverse_height, 0.5), 0.0), 1.0), 1.0)
    dry = 1.0 - wet
    # Through the surface: at rest the load's own speed, in waves that against the surface's.
    surge = rising - velocity.z
    slam = select(surge > 0.0, row[at.SLAM * lanes + j], row[(at.SLAM + 1) * lanes + j])
    slam = select((wet > 0.0) & (wet < 1.0), slam * abs(surge) * surge, 0.0)
    across = wet * row[at.LOAD_DRAG * lanes + j] * math.sqrt(fma(flow.x, flow.x, flow.y * flow.y))
    down = wet * row[(at.LOAD_DRAG + 1) * lanes + j] * abs(flow.z)
    added, added_z = row[at.ADDED_MASS * lanes + j], row[(at.ADDED_MASS + 1) * lanes + j]
    displaced = row[at.DISPLACED * lanes + j]
    moved, moved_z = wet * (displaced + added), wet * (displaced + added_z)
    weight_there = fma(
        row[at.START_SHARE * lanes + j] - wet, row[at.BUOYANCY * lanes + j], row[at.LOAD_WEIGHT * lanes + j]
    )
    sunk = row[at.BED * lanes + j] - (row[(source + POSITION + 2) * lanes + j] - row[at.HALF_HEIGHT * lanes + j])
    resting = sunk > 0.0
    damping = row[(at.BED + 2) * lanes + j]
    ground = larger(fma(row[(at.BED + 1) * lanes + j], sunk, -damping * velocity.z), 0.0)
    ground, stuck = select(resting, ground, 0.0), select(resting, damping, 0.0)
    row[(at.STAGE + GROUND) * lanes + j] = larger(row[(at.STAGE + GROUND) * lanes + j], ground)
    force = Vector(
        fma(along_line, axis.x, fma(-across, flow.x, fma(moved, whirl.x, fma(-stuck, velocity.x, handed.x)))),
        fma(along_line, axis.y, fma(-across, flow.y, fma(moved, whirl.y, fma(-stuck, velocity.y, handed.y)))),
        fma(along_line, axis.z, fma(-down, flow.z, fma(moved_z, whirl.z, handed.z))) + slam + ground - weight_there,
    )
    # (D + J (1 - e eᵀ)) a = force, with D diagonal: Sherman and Morrison's formula.
    turned = rope_mass * squared
    own = fma(LOAD_SHARE, rope_mass, turned)
    inverse = 1.0 / (fma(-dry, added, row[at.LOAD_INERTIA * lanes + j]) + own)
    inverse_z = 1.0 / (fma(-dry, added_z, row[(at.LOAD_INERTIA + 1) * lanes + j]) + own)
    eased = Vector(inverse * axis.x, inverse * axis.y, inverse_z * axis.z)
    more = turned * inner(eased, force) / (1.0 - turned * inner(eased, axis))
    acceleration = Vector(
        fma(more, eased.x, inverse * force.x),
        fma(more, eased.y, inverse * force.y),
        fma(more, eased.z, inverse_z * force.z),
    )
    intact, half_weight = 1.0 - row[at.PARTED * lanes + j], row[at.HALF_WEIGHT * lanes + j]
    below = fma(intact, half_weight, pull.tension)
    tension = rope.slide * below
    row[at.TENSION * lanes + j] = tension
    carried_too = LOAD_SHARE * rope_mass * inner(axis, acceleration)
    row[at.LOAD_TENSION * lanes + j] = larger(bottom - half_weight + carried_too, 0.0)
    row[(at.STAGE + PEAK) * lanes + j] = larger(row[(at.STAGE + PEAK) * lanes + j], tension)
    slackest = row[(at.STAGE + SLACKEST) * lanes + j]
    row[(at.STAGE + SLACKEST) * lanes + j] = smaller(slackest, pull.least)
    error = row[(source + POSITION + 2) * lanes + j] - row[(end + END_TARGET) * lanes + j]
    row[(at.STAGE + COST) * lanes + j] = fma(weight, error * error, row[(at.STAGE + COST) * lanes + j])
    advance_slot(row, POSITION, velocity.x, source, target, fraction, weight, lanes, j)
    advance_slot(row, POSITION + 1, velocity.y, source, target, fraction, weight, lanes, j)
    advance_slot(row, POSITION + 2, velocity.z, source, target, fraction, weight, lanes, j)
    advance_slot(row, VELOCITY, acceleration.x, source, target, fraction, weight, lanes, j)
    advance_slot(row, VELOCITY + 1, acceleration.y, source, target, fraction, weight, lanes, j)
    advance_slot(row, VELOCITY + 2, acceleration.z, source, target, fraction, weight, lanes, j)
