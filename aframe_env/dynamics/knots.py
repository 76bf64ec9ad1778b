"""A row's wave components in the engine's array, and how far apart the knots of its motion may be."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

MAX_KNOT_INTERVAL: Final = 0.4
"""Longest time between two knots of the motion, s."""
PATH_ERROR: Final = 4e-6
"""Most that the quintics between knots may be off the pulley's path, m: a bound to first order, seldom met."""


class KnotKernels(NamedTuple):
    """Compiled functions of a motion's components: frequency (K,) rad/s, response (K, 6) complex, m and rad."""

    segments: Callable[[FloatArray, ComplexArray, tuple[float, float, float], float, float], int]
    """(frequency, response, pulley on the deck [m], segment [s], ramp [s]): segments between two knots."""
    write: Callable[[FloatArray, FloatArray, ComplexArray, float], None]
    """(row, frequency, response, time between knots [s]): write the components into a row's slots."""


@cache
def knot_kernels() -> KnotKernels:
    """Compile, or take from the cache."""

    @kernel
    def segments(
        frequency: FloatArray,
        response: ComplexArray,
        pulley: tuple[float, float, float],
        segment: float,
        ramp: float,
    ) -> int:
        # As many as the two bounds allow: a power of two. A motion that builds up has a knot where its ramp ends,
        # since the quintics must not span the kink.
        x, y, z = pulley
        sixth = 0.0
        for k in range(frequency.shape[0]):
            r = response[k]
            reach = abs(r[0]) + abs(r[1]) + abs(r[2])
            reach += abs(r[3]) * math.hypot(y, z) + abs(r[4]) * math.hypot(x, z) + abs(r[5]) * math.hypot(x, y)
            sixth += reach * frequency[k] ** 6
        count = 1
        while True:
            interval = 2.0 * count * segment
            over = ramp / interval
            if (
                interval > MAX_KNOT_INTERVAL + 1e-9
                or sixth * interval**6 / 46080.0 > PATH_ERROR
                or abs(over - round(over)) > 1e-9
            ):
                return count
            count *= 2

    @kernel
    def write(row: FloatArray, frequency: FloatArray, response: ComplexArray, interval: float) -> None:
        for k in range((row.shape[0] - at.ROW_SLOTS) // at.COMPONENT_SLOTS):
            base = at.ROW_SLOTS + k * at.COMPONENT_SLOTS
            row[base + at.PHASE_RE] = 1.0
            row[base + at.TURN_RE] = 1.0
            if k < frequency.shape[0]:
                row[base + at.TURN_RE] = math.cos(frequency[k] * interval)
                row[base + at.TURN_IM] = math.sin(frequency[k] * interval)
                row[base + at.FREQUENCY] = frequency[k]
                for dof in range(6):
                    row[base + at.RESPONSE + dof] = response[k, dof].real
                    row[base + at.RESPONSE + 6 + dof] = response[k, dof].imag

    return KnotKernels(segments, write)
