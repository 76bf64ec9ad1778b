"""Scenarios drawn in compiled code: what ``ScenarioDistribution`` and ``Engine`` do for a row, without either.

The random numbers are addressed by seed, row and episode, so that a row's scenarios depend on nothing else.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env import sea
from aframe_env.crane import GRAVITY
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel, scalar
from aframe_env.dynamics.knots import bend_bound, segments_between_knots, set_turning
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.step import start_rows
from aframe_env.dynamics.waves import draw_wave, respond, response_cell
from aframe_env.engine import INNER_STEP_PHASE, MAX_INNER_STEP
from aframe_env.random import uniform
from aframe_env.scenario import SUBSTREAM, Range, ScenarioDistribution

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

UNIFORMS: Final = 3 * SUBSTREAM
"""Random numbers of one scenario."""

_dnv_gamma = scalar(sea.dnv_gamma)

# Lines of ``Tables.ranges``.
_HS, _TP, _HEADING, _GAMMA, _LOAD_MASS, _ROPE_LENGTH, _DAMPING_RATIO = range(7)


class Tables(NamedTuple):
    """What a row is drawn from."""

    row: FloatArray
    """(slots,) a row of the distribution at its start; what is not drawn is taken from it."""
    ranges: FloatArray
    """(7, 2) least and greatest Hs [m], Tp [s], heading [rad], γ (0: the one that goes with Hs and Tp), load mass [kg],
    rope length [m], damping ratio."""
    limits: FloatArray
    """(4,) greatest inner step (0: as the load's bobbing asks for), ramp [s], least and greatest rope length [m]."""
    frequency_quantiles: FloatArray
    direction_quantiles: FloatArray
    frequencies: FloatArray
    """(F,) rad/s, of the vessel's table."""
    headings: FloatArray
    """(D,) rad, of the vessel's table."""
    response: ComplexArray
    """(F, D, 6) the vessel's table."""


def tables_of(distribution: ScenarioDistribution, row: FloatArray, max_inner_step: float | None) -> Tables:
    """Tables of a distribution; ``row`` (slots,) is any row of it at its start."""
    d, winch = distribution, distribution.crane.winch
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
        frequencies=d.vessel.frequencies,
        headings=d.vessel.headings,
        response=d.vessel.deck_response,
    )


@scalar
def row_seed(seed: int, row: int) -> int:
    """Seed of a row's scenarios."""
    return int(uniform(seed, row) * 9007199254740992.0)


@kernel
def uniforms(seed: int, row: int, episode: int, numbers: FloatArray) -> None:
    """Random numbers (UNIFORMS,) that ``draw_row`` draws a scenario with."""
    own = row_seed(seed, row)
    for k in range(UNIFORMS):
        numbers[k] = uniform(own, UNIFORMS * episode + k)


@scalar
def drawn(ranges: FloatArray, line: int, probability: float) -> float:
    """A number of the interval in a line of ``Tables.ranges``."""
    return ranges[line, 0] + (ranges[line, 1] - ranges[line, 0]) * probability


