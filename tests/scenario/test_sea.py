"""Random seas: the spectrum against its formula, realisations against the spectrum's own moments."""

from __future__ import annotations

import math
import warnings

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import simpson
from scipy.interpolate import RegularGridInterpolator
from waveresponse import JONSWAP, CosineFullSpreading

from aframe_env import ScenarioDistribution, Sea, SeaBeyondTableWarning, SeaMotion, Vessel
from aframe_env.scenario.sea import direction_quantiles, dnv_gamma

FloatArray = npt.NDArray[np.float64]
SUPPLY = Vessel.supply()
SEEDS = 400
# A mean over seeds may be four of its standard errors off. Quantiles are tabled at 2048 steps, which makes the last
# 1/2048 of the energy a little too quick: 0.5 % of the second moment.
TABLE_ERROR = 5e-3


def jonswap(x: FloatArray, gamma: float) -> FloatArray:
    """JONSWAP's shape over ω/ω_p (Hasselmann et al. 1973)."""
    width = np.where(x <= 1.0, 0.07, 0.09)
    return np.asarray(x**-5 * np.exp(-1.25 * x**-4) * gamma ** np.exp(-((x - 1.0) ** 2) / (2.0 * width**2)))


def expected_density(sea: Sea) -> tuple[FloatArray, FloatArray]:
    """Frequencies, finely, and the spectral density by the formula, with 4 √m0 = Hs."""
    x = np.linspace(0.2, 8.0, 78_001)
    shape = jonswap(x, sea.peak_enhancement)
    omega = 2.0 * math.pi / sea.tp * x
    return omega, shape * sea.hs**2 / 16.0 / simpson(shape, x=omega)


def close_in_the_mean(samples: FloatArray, expected: float) -> bool:
    error = 4.0 * samples.std(ddof=1) / math.sqrt(len(samples))
    return bool(abs(samples.mean() - expected) < error + TABLE_ERROR * abs(expected))


