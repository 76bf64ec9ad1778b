"""Random seas: spectrum and spreading → wave components → the ship's motion through its vessel's response.

The components split the spectrum's energy into equal parts. In each part one frequency is drawn from the
spectrum's own distribution, so that every spectral moment of elevation and response is met in the mean over
seeds whatever the number of components, no realisation repeats itself, and all motions of the ship come from the
same waves with their phases.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.compiling import kernel
from aframe_env.dynamics.wave_components import draw_wave, respond, response_cell
from aframe_env.scenario.motion import ComplexArray, Components, FloatArray
from aframe_env.scenario.vessel import FALL, Vessel
from aframe_env.validation import (
    SeaBeyondTableWarning,
    require_choice,
    require_instance,
    require_integer,
    require_number,
)

SPECTRA: tuple[str, ...] = ("jonswap", "pierson-moskowitz")

NOTABLE: Final = 0.05
"""Share of a sea's variance outside a vessel's table that is worth a warning."""
ALL_ABOVE, ALL_BELOW = 0.6, 3.0
"""Peak frequencies between which more than 95 % of any sea's variance lies, on either side."""

FULL_TURN = 2.0 * math.pi
"""rad."""
_GAMMA_STEP: Final = 0.1
_GAMMAS = np.linspace(1.0, 10.0, 91)
_QUANTILES = 2049


def dnv_gamma(hs: float, tp: float) -> float:
    """Peak enhancement factor that goes with Hs [m] and Tp [s] (DNV-RP-C205, 3.5.5.5), from 1 to 5."""
    ratio = tp / math.sqrt(hs) if hs > 0.0 else math.inf
    if ratio <= 3.6:
        return 5.0
    return max(1.0, math.exp(5.75 - 1.15 * ratio))


def gamma_place(gamma: float) -> float:
    """Place of a peak enhancement factor in ``frequency_quantiles``, in lines."""
    return (gamma - 1.0) / _GAMMA_STEP


def amplitude_of_each(hs: float, components: int) -> float:
    """Amplitude [m] of each of so many waves of equal energy that make up a sea of significant wave height hs [m]."""
    return hs * math.sqrt(2.0 / components) / 4.0


@dataclass(frozen=True, kw_only=True)
class Sea:
    """A short-term sea state and one realisation of it."""

    hs: float
    """Significant wave height 4 √m0, m."""
    tp: float
    """Peak period, s."""
    heading: float = math.pi
    """Direction that the waves travel towards, rad from the ship's bow towards port, in ±2π: 0 following sea, π head
    sea."""
    spectrum: str = "jonswap"
    gamma: float = 3.3
    """Peak enhancement factor of the JONSWAP spectrum; 1 makes it Pierson-Moskowitz."""
    spreading: int | None = None
    """s of the directional spreading cos^2s(θ/2); None for long-crested waves."""
    components: int = 32
    """Number of wave components."""
    seed: int = 0
    """Seed of frequencies, phases and directions."""

    def __post_init__(self) -> None:
        require_number("hs", self.hs, "m", low=0.0, high=30.0)
        require_number("tp", self.tp, "s", low=2.0, high=40.0)
        require_number("heading", self.heading, "rad", low=-FULL_TURN, high=FULL_TURN)
        require_choice("spectrum", self.spectrum, SPECTRA)
        require_number("gamma", self.gamma, "", low=1.0, high=10.0)
        if self.spreading is not None:
            require_integer("spreading", self.spreading, low=1, high=100)
        require_integer("components", self.components, low=1, high=4096)
        require_integer("seed", self.seed, low=0, high=2**63 - 1)

    @property
    def peak_enhancement(self) -> float:
        """γ in force: 1 for the Pierson-Moskowitz spectrum."""
        return 1.0 if self.spectrum == "pierson-moskowitz" else self.gamma

    def density(self, frequency: npt.ArrayLike) -> FloatArray:
        """Spectral density S(ω), m² s/rad, at angular frequencies [rad/s], with 4 √m0 = Hs exactly."""
        x = np.asarray(frequency, dtype=np.float64) * self.tp / (2.0 * math.pi)
        grid = _shape_grid()
        energy = np.trapezoid(_shape(grid, self.peak_enhancement), grid)
        scale = self.hs**2 / 16.0 / energy * self.tp / (2.0 * math.pi)
        return np.asarray(scale * _shape(x, self.peak_enhancement))

    def share_below(self, frequency: float) -> float:
        """Share of the sea's variance below an angular frequency [rad/s], from 0 to 1."""
        place = gamma_place(self.peak_enhancement)
        line = min(int(place), len(_GAMMAS) - 2)
        table = frequency_quantiles()[line : line + 2]
        quantiles = table[0] + (place - line) * (table[1] - table[0])
        return float(np.interp(frequency * self.tp / FULL_TURN, quantiles, np.linspace(0.0, 1.0, _QUANTILES)))

    def waves(self) -> Waves:
        """Return the realisation: one regular wave for each component."""
        frequency, direction, phase = _sea_kernels().realise(
            self.seed,
            self.components,
            2.0 * math.pi / self.tp,
            frequency_quantiles(),
            gamma_place(self.peak_enhancement),
            self.heading,
            direction_quantiles(self.spreading),
        )
        amplitude = np.full(self.components, amplitude_of_each(self.hs, self.components))
        return Waves(frequency, direction, amplitude, phase)


