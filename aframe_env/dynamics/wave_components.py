"""Wave components: drawn from a sea, answered by the deck, and laid into the engine's array.

Besides, how far apart the nodes of a row's motion may be.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel, scalar
from aframe_env.dynamics.random import uniform

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

MAX_NODE_INTERVAL: Final = 0.4
"""Longest time between two nodes of the motion, s."""
PATH_ERROR: Final = 4e-6
"""Greatest error of the quintics between nodes against the pulley's path, m: a bound to first order, seldom met."""


@scalar
def quantile(table: FloatArray, probability: float) -> float:
    """Quantile of a distribution, given those at equal steps of probability."""
    place = probability * (table.shape[0] - 1)
    low = min(int(place), table.shape[0] - 2)
    weight = place - low
    value: float = (1.0 - weight) * table[low] + weight * table[low + 1]
    return value


@scalar
def draw_wave(
    seed: int,
    k: int,
    components: int,
    peak: float,
    frequency_table: FloatArray,
    gamma_place: float,
    heading: float,
    direction_table: FloatArray,
) -> tuple[float, float, float]:
    """Frequency [rad/s], direction and phase [rad] of wave ``k`` of a sea.

    ``peak``: the spectrum's peak frequency [rad/s]; ``gamma_place``: its γ, in lines of ``frequency_table``, whose
    columns are quantiles of ω/ω_p; ``direction_table``: quantiles of the direction about ``heading``.
    """
    line = min(int(gamma_place), frequency_table.shape[0] - 2)
    weight = gamma_place - line
    probability = (k + uniform(seed, 3 * k)) / components
    x = (1.0 - weight) * quantile(frequency_table[line], probability)
    x += weight * quantile(frequency_table[line + 1], probability)
    phase = 2.0 * math.pi * uniform(seed, 3 * k + 1)
    direction = heading + quantile(direction_table, uniform(seed, 3 * k + 2))
    return peak * x, direction, phase


@scalar
def place_on_grid(grid: FloatArray, value: float) -> tuple[int, float]:
    """Interval of a rising grid that a value lies in, or is nearest to, and where in it."""
    low, high = 0, grid.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if grid[middle] < value:
            low = middle
        else:
            high = middle
    return low, (value - grid[low]) / (grid[low + 1] - grid[low])


@scalar
def response_cell(
    frequencies: FloatArray, headings: FloatArray, frequency: float, direction: float
) -> tuple[int, float, int, float]:
    """Cell of a vessel's table (frequencies, headings, 6) that a wave falls in, and where in it; the ends are held."""
    i, u = place_on_grid(frequencies, frequency)
    j, v = place_on_grid(headings, direction % (2.0 * math.pi))
    return i, min(max(u, 0.0), 1.0), j, v


@scalar
def respond(table: ComplexArray, i: int, u: float, j: int, v: float, dof: int) -> complex:
    """Response of the deck's coordinate ``dof`` to a wave of amplitude 1: bilinear in cell (i, j)."""
    low: complex = (1.0 - v) * table[i, j, dof] + v * table[i, j + 1, dof]
    high: complex = (1.0 - v) * table[i + 1, j, dof] + v * table[i + 1, j + 1, dof]
    return (1.0 - u) * low + u * high


@scalar
def sixth_derivative_bound(
    frequency: float,
    surge: float,
    sway: float,
    heave: float,
    roll: float,
    pitch: float,
    yaw: float,
    x: float,
    y: float,
    z: float,
) -> float:
    """Share of a component in the bound of the sixth derivative of the pulley's path, m/s⁶.

    ``frequency`` in rad/s; the component's amplitudes, m and rad; the pulley on the deck, m.
    """
    reach = surge + sway + heave
    reach += roll * math.hypot(y, z) + pitch * math.hypot(x, z) + yaw * math.hypot(x, y)
    return reach * frequency**6


@scalar
def segments_between_nodes(bound: float, segment: float, ramp: float) -> int:
    """Motion segments between two nodes: as many as the two bounds above allow, a power of two.

    ``bound``: of the sixth derivative of the pulley's path, m/s⁶. A motion that builds up has a node where its ramp
    ends, since the quintics must not span the kink.
    """
    count = 1
    while True:
        interval = 2.0 * count * segment
        over = ramp / interval
        if (
            interval > MAX_NODE_INTERVAL + 1e-9
            or bound * interval**6 / 46080.0 > PATH_ERROR
            or abs(over - round(over)) > 1e-9
        ):
            return count
        count *= 2


@scalar
def set_turning(row: FloatArray, lanes: int, j: int, k: int, frequency: float, interval: float) -> None:
    """Put component ``k`` of lane j at its phase of time 0, and let it turn by one ``interval`` [s] at a time."""
    base = at.ROW_SLOTS + k * at.COMPONENT_SLOTS
    row[(base + at.PHASE_RE) * lanes + j] = 1.0
    row[(base + at.PHASE_IM) * lanes + j] = 0.0
    row[(base + at.TURN_RE) * lanes + j] = math.cos(frequency * interval)
    row[(base + at.TURN_IM) * lanes + j] = math.sin(frequency * interval)
    row[(base + at.FREQUENCY) * lanes + j] = frequency


class ComponentKernels(NamedTuple):
    """Compiled functions of a motion's components: frequency (K,) rad/s, response (K, 6) complex, m and rad."""

    segments: Callable[[FloatArray, ComplexArray, tuple[float, float, float], float, float], int]
    """(frequency, response, pulley on the deck [m], segment [s], ramp [s]): segments between two nodes."""
    write: Callable[[FloatArray, FloatArray, ComplexArray, float], None]
    """(row, frequency, response, time between nodes [s]): write the components into a row's slots."""


@cache
def component_kernels() -> ComponentKernels:
    """Compile, or take from the cache."""

    @kernel
    def segments(
        frequency: FloatArray,
        response: ComplexArray,
        pulley: tuple[float, float, float],
        segment: float,
        ramp: float,
    ) -> int:
        bound = 0.0
        for k in range(frequency.shape[0]):
            r = response[k]
            bound += sixth_derivative_bound(
                frequency[k], abs(r[0]), abs(r[1]), abs(r[2]), abs(r[3]), abs(r[4]), abs(r[5]), *pulley
            )
        return segments_between_nodes(bound, segment, ramp)

    @kernel
    def write(row: FloatArray, frequency: FloatArray, response: ComplexArray, interval: float) -> None:
        for k in range((row.shape[0] - at.ROW_SLOTS) // at.COMPONENT_SLOTS):
            set_turning(row, 1, 0, k, frequency[k] if k < frequency.shape[0] else 0.0, interval)
            if k < frequency.shape[0]:
                base = at.ROW_SLOTS + k * at.COMPONENT_SLOTS
                for dof in range(6):
                    row[base + at.RESPONSE + dof] = response[k, dof].real
                    row[base + at.RESPONSE + 6 + dof] = response[k, dof].imag

    return ComponentKernels(segments, write)
