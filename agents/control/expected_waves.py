"""Waves that a task lets expect: mean spectra of the pulley's heave rate over the scenarios it draws.

A filter of the motion needs to know how much of it lies at which frequency, and how fast it comes up at the start of a
lift. That is the statistics of the sea at hand, never the waves of an episode: other scenarios are drawn for it than
any that is trained on or evaluated. The seas that a task draws are sorted into kinds, from the long swell to the short
sea: which kind it is, a filter finds out as it goes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario, ScenarioDistribution, ScenarioSource
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.motion import FloatOrComplex, has_components, is_tabled, point_heave
from aframe_env.scenario.sea import SeaMotion
from aframe_env.validation import InvalidValue, require_number
from agents.control.filters import FloatArray

SEED: Final = 3_000_017
"""Seed of the scenarios that the spectrum is the mean of."""
SCENARIOS: Final = 512
KINDS: Final = 32
"""Kinds of sea, each as likely as the others."""
BANDS: Final = 48
"""Bands of frequency that the spectrum is told in."""
OUTSIDE: Final = 2e-3
"""Share of the variance that may lie below the lowest band, and above the highest."""
FLOOR: Final = 1e-4
"""Least variance of a band, as a share of the bands' mean."""
LEAST_VARIANCE: Final = 1e-6
"""Least variance in all, m²/s²: of a ship at rest."""
WIDEST: Final = (0.2, 2.5)
"""rad/s: the bands lie within; what moves faster is no ship, what moves slower is no wave."""
LEAST_WIDTH: Final = 0.3
"""Least width from the lowest band to the highest, rad/s."""
_SAMPLING: Final = 0.25  # s, of recorded motions


@dataclass(frozen=True, kw_only=True)
class ExpectedWaves:
    """Bands of the pulley's heave rate."""

    frequency: tuple[float, ...]
    """Middle of each band, rad/s, increasing."""
    variances: tuple[tuple[float, ...], ...]
    """Variance of the heave rate in each band, m²/s², in each kind of sea; all kinds are as likely."""
    build_up: float
    """Time over which the motion comes up to that at the start of a lift, s; 0 for a ship that moves already."""

    def __post_init__(self) -> None:
        if not self.variances:
            raise InvalidValue("no variances of waves: there must be one kind of sea at least")
        for each in self.variances:
            if not len(self.frequency) == len(each) > 1:
                raise InvalidValue(
                    f"{len(self.frequency)} frequencies and {len(each)} variances of waves: "
                    "must be as many, and two at least"
                )
        for value in self.frequency:
            require_number("frequency", value, "rad/s", low=0.0, high=100.0, low_open=True)
        for value in chain.from_iterable(self.variances):
            require_number("variance", value, "m²/s²", low=0.0, high=1e4, low_open=True)
        require_number("build_up", self.build_up, "s", low=0.0, high=1e4)

    @property
    def variance(self) -> tuple[float, ...]:
        """Mean variance of the heave rate in each band over the kinds, m²/s²."""
        return tuple(np.mean(self.variances, axis=0).tolist())

    @classmethod
    def of(cls, source: ScenarioSource) -> ExpectedWaves:
        """Waves that the scenarios of a source let expect; of a single scenario, other realisations of its sea."""
        return _expected(source)


@lru_cache(maxsize=32)
def _expected(source: ScenarioSource) -> ExpectedWaves:
    rng = np.random.default_rng(SEED)
    if isinstance(source, Scenario):
        scenarios = [_another(source, seed) for seed in rng.integers(2**53, size=SCENARIOS).tolist()]
    else:
        scenarios = [source.draw(rng) for _ in range(SCENARIOS)]
    lines = list(_spectra(scenarios))
    frequency, variance = np.concatenate([line[0] for line in lines]), np.concatenate([line[1] for line in lines])
    low, high = _band(frequency, variance)
    middle = np.linspace(low, high, BANDS)
    edges = np.concatenate([[-math.inf], 0.5 * (middle[1:] + middle[:-1]), [math.inf]])
    inside = np.stack([np.histogram(line[0], edges, weights=line[1])[0] for line in lines])
    # As much as in a middling sea, not in the mean of all: gains go by the logarithm.
    each = inside.sum(axis=1)
    total = float(np.exp(np.log(np.maximum(each, LEAST_VARIANCE)).mean()))
    shares = inside / np.maximum(each, LEAST_VARIANCE)[:, None]
    kinds = KINDS if isinstance(source, ScenarioDistribution) else 1
    of_kinds = (shares[kind].mean(axis=0) for kind in np.array_split(_from_the_longest(shares, middle), kinds))
    return ExpectedWaves(
        frequency=tuple(middle.tolist()),
        variances=tuple(tuple((total * _smooth(kind)).tolist()) for kind in of_kinds),
        build_up=float(scenarios[0].ramp),
    )