def sea(seed: int = 0, **changes: object) -> Sea:
    return Sea(**{"hs": 3.0, "tp": 9.0, "seed": seed, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(("spectrum", "gamma"), [("jonswap", 3.3), ("jonswap", 1.0), ("pierson-moskowitz", 3.3)])
def test_density_is_jonswaps_formula(spectrum: str, gamma: float) -> None:
    state = sea(spectrum=spectrum, gamma=gamma)
    omega, density = expected_density(state)
    np.testing.assert_allclose(state.density(omega), density, rtol=1e-4, atol=1e-12)
    assert state.density([0.0, -1.0]).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("gamma", [1.0, 2.4, 3.3, 7.0])
def test_density_is_that_of_waveresponse(gamma: float) -> None:
    state = sea(gamma=gamma)
    omega = np.linspace(0.3, 5.0, 200)
    _, expected = JONSWAP(omega)(state.hs, state.tp, gamma=gamma)
    # Theirs has Hs through an approximation in γ, which is off by up to a few per cent.
    density = state.density(omega)
    ratio = density / expected
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-12)
    assert ratio[0] == pytest.approx(1.0, abs=0.03)


def test_every_realisation_has_the_energy_of_its_spectrum() -> None:
    for seed in range(20):
        for spreading in (None, 4):
            waves = sea(seed, spreading=spreading).waves()
            assert 4.0 * math.sqrt((waves.amplitude**2).sum() / 2.0) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize(("components", "gamma"), [(32, 3.3), (8, 1.0), (32, 2.44)])
def test_spectral_moments_are_met_in_the_mean(components: int, gamma: float) -> None:
    omega, density = expected_density(sea(gamma=gamma))
    for order in (-1, 1, 2):
        samples = []
        for seed in range(SEEDS):
            waves = sea(seed, components=components, gamma=gamma).waves()
            samples.append(float((waves.amplitude**2 * waves.frequency**order).sum() / 2.0))
        assert close_in_the_mean(np.array(samples), simpson(omega**order * density, x=omega)), order


def test_elevation_has_the_significant_wave_height() -> None:
    """Independent samples of elevation, one a seed and time: of zero mean and variance Hs²/16, nearly normal."""
    count = 4000
    samples = np.array([float(sea(seed).waves().elevation(7.0 + seed)) for seed in range(count)])
    variance = 9.0 / 16.0
    assert abs(samples.mean()) < 4.0 * math.sqrt(variance / count)
    assert abs(samples.var() - variance) < 4.0 * variance * math.sqrt(2.0 / count)
    assert (samples**4).mean() / variance**2 == pytest.approx(3.0, abs=4.0 * math.sqrt(96.0 / count))


def test_elevation_in_time_has_the_significant_wave_height() -> None:
    times = np.arange(0.0, 20000.0, 0.5)
    assert 4.0 * sea(1).waves().elevation(times).std() == pytest.approx(3.0, rel=0.01)


def pulley_heave(state: Sea) -> FloatArray:
    """Heave amplitudes (K,) of the pulley: the deck's heave, less x times its pitch (small angles)."""
    response = SeaMotion(sea=state).components().response
    return np.asarray(np.abs(response[:, 2] - 5.0714191409 * response[:, 4]))


@pytest.mark.parametrize("heading", [math.pi, 2.0, 0.3, 5.5])
def test_heave_has_the_deviation_of_response_and_spectrum(heading: float) -> None:
    """Σ a²/2 over realisations against ∫ |RAO|² S, with SciPy's interpolation of the vessel's table."""
    table = SUPPLY.deck_response[..., 2] - 5.0714191409 * SUPPLY.deck_response[..., 4]
    rao = RegularGridInterpolator((SUPPLY.frequencies, SUPPLY.headings), table)

    omega, density = expected_density(sea())
    held = np.clip(omega, SUPPLY.frequencies[0], SUPPLY.frequencies[-1])
    squared = np.abs(rao(np.column_stack([held, np.full_like(held, heading)]))) ** 2
    samples = np.array([(pulley_heave(sea(seed, heading=heading)) ** 2).sum() / 2.0 for seed in range(SEEDS)])
    assert close_in_the_mean(samples, simpson(squared * density, x=omega))


def test_headings_are_periodic() -> None:
    for heading in (0.0, 1.0, math.pi, 6.0):
        one = SeaMotion(sea=sea(heading=heading)).components()
        other = SeaMotion(sea=sea(heading=heading - 2.0 * math.pi)).components()
        np.testing.assert_allclose(other.response, one.response, rtol=0, atol=1e-12)


@pytest.mark.parametrize("s", [1, 4, 25])
def test_directions_spread_as_cos_2s(s: int) -> None:
    """The mean of cos θ under cos^2s(θ/2) is s/(s + 1); as many waves come from either side."""
    waves = [sea(seed, heading=1.0, spreading=s).waves() for seed in range(100)]
    angle = np.concatenate([w.direction for w in waves]) - 1.0
    count = len(angle)
    assert abs(np.cos(angle).mean() - s / (s + 1)) < 4.0 * np.cos(angle).std() / math.sqrt(count) + 1e-3
    assert abs(np.sin(angle).mean()) < 4.0 * np.sin(angle).std() / math.sqrt(count)


def test_phases_are_uniform_and_independent_of_frequency() -> None:
    waves = [sea(seed).waves() for seed in range(200)]
    phase = np.concatenate([w.phase for w in waves])
    frequency = np.concatenate([w.frequency for w in waves])
    bound = 4.0 / math.sqrt(len(phase))
    assert abs(np.exp(1j * phase).mean()) < bound
    assert abs(np.exp(2j * phase).mean()) < bound
    assert abs(np.corrcoef(phase, frequency)[0, 1]) < bound


def test_seed_makes_the_sea() -> None:
    one, again, other = sea(5).waves(), sea(5).waves(), sea(6).waves()
    np.testing.assert_array_equal(one.frequency, again.frequency)
    np.testing.assert_array_equal(one.phase, again.phase)
    assert not np.isclose(one.phase, other.phase).any()


def test_no_realisation_repeats_itself() -> None:
    """Frequencies are no multiples of a common one, as those of an equidistant grid are."""
    gaps = np.diff(sea(0).waves().frequency)
    assert (gaps > 0.0).all()
    assert len(np.unique(np.round(gaps, 12))) == len(gaps)


def test_gamma_of_dnv() -> None:
    """DNV-RP-C205, 3.5.5.5: 5 for Tp/√Hs ≤ 3.6, 1 from 5 on, exp(5.75 - 1.15 Tp/√Hs) between."""
    assert dnv_gamma(4.0, 7.0) == 5.0
    assert dnv_gamma(4.0, 10.1) == 1.0
    assert dnv_gamma(4.0, 8.6) == pytest.approx(math.exp(5.75 - 1.15 * 4.3))


def test_calm_sea_moves_nothing() -> None:
    assert not SeaMotion(sea=sea(hs=0.0)).components().response.any()


def _filtered(last: float, first: float = 0.2) -> Vessel:
    """A ship whose heave is exp(-4.5 (ω/1.5)^4) of the wave, at frequencies from ``first`` to ``last``."""
    frequencies, headings = np.arange(first, last + 1e-9, 0.05), np.linspace(0.0, 2.0 * math.pi, 25)
    response = np.zeros((len(frequencies), 25, 6), dtype=complex)
    response[..., 2] = _heave(frequencies)[:, None]
    return Vessel(name="own", frequencies=frequencies, headings=headings, response=response, reference_point=(0, 0, 0))


def _heave(omega: np.ndarray) -> np.ndarray:
    return np.exp(-4.5 * (omega / 1.5) ** 4)


def _outside(tp: float, low: float, high: float) -> float:
    """Share of a sea's variance (γ 3.3) outside [low, high] rad/s, by another program's spectrum."""
    omega = np.linspace(0.01, 60.0, 600_000)
    density = JONSWAP(omega)(2.0, tp, gamma=3.3)[1]
    inside = (omega >= low) & (omega <= high)
    return float(1.0 - np.trapezoid(density * inside, omega) / np.trapezoid(density, omega))


@pytest.mark.parametrize(
    ("tp", "low", "high"), [(4.0, 0.0, 1.0), (9.0, 0.0, 1.0), (12.0, 0.6, 50.0), (20.0, 0.3, 50.0)]
)
def test_share_of_a_sea_beyond_a_frequency(tp: float, low: float, high: float) -> None:
    sea = Sea(hs=2.0, tp=tp)
    outside = sea.share_below(low) + 1.0 - sea.share_below(high)
    assert outside == pytest.approx(_outside(tp, low, high), abs=2e-3)


@pytest.mark.parametrize(
    ("tp", "first", "last", "words"),
    [
        (4.0, 0.2, 1.0, r"more than 5 % of a sea's variance lies above .*'own', 0.2 to 1 rad/s: there it falls"),
        (6.0, 0.2, 1.0, "lies above"),
        (12.0, 0.6, 2.0, "lies below .*there it is held"),
        (4.0, 0.2, 2.0, None),
        (9.0, 0.2, 2.0, None),
        (14.0, 0.2, 1.0, None),
    ],
)
def test_a_sea_beyond_the_table_is_told(tp: float, first: float, last: float, words: str | None) -> None:
    sea, vessel = Sea(hs=2.0, tp=tp, components=2048), _filtered(last, first)
    if words is None:
        SeaMotion(sea=sea, vessel=vessel)
    else:
        assert _outside(tp, first, last) > 0.05
        with pytest.warns(SeaBeyondTableWarning, match=words):
            SeaMotion(sea=sea, vessel=vessel)


def test_short_waves_beyond_the_table_do_not_carry_the_ship() -> None:
    sea = Sea(hs=2.0, tp=4.0, components=2048)
    with pytest.warns(SeaBeyondTableWarning):
        motion = SeaMotion(sea=sea, vessel=_filtered(1.0))
    omega = np.linspace(0.2, 6.0, 20_000)
    density = JONSWAP(omega)(2.0, 4.0, gamma=3.3)[1]
    true = math.sqrt(np.trapezoid(_heave(omega) ** 2 * density, omega))
    held = 0.5 * _heave(np.array([1.0]))[0]
    found = math.sqrt(np.sum(np.abs(motion.components().response[:, 2]) ** 2) / 2)
    assert abs(found - true) < 0.1 * (held - true)


def test_the_default_seas_lie_within_the_shipped_table() -> None:
    source, rng = ScenarioDistribution(), np.random.default_rng(0)
    for _ in range(300):
        source.draw(rng)
    vessel = Vessel.supply()
    assert vessel.deck_table[1] is vessel.deck_response


def test_a_distribution_beyond_the_table_is_told_once() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        source, rng = ScenarioDistribution(vessel=_filtered(1.0), tp=(3.0, 6.0)), np.random.default_rng(0)
        for _ in range(50):
            source.draw(rng)
    assert len({str(each.message) for each in caught}) == 1
    assert len(caught) < 4


def test_the_narrowest_spreading_is_nearly_normal() -> None:
    # cos^2s(θ/2) goes to exp(-s θ²/4), whose variance is 2/s.
    quantiles = direction_quantiles(100)
    assert np.std(quantiles) == pytest.approx(np.sqrt(2.0 / 100.0), rel=0.01)
    expected = CosineFullSpreading(20)
    grid = np.linspace(-np.pi, np.pi, 20001)
    density = np.array([expected(1.0, angle) for angle in grid])
    below = np.cumsum(density) / density.sum()
    middle = np.array([0.05, 0.2, 0.5, 0.9])
    found = np.interp(middle, np.linspace(0.0, 1.0, len(quantiles)), direction_quantiles(20))
    np.testing.assert_allclose(found, np.interp(middle, below, grid), atol=1e-3)
