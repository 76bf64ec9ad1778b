"""Scenarios drawn on the device: what ``ScenarioDistribution`` and ``Engine.row_vector`` do for a row on the processor.

Both take the same steps, with the same functions, from the same random numbers (``aframe_env.dynamics.random``).
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics import start
from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.random import draw_seed, uniform
from aframe_env.dynamics.step import start_rows
from aframe_env.dynamics.wave_components import (
    draw_wave,
    respond,
    response_cell,
    segments_between_nodes,
    set_turning,
    sixth_derivative_bound,
)
from aframe_env.scenario import Range, ScenarioDistribution, sea
from aframe_env.scenario.crane import GRAVITY
from aframe_env.scenario.distribution import SUBSTREAM

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

_critical_damping = scalar(start.critical_damping)
_free_length = scalar(start.free_length)
_hang_load = scalar(start.hang_load)
_inner_steps = scalar(start.inner_steps)
_longest_inner_step = scalar(start.longest_inner_step)
_write_lift = scalar(start.write_lift)
_amplitude_of_each = scalar(sea.amplitude_of_each)
_dnv_gamma = scalar(sea.dnv_gamma)
_gamma_place = scalar(sea.gamma_place)

# Lines of ``Tables.ranges``, and entries of ``Tables.limits``.
_HS, _TP, _HEADING, _GAMMA, _LOAD_MASS, _ROPE_LENGTH, _DAMPING_RATIO = range(7)
_INNER_STEP, _RAMP, _LEAST_LENGTH, _MOST_LENGTH = range(4)
_LOAD: Final = SUBSTREAM
_ROPE: Final = 2 * SUBSTREAM


class Tables(NamedTuple):
    """Tables that a row is drawn from."""

    row: FloatArray
    """(slots,) a row of the distribution at its start; what is not drawn is taken from it."""
    ranges: FloatArray
    """(7, 2) least and greatest Hs [m], Tp [s], heading [rad], γ (0: the one that goes with Hs and Tp), load mass [kg],
    rope length [m], damping ratio."""
    limits: FloatArray
    """(4,) greatest inner step (0: as the load's bobbing asks for), ramp [s], least and greatest rope length [m]."""
    frequency_quantiles: FloatArray
    """See ``sea.frequency_quantiles``."""
    direction_quantiles: FloatArray
    """See ``sea.direction_quantiles``."""
    frequencies: FloatArray
    """(F,) rad/s, of the vessel's table."""
    headings: FloatArray
    """(D,) rad, of the vessel's table."""
    response: ComplexArray
    """(F, D, 6) the vessel's table."""


def tables_of(distribution: ScenarioDistribution, row: FloatArray, max_inner_step: float | None) -> Tables:
    """Tables of a distribution; ``row`` (slots,) is any row of it at its start."""
    d, winch = distribution, distribution.crane.winch
    frequencies, response = d.vessel.deck_table
    gamma: Range = 0.0 if d.gamma == "dnv" else d.gamma
    if d.spectrum == "pierson-moskowitz":
        gamma = 1.0
    ranges = (d.hs, d.tp, d.heading, gamma, d.load_mass, d.rope_length, d.rope_damping_ratio)
    return Tables(
        row=row,
        ranges=np.array([r if isinstance(r, tuple) else (r, r) for r in ranges], dtype=np.float64),
        limits=np.array([max_inner_step or 0.0, d.ramp, winch.min_rope_length, winch.max_rope_length]),
        frequency_quantiles=sea.frequency_quantiles(),
        direction_quantiles=sea.direction_quantiles(d.spreading),
        frequencies=frequencies,
        headings=d.vessel.headings,
        response=response,
    )


@scalar
def drawn(ranges: Any, line: int, probability: float) -> float:
    """A number of the interval in a line of ``Tables.ranges``."""
    value: float = ranges[line, 0] + (ranges[line, 1] - ranges[line, 0]) * probability
    return value


@scalar
def draw_lift(row: FloatArray, lanes: int, j: int, seed: int, first: int, ranges: Any, limits: Any) -> None:
    """Draw lane j's load and rope with the uniform numbers of ``seed`` from ``first`` on."""
    mass = drawn(ranges, _LOAD_MASS, uniform(seed, first + _LOAD))
    rope_length = drawn(ranges, _ROPE_LENGTH, uniform(seed, first + _ROPE))
    ratio = drawn(ranges, _DAMPING_RATIO, uniform(seed, first + _ROPE + 1))
    axial_stiffness = row[at.AXIAL_STIFFNESS * lanes + j]
    length = _free_length(rope_length, row[at.DRUM_TO_PULLEY * lanes + j], mass * GRAVITY, axial_stiffness)
    stiffness = axial_stiffness / length
    damping = ratio * _critical_damping(stiffness, mass)
    longest = limits[_INNER_STEP]
    if longest <= 0.0:
        longest = _longest_inner_step(math.sqrt(stiffness / mass), damping / mass)
    _write_lift(
        row,
        lanes,
        j,
        mass,
        row[(at.PULLEY_ON_DECK + 2) * lanes + j] - rope_length,
        damping,
        length,
        limits[_LEAST_LENGTH],
        limits[_MOST_LENGTH],
        _inner_steps(row[at.CONTROL_PERIOD * lanes + j], longest),
    )


@scalar
def draw_motion(
    row: FloatArray,
    lanes: int,
    j: int,
    components: int,
    seed: int,
    first: int,
    ranges: Any,
    limits: Any,
    frequency_quantiles: Any,
    direction_quantiles: Any,
    frequencies: Any,
    headings: Any,
    response: Any,
) -> None:
    """Draw a sea of ``components`` waves with the uniform numbers of ``seed`` from ``first`` on: lane j's motion."""
    hs = drawn(ranges, _HS, uniform(seed, first))
    tp = drawn(ranges, _TP, uniform(seed, first + 1))
    heading = drawn(ranges, _HEADING, uniform(seed, first + 2))
    gamma = drawn(ranges, _GAMMA, uniform(seed, first + 3))
    place = _gamma_place(gamma if gamma > 0.0 else _dnv_gamma(hs, tp))
    waves = draw_seed(seed, first + 4)
    amplitude = _amplitude_of_each(hs, components)
    x, y, z = (
        row[at.PULLEY_ON_DECK * lanes + j],
        row[(at.PULLEY_ON_DECK + 1) * lanes + j],
        row[(at.PULLEY_ON_DECK + 2) * lanes + j],
    )
    bound = 0.0
    for k in range(components):
        frequency, direction, phase = draw_wave(
            waves, k, components, 2.0 * math.pi / tp, frequency_quantiles, place, heading, direction_quantiles
        )
        m, u, n, v = response_cell(frequencies, headings, frequency, direction)
        wave = amplitude * complex(math.cos(phase), math.sin(phase))
        base = at.ROW_SLOTS + k * at.COMPONENT_SLOTS
        for dof in range(6):
            answer = wave * respond(response, m, u, n, v, dof)
            row[(base + at.RESPONSE + dof) * lanes + j] = answer.real
            row[(base + at.RESPONSE + 6 + dof) * lanes + j] = answer.imag
        row[(base + at.FREQUENCY) * lanes + j] = frequency
        bound += sixth_derivative_bound(
            frequency,
            modulus(row, lanes, j, base, 0),
            modulus(row, lanes, j, base, 1),
            modulus(row, lanes, j, base, 2),
            modulus(row, lanes, j, base, 3),
            modulus(row, lanes, j, base, 4),
            modulus(row, lanes, j, base, 5),
            x,
            y,
            z,
        )
    segment = row[at.CONTROL_PERIOD * lanes + j]
    segments = segments_between_nodes(bound, segment, limits[_RAMP])
    row[at.NODE_SEGMENTS * lanes + j] = segments
    for k in range(components):
        frequency = row[(at.ROW_SLOTS + k * at.COMPONENT_SLOTS + at.FREQUENCY) * lanes + j]
        set_turning(row, lanes, j, k, frequency, segments * segment)


@scalar
def modulus(row: FloatArray, lanes: int, j: int, base: int, dof: int) -> float:
    """Amplitude of coordinate ``dof`` in the component of lane j whose slots begin at ``base``."""
    return math.hypot(
        row[(base + at.RESPONSE + dof) * lanes + j],
        row[(base + at.RESPONSE + 6 + dof) * lanes + j],
    )


@scalar
def begin_episode(row: FloatArray, room: int, records: FloatArray, lanes: int, j: int) -> None:
    """Pose lane j's deck, hang its load under the pulley, moving along with it, and measure the rope."""
    span = Span(lanes, j, j + 1)
    start_rows(row, room, records, span)
    _hang_load(row, lanes, j, True)
    start_rows(row, room, records, span)


@scalar
def copy_row(row: FloatArray, lanes: int, j: int, vector: FloatArray) -> None:
    """Overwrite lane j with a row's slots (slots,)."""
    for slot in range(vector.shape[0]):
        row[slot * lanes + j] = vector[slot]