def _from_the_longest(shares: FloatArray, middle: FloatArray) -> npt.NDArray[np.int64]:
    """Indices (N,) of the seas, that of the longest waves first, from the shares (N, bands) of their variance."""
    return np.argsort(shares @ middle, kind="stable")


def _smooth(shares: FloatArray) -> FloatArray:
    """Shares (bands,) of some seas' variance, smoothed over neighbours: a mean of them still has teeth."""
    if not shares.any():
        return np.full(len(shares), 1.0 / len(shares))
    padded = np.pad(shares, 1, mode="edge")
    smooth = 0.25 * padded[:-2] + 0.5 * padded[1:-1] + 0.25 * padded[2:]
    return np.asarray(np.maximum(smooth / smooth.sum(), FLOOR / len(shares)))


def _another(scenario: Scenario, seed: int) -> Scenario:
    """The scenario in another realisation of its sea; a motion that is no sea stays as it is."""
    if not isinstance(scenario.motion, SeaMotion):
        return scenario
    return replace(scenario, motion=replace(scenario.motion, sea=replace(scenario.motion.sea, seed=seed)))


def pulley_heave(coordinates: FloatOrComplex, crane: Crane) -> FloatOrComplex:
    """Linear heave (K,) of the crane's pulley, or its rate, for the deck's coordinates or rates (K, 6)."""
    return point_heave(coordinates, crane.pulley_position)


def _spectra(scenarios: Iterable[Scenario]) -> Iterable[tuple[FloatArray, FloatArray]]:
    """Frequencies (K,) rad/s and variances (K,) m²/s² of the pulley's heave rate in each scenario."""
    for scenario in scenarios:
        motion = scenario.motion
        if has_components(motion):
            components = motion.components()
            heave = pulley_heave(components.response, scenario.crane)
            yield components.frequency, 0.5 * np.square(np.abs(heave) * components.frequency)
        else:
            assert is_tabled(motion)
            yield _spectrum(pulley_heave(motion.table(_SAMPLING)[:, 6:12], scenario.crane))


def _spectrum(signal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Spectrum of a record (T,) of the pulley's heave rate."""
    window = np.hanning(len(signal))
    spectrum = np.fft.rfft(window * (signal - signal.mean()))
    power = 2.0 * np.square(np.abs(spectrum)) / (len(signal) * np.square(window).sum())
    return np.asarray(2.0 * np.pi * np.fft.rfftfreq(len(signal), _SAMPLING)), power


def _band(frequency: FloatArray, variance: FloatArray) -> tuple[float, float]:
    """Lowest and highest frequency [rad/s] of note."""
    order = np.argsort(frequency)
    mass = np.cumsum(variance[order])
    if not len(mass) or mass[-1] <= 0.0:
        return 0.3, 1.6
    low, high = frequency[order][np.searchsorted(mass, mass[-1] * np.array([OUTSIDE, 1.0 - OUTSIDE]))].tolist()
    half = max(0.5 * (high - low), 0.5 * LEAST_WIDTH)
    # A motion beyond is still met by bands of the least width, at the end that is next to it.
    least, greatest = WIDEST[0] + 0.5 * LEAST_WIDTH, WIDEST[1] - 0.5 * LEAST_WIDTH
    middle = min(max(0.5 * (low + high), least), greatest)
    return max(middle - half, WIDEST[0]), min(middle + half, WIDEST[1])
