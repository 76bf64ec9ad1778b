"""A row's wave components in the engine's array, and how far apart the knots of its motion may be."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel, scalar

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

MAX_KNOT_INTERVAL: Final = 0.4
"""Longest time between two knots of the motion, s."""
PATH_ERROR: Final = 4e-6
"""Most that the quintics between knots may be off the pulley's path, m: a bound to first order, seldom met."""


@scalar
def bend_bound(
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
    """What a component adds to the bound of the sixth derivative of the pulley's path, m/s⁶.

    ``frequency`` in rad/s; the component's amplitudes, m and rad; the pulley on the deck, m.
    """
    reach = surge + sway + heave
    reach += roll * math.hypot(y, z) + pitch * math.hypot(x, z) + yaw * math.hypot(x, y)
    return reach * frequency**6


@scalar
def segments_between_knots(bound: float, segment: float, ramp: float) -> int:
    """Motion segments between two knots: as many as the two bounds above allow, a power of two.

    ``bound``: of the sixth derivative of the pulley's path, m/s⁶. A motion that builds up has a knot where its ramp
    ends, since the quintics must not span the kink.
    """
    count = 1
    while True:
        interval = 2.0 * count * segment
        over = ramp / interval
        if (
            interval > MAX_KNOT_INTERVAL + 1e-9
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
        bound = 0.0
        for k in range(frequency.shape[0]):
            r = response[k]
            bound += bend_bound(frequency[k], abs(r[0]), abs(r[1]), abs(r[2]), abs(r[3]), abs(r[4]), abs(r[5]), *pulley)
        return segments_between_knots(bound, segment, ramp)

    @kernel
    def write(row: FloatArray, frequency: FloatArray, response: ComplexArray, interval: float) -> None:
        for k in range((row.shape[0] - at.ROW_SLOTS) // at.COMPONENT_SLOTS):
            set_turning(row, 1, 0, k, frequency[k] if k < frequency.shape[0] else 0.0, interval)
            if k < frequency.shape[0]:
                base = at.ROW_SLOTS + k * at.COMPONENT_SLOTS
                for dof in range(6):
                    row[base + at.RESPONSE + dof] = response[k, dof].real
                    row[base + at.RESPONSE + 6 + dof] = response[k, dof].imag

    return KnotKernels(segments, write)