@dataclass(frozen=True)
class Waves:
    """Regular waves: the elevation at the vessel's reference point is Σ a cos(ω t + ε)."""

    frequency: FloatArray
    """(K,) rad/s."""
    direction: FloatArray
    """(K,) rad, travelling towards."""
    amplitude: FloatArray
    """(K,) m."""
    phase: FloatArray
    """(K,) rad, ε."""

    def elevation(self, times: npt.ArrayLike) -> FloatArray:
        """Elevation of the undisturbed sea at the vessel's reference point at ``times`` [s], m."""
        t = np.asarray(times, dtype=np.float64)
        return np.asarray(np.cos(t[..., None] * self.frequency + self.phase) @ self.amplitude)


@dataclass(frozen=True, kw_only=True)
class SeaMotion:
    """Motion of the deck frame of a vessel in a sea."""

    sea: Sea
    vessel: Vessel = field(default_factory=Vessel.supply)

    def __post_init__(self) -> None:
        require_instance("sea", self.sea, Sea)
        require_instance("vessel", self.vessel, Vessel)
        self._warn_of_waves_beyond()

    def _warn_of_waves_beyond(self) -> None:
        """Warn where the vessel's table says nothing of a notable part of the sea."""
        vessel, peak = self.vessel, FULL_TURN / self.sea.tp
        low, high = vessel.frequencies[0], math.inf if vessel.dies_out else vessel.frequencies[-1]
        if low < ALL_ABOVE * peak and high > ALL_BELOW * peak:
            return
        below, above = self.sea.share_below(low), 1.0 - self.sea.share_below(high)
        for share, side, what in (
            (below, "below", "there it is held"),
            (above, "above", f"there it falls to nothing, at {FALL * high:.3g} rad/s"),
        ):
            if share > NOTABLE:
                warnings.warn(
                    # The same words for every sea of a vessel: Python shows them once, however many are drawn.
                    f"more than {100.0 * NOTABLE:.0f} % of a sea's variance lies {side} the frequencies of the "
                    f"response of {vessel.name!r}, {low:g} to {vessel.frequencies[-1]:g} rad/s: {what}",
                    SeaBeyondTableWarning,
                    stacklevel=4,
                )

    def components(self) -> Components:
        """Return the deck's response to each wave."""
        waves = self.sea.waves()
        frequencies, table = self.vessel.deck_table
        response = _sea_kernels().respond(
            waves.frequency,
            waves.direction,
            waves.amplitude,
            waves.phase,
            frequencies,
            self.vessel.headings,
            table,
        )
        return Components(waves.frequency, response)

    def waves_under(self, x: float, y: float, gravity: float) -> tuple[ComplexArray, FloatArray]:
        """Complex elevation [m] of each wave (K,) under a point of the deck [m], the ship at rest, and its way (K, 2).

        The way is a unit vector on the deck's axes. In deep water; phases as at time 0.
        """
        waves, vessel = self.sea.waves(), self.vessel
        # The deck's axes are the ship's turned by half a circle.
        forward = vessel.deck_position[0] - x - vessel.reference_point[0]
        to_port = vessel.deck_position[1] - y - vessel.reference_point[1]
        along, across = np.cos(waves.direction), np.sin(waves.direction)
        number = waves.frequency**2 / gravity
        phase = waves.phase - number * (forward * along + to_port * across)
        return waves.amplitude * np.exp(1j * phase), np.stack([-along, -across], axis=1)