@scalar
def draw_lift(row: FloatArray, lanes: int, j: int, seed: int, first: int, ranges: Any, limits: Any) -> None:
    """Draw lane j's load and rope with the uniform numbers from ``first`` on."""
    mass = drawn(ranges, _LOAD_MASS, uniform(seed, first + SUBSTREAM))
    rope_length = drawn(ranges, _ROPE_LENGTH, uniform(seed, first + 2 * SUBSTREAM))
    ratio = drawn(ranges, _DAMPING_RATIO, uniform(seed, first + 2 * SUBSTREAM + 1))
    axial_stiffness, radius = row[at.AXIAL_STIFFNESS * lanes + j], row[at.DRUM_RADIUS * lanes + j]
    free_length = (rope_length + row[at.DRUM_TO_PULLEY * lanes + j]) / (1.0 + mass * GRAVITY / axial_stiffness)
    stiffness = axial_stiffness / free_length
    segment, lag = row[at.CONTROL_PERIOD * lanes + j], row[at.LAG * lanes + j]
    longest = limits[0]
    if longest == 0.0:
        longest = min(MAX_INNER_STEP, INNER_STEP_PHASE / math.sqrt(stiffness / mass))
    substeps = max(1.0, math.ceil(segment / longest - 1e-9))
    row[at.MASS * lanes + j] = mass
    row[at.TARGET * lanes + j] = row[(at.PULLEY_ON_DECK + 2) * lanes + j] - rope_length
    row[at.ROPE_DAMPING * lanes + j] = ratio * 2.0 * math.sqrt(stiffness * mass)
    row[at.FREE_LENGTH * lanes + j] = free_length
    row[at.MIN_ANGLE * lanes + j] = (limits[2] - free_length) / radius
    row[at.MAX_ANGLE * lanes + j] = (limits[3] - free_length) / radius
    row[at.SUBSTEPS * lanes + j] = substeps
    row[at.INNER_STEP * lanes + j] = segment / substeps
    row[at.HALF_STEP_DECAY * lanes + j] = math.exp(-0.5 * segment / substeps / lag) if lag > 0.0 else 0.0


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
    """Draw lane j's sea of ``components`` waves with the uniform numbers from ``first`` on, and write the deck's motion."""
    hs = drawn(ranges, _HS, uniform(seed, first))
    tp = drawn(ranges, _TP, uniform(seed, first + 1))
    heading = drawn(ranges, _HEADING, uniform(seed, first + 2))
    gamma = drawn(ranges, _GAMMA, uniform(seed, first + 3))
    if gamma == 0.0:
        gamma = _dnv_gamma(hs, tp)
    waves = int(uniform(seed, first + 4) * 9007199254740992.0)
    place = (gamma - sea.LEAST_GAMMA) / sea.GAMMA_STEP
    amplitude = hs * math.sqrt(2.0 / components) / 4.0
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
        bound += bend_bound(
            frequency,
            component_size(row, lanes, j, base, 0),
            component_size(row, lanes, j, base, 1),
            component_size(row, lanes, j, base, 2),
            component_size(row, lanes, j, base, 3),
            component_size(row, lanes, j, base, 4),
            component_size(row, lanes, j, base, 5),
            x,
            y,
            z,
        )
    segment = row[at.CONTROL_PERIOD * lanes + j]
    segments = segments_between_knots(bound, segment, limits[1])
    row[at.KNOT_SEGMENTS * lanes + j] = segments
    for k in range(components):
        frequency = row[(at.ROW_SLOTS + k * at.COMPONENT_SLOTS + at.FREQUENCY) * lanes + j]
        set_turning(row, lanes, j, k, frequency, segments * segment)


@scalar
def component_size(row: FloatArray, lanes: int, j: int, base: int, dof: int) -> float:
    """Modulus of a component's response in coordinate ``dof``."""
    return math.hypot(
        row[(base + at.RESPONSE + dof) * lanes + j],
        row[(base + at.RESPONSE + 6 + dof) * lanes + j],
    )


@scalar
def hang_load(row: FloatArray, room: int, records: FloatArray, lanes: int, j: int) -> None:
    """Put lane j's load under the pulley, moving along with it, and measure the rope."""
    span = Span(lanes, j, j + 1)
    start_rows(row, room, records, span)
    for axis in range(3):
        row[(at.LOAD_POSITION + axis) * lanes + j] = row[(at.PULLEY + axis) * lanes + j]
        row[(at.LOAD_VELOCITY + axis) * lanes + j] = row[(at.PULLEY + 3 + axis) * lanes + j]
    rope_length = row[(at.PULLEY_ON_DECK + 2) * lanes + j] - row[at.TARGET * lanes + j]
    row[(at.LOAD_POSITION + 2) * lanes + j] -= rope_length
    error = row[(at.LOAD_POSITION + 2) * lanes + j] - row[at.TARGET * lanes + j]
    row[at.OMEGA2 * lanes + j] = abs(error)
    start_rows(row, room, records, span)


@scalar
def copy_row(row: FloatArray, lanes: int, j: int, vector: FloatArray) -> None:
    """Overwrite lane j with a row's slots (slots,)."""
    for slot in range(vector.shape[0]):
        row[slot * lanes + j] = vector[slot]
