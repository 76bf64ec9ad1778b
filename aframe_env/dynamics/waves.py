"""One wave of a random sea, and how the deck answers it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import scalar
from aframe_env.random import uniform

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]


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