def _shape_grid() -> FloatArray:
    return np.linspace(0.2, 8.0, 7801)


def _shape(x: npt.ArrayLike, gamma: float) -> FloatArray:
    """JONSWAP's shape over x = ω/ω_p: the density with Hs = 4 m and ω_p = 1 rad/s, DNV-RP-C205, 3.5.5."""
    x = np.asarray(x, dtype=np.float64)
    positive = np.where(x > 0.0, x, 1.0)
    width = np.where(positive <= 1.0, 0.07, 0.09)
    pierson_moskowitz = 5.0 / positive**5 * np.exp(-1.25 / positive**4)
    enhancement = gamma ** np.exp(-0.5 * ((positive - 1.0) / width) ** 2)
    return np.where(x > 0.0, (1.0 - 0.287 * np.log(gamma)) * pierson_moskowitz * enhancement, 0.0)


def _inverse(grid: FloatArray, density: FloatArray) -> FloatArray:
    """Quantiles, at _QUANTILES equal steps of probability, of a density on a grid."""
    mass = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(grid))])
    return np.interp(np.linspace(0.0, 1.0, _QUANTILES), mass / mass[-1], grid)


@lru_cache(maxsize=1)
def frequency_quantiles() -> FloatArray:
    """Quantiles of ω/ω_p for each γ of _GAMMAS: (91, _QUANTILES)."""
    grid = _shape_grid()
    return np.stack([_inverse(grid, _shape(grid, float(gamma))) for gamma in _GAMMAS])


@lru_cache(maxsize=16)
def direction_quantiles(spreading: int | None) -> FloatArray:
    """Quantiles of the direction about the mean, rad: (_QUANTILES,)."""
    if spreading is None:
        return np.zeros(_QUANTILES)
    # As wide as the density is a millionth of its peak: the outermost quantiles would lie opposite to the waves else.
    width = 2.0 * math.acos(1e-6 ** (0.5 / spreading))
    grid = np.linspace(-width, width, 4001)
    # Up to a factor, which overflows in gamma functions where the spreading is narrow.
    return _inverse(grid, np.cos(0.5 * grid) ** (2 * spreading))


class _SeaKernels(NamedTuple):
    realise: Callable[..., tuple[FloatArray, FloatArray, FloatArray]]
    respond: Callable[..., ComplexArray]


@cache
def _sea_kernels() -> _SeaKernels:
    @kernel
    def realise(
        seed: int,
        components: int,
        peak: float,
        frequency_table: FloatArray,
        gamma_place: float,
        heading: float,
        direction_table: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        frequency = np.empty(components)
        direction = np.empty(components)
        phase = np.empty(components)
        for k in range(components):
            frequency[k], direction[k], phase[k] = draw_wave(
                seed, k, components, peak, frequency_table, gamma_place, heading, direction_table
            )
        return frequency, direction, phase

    @kernel
    def respond_to(
        frequency: FloatArray,
        direction: FloatArray,
        amplitude: FloatArray,
        phase: FloatArray,
        grid_frequency: FloatArray,
        grid_heading: FloatArray,
        table: ComplexArray,
    ) -> ComplexArray:
        response = np.empty((frequency.shape[0], 6), dtype=np.complex128)
        for k in range(frequency.shape[0]):
            i, u, j, v = response_cell(grid_frequency, grid_heading, frequency[k], direction[k])
            wave = amplitude[k] * complex(math.cos(phase[k]), math.sin(phase[k]))
            for d in range(6):
                response[k, d] = wave * respond(table, i, u, j, v, d)
        return response

    return _SeaKernels(realise, respond_to)
