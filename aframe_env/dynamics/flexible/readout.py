"""Readout of a frame's present state: deflection of S, reactions, servomotor forces, utilisation, largest rotation.

Reactions are R = Pᵀ(K q + L q̇ - f), linear in the modes and in what acts on the frame, see
``aframe_env.rfem.constraints``; the tables that say how come from ``aframe_env.rfem.tables``.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import prange

from aframe_env.dynamics.blocks import nine
from aframe_env.dynamics.compiling import SpreadKernel, parallel_kernel, scalar
from aframe_env.dynamics.flexible import layout as flex

Array = npt.NDArray[np.float64]

# Columns of a readout.
DEFLECTION: Final = 0
"""Deflection of S along {D}, 3, m."""
FEET: Final = 3
"""Forces on the frame at A_R and A_L, along {D}, 6, N."""
SERVOMOTORS: Final = 9
"""Tensions of S_R and S_L, 2, N."""
UTILISATION: Final = 11
"""Largest von Mises stress at an sde over the yield strength; NaN for sections without stress points."""
ROTATION: Final = 12
"""Largest rotation of an rfe, rad; 0 where a bound on it is within SMALL_ROTATION."""
READOUTS: Final = 13

SMALL_ROTATION: Final = 0.05
"""Rotation of an rfe up to which eq. (10) is taken to hold, rad."""

# Head of a line of the readout's table.
COUNT, CARRIED_COUNT, SPRINGS, POINTS, DAMPED, BODIES, SWING, HEAD = 0, 1, 2, 3, 4, 5, 6, 7
FORCES: Final = 11
"""Numbers that are linear in the state: columns up to UTILISATION."""


@scalar
def add_line(sums: Array, table: Array, first: int, size: int, factor: float) -> None:
    """Add ``factor`` times ``size`` numbers of the table from ``first``."""
    line = table[first : first + size]
    for k in range(size):
        sums[k] += factor * line[k]


@scalar
def read_frame(frame: Array, table: Array, stresses: Array, result: Array, lanes: int, j: int) -> None:
    """Write the readout of lane j into ``result`` (READOUTS,); ``stresses`` (6 n_sde,) is scratch."""
    modes, carried, springs = int(table[COUNT]), int(table[CARRIED_COUNT]), int(table[SPRINGS])
    points = int(table[POINTS])
    forces = result[:FORCES]
    bound = 0.0
    result[:] = 0.0
    stresses[:] = 0.0
    acting = HEAD + 2 * FORCES * modes
    strains = acting + FORCES * (12 + 9 * carried + 3)
    shares = strains + 12 * springs * modes
    fields = shares + 6 * springs * points
    reach = fields + 18 * springs
    for i in range(modes):
        mode = (flex.MODES + flex.MODE_SLOTS * i) * lanes + j
        place, rate = frame[mode + flex.POSITION * lanes], frame[mode + flex.RATE * lanes]
        bound += abs(place) * table[reach + i]
        add_line(forces, table, HEAD + FORCES * i, FORCES, place)
        add_line(forces, table, HEAD + FORCES * (modes + i), FORCES, rate)
        add_line(stresses, table, strains + 6 * springs * i, 6 * springs, place)
        if table[DAMPED] > 0.0:
            add_line(stresses, table, strains + 6 * springs * (modes + i), 6 * springs, rate)
        if i < carried:
            spin = 2.0 * rate
            x = spin * frame[flex.SPIN * lanes + j]
            y = spin * frame[(flex.SPIN + 1) * lanes + j]
            z = spin * frame[(flex.SPIN + 2) * lanes + j]
            w = nine(frame, flex.INPUT + 3, lanes, j)
            coriolis = (0.0, -z, y, z, 0.0, -x, -y, x, 0.0)
            for k in range(9):
                add_line(forces, table, acting + FORCES * (12 + 9 * i + k), FORCES, w[k] * place + coriolis[k])
    for k in range(12):
        add_line(forces, table, acting + FORCES * k, FORCES, frame[(flex.INPUT + k) * lanes + j])
    for k in range(3):
        add_line(forces, table, acting + FORCES * (12 + 9 * carried + k), FORCES, frame[(flex.PULL + k) * lanes + j])
        add_line(stresses, table, fields + 6 * springs * k, 6 * springs, frame[(flex.INPUT + k) * lanes + j])
    if table[SWING] > 0.0:
        swing = int(table[SWING])
        for k in range(4):
            turned = frame[(flex.TURNED + k) * lanes + j]
            add_line(forces, table, swing + FORCES * k, FORCES, turned)
            add_line(stresses, table, swing + 4 * FORCES + 6 * springs * k, 6 * springs, turned)
        slope = frame[flex.SLOPE * lanes + j]
        for k in range(SERVOMOTORS, SERVOMOTORS + 2):
            forces[k] *= math.sqrt(1.0 + slope * slope)
    # Along the deck's axes: those of the tables have luffed with the frame.
    cosine, sine = frame[flex.LEAN * lanes + j], frame[(flex.LEAN + 1) * lanes + j]
    for k in (DEFLECTION, FEET, FEET + 3):
        forces[k], forces[k + 2] = cosine * forces[k] + sine * forces[k + 2], cosine * forces[k + 2] - sine * forces[k]
    worst = 0.0
    for spring in range(springs):
        n, v2, v3 = abs(stresses[6 * spring]), abs(stresses[6 * spring + 1]), abs(stresses[6 * spring + 2])
        t, m2, m3 = abs(stresses[6 * spring + 3]), abs(stresses[6 * spring + 4]), abs(stresses[6 * spring + 5])
        for point in range(points):
            p = shares + 6 * (points * spring + point)
            sigma = n * table[p] + m2 * table[p + 1] + m3 * table[p + 2]
            tau = v2 * table[p + 3] + v3 * table[p + 4] + t * table[p + 5]
            square = sigma * sigma + 3.0 * tau * tau
            worst = square if square > worst or square != square else worst  # once NaN, always NaN
    result[UTILISATION] = np.sqrt(worst)
    if bound > SMALL_ROTATION:
        result[ROTATION] = largest_rotation(frame, table, reach + modes, lanes, j)


@scalar
def largest_rotation(frame: Array, table: Array, first: int, lanes: int, j: int) -> float:
    """Largest rotation of an rfe, rad, by the modes' rotations in the table from ``first``."""
    modes, bodies = int(table[COUNT]), int(table[BODIES])
    largest = 0.0
    for body in range(bodies):
        x, y, z = 0.0, 0.0, 0.0
        for i in range(modes):
            place = frame[(flex.MODES + flex.MODE_SLOTS * i + flex.POSITION) * lanes + j]
            k = first + 3 * (bodies * i + body)
            x, y, z = x + table[k] * place, y + table[k + 1] * place, z + table[k + 2] * place
        largest = max(largest, x * x + y * y + z * z)
    return math.sqrt(largest)


@cache
def readout_kernel(lanes: int) -> SpreadKernel:
    """Kernel (frames, tables, results (N, READOUTS)) that reads the rows' frames out."""

    @parallel_kernel
    def readout(frames: Array, tables: Array, results: Array) -> None:
        for block in prange(frames.shape[0]):
            sums = np.empty(6 * int(tables[0, SPRINGS]))
            for j in range(lanes):
                if block * lanes + j < results.shape[0]:
                    line = int(frames[block, flex.FRAME * lanes + j])
                    read_frame(frames[block], tables[line], sums, results[block * lanes + j], lanes, j)

    return readout
