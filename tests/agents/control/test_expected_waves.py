"""The expected spectrum against long records of the pulley's heave rate, and where there is little to expect."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.signal import welch

from aframe_env import Harmonic, HarmonicMotion, InvalidValue, RecordedMotion, Scenario, ScenarioDistribution
from aframe_env.scenario.motion import has_components
from aframe_env.scenario.sea import SeaMotion
from agents.control import expected_waves
from agents.control.expected_waves import BANDS, KINDS, LEAST_VARIANCE, LEAST_WIDTH, SCENARIOS, WIDEST, ExpectedWaves
from agents.rollout import held_out_scenarios

SAMPLING = 0.25


def heave_rate(scenario, times):
    """Velocity (T,) m/s of the pulley, from the deck's own motion by differences."""
    x, y, _ = scenario.crane.pulley_position
    components = scenario.motion.components()
    phases = np.exp(1j * np.outer(times, components.frequency))
    heave, roll, pitch = (phases @ components.response[:, i] for i in (2, 3, 4))
    return np.gradient((heave + y * roll - x * pitch).real, times[1] - times[0])


def cumulated(frequency, variance):
    total = np.cumsum(variance)
    return np.asarray(frequency), total / total[-1]


def one_sea(**changes):
    distribution = ScenarioDistribution(hs=2.5, tp=9.0, heading=2.5, load_mass=5e4, rope_length=500.0, **changes)
    return distribution.draw(np.random.default_rng(1))


def test_of_one_sea_it_is_the_spectrum_of_other_realisations_of_it():
    scenario = one_sea(components=60)
    assert isinstance(scenario.motion, SeaMotion)
    waves = ExpectedWaves.of(scenario)
    times = SAMPLING * np.arange(4800)
    variances, spectra = [], []
    for seed in range(40):
        sea = dataclasses.replace(scenario.motion.sea, seed=1000 + seed)
        record = heave_rate(dataclasses.replace(scenario, motion=dataclasses.replace(scenario.motion, sea=sea)), times)
        variances.append(record.var())
        hertz, density = welch(record, fs=1.0 / SAMPLING, nperseg=1200)
        spectra.append(density)
    assert sum(waves.variance) == pytest.approx(np.mean(variances), rel=0.1)
    frequency, shares = cumulated(2.0 * np.pi * hertz, np.mean(spectra, axis=0))
    middle, expected = cumulated(waves.frequency, waves.variance)
    step = middle[1] - middle[0]
    between = np.interp(middle + 0.5 * step, frequency + 0.5 * (frequency[1] - frequency[0]), shares)
    np.testing.assert_allclose(expected, between, atol=0.05)


def test_of_a_distribution_the_kinds_have_the_mean_shape_of_all_seas_and_the_size_of_a_middling_one():
    source = ScenarioDistribution()
    waves = ExpectedWaves.of(source)
    rng = np.random.default_rng(99)
    times = SAMPLING * np.arange(2400)
    spectra, variances = [], []
    for _ in range(150):
        record = heave_rate(source.draw(rng), times)
        hertz, density = welch(record, fs=1.0 / SAMPLING, nperseg=600)
        spectra.append(density / density.sum())
        variances.append(record.var())
    assert len(waves.variances) == KINDS
    assert np.sum(waves.variances, axis=1) == pytest.approx(np.exp(np.mean(np.log(variances))), rel=0.3)
    frequency, shares = cumulated(2.0 * np.pi * hertz, np.mean(spectra, axis=0))
    middle, expected = cumulated(waves.frequency, waves.variance)
    step = middle[1] - middle[0]
    between = np.interp(middle + 0.5 * step, frequency + 0.5 * (frequency[1] - frequency[0]), shares)
    np.testing.assert_allclose(expected, between, atol=0.06)
    assert len(waves.frequency) == BANDS
    assert waves.build_up == source.ramp


def test_kinds_go_from_the_longest_waves_to_the_shortest_and_each_is_narrower_than_their_mean():
    waves = ExpectedWaves.of(ScenarioDistribution())
    frequency, variances = np.array(waves.frequency), np.array(waves.variances)
    mean = variances @ frequency / variances.sum(axis=1)
    assert (np.diff(mean) > 0.0).all()
    assert mean[-1] > 1.4 * mean[0]

    def width(variance):
        share = variance / variance.sum()
        return np.sqrt(share @ (frequency - share @ frequency) ** 2)

    assert np.median([width(each) for each in variances]) < 0.95 * width(np.array(waves.variance))


def test_of_one_scenario_there_is_one_kind():
    assert len(ExpectedWaves.of(one_sea()).variances) == 1


def test_of_a_ship_at_rest_it_is_next_to_nothing():
    waves = ExpectedWaves.of(Scenario(motion=HarmonicMotion()))
    assert sum(waves.variance) == pytest.approx(LEAST_VARIANCE, rel=0.01)
    assert min(waves.variance) > 0.0
    assert 0.0 < waves.frequency[0] < waves.frequency[-1]


@pytest.mark.parametrize("period", [5.0, 9.0, 14.0])
def test_of_a_regular_wave_it_is_at_its_frequency(period):
    amplitude = 0.7
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=amplitude, period=period),))
    waves = ExpectedWaves.of(Scenario(motion=motion, ramp=0.0))
    frequency, variance = np.array(waves.frequency), np.array(waves.variance)
    omega = 2.0 * np.pi / period
    assert variance.sum() == pytest.approx(0.5 * (amplitude * omega) ** 2, rel=1e-2)
    assert np.average(frequency, weights=variance) == pytest.approx(omega, abs=0.01)
    assert variance[abs(frequency - omega) < 0.02].sum() > 0.95 * variance.sum()
    assert waves.build_up == 0.0


@pytest.mark.parametrize(
    ("period", "end"), [(1.0, WIDEST[1]), (2.0, WIDEST[1]), (120.0, WIDEST[0]), (900.0, WIDEST[0])]
)
def test_a_motion_beyond_the_bands_is_in_those_at_that_end(period, end):
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=0.5, period=period),))
    waves = ExpectedWaves.of(Scenario(motion=motion))
    frequency, variance = np.array(waves.frequency), np.array(waves.variance)
    assert (np.diff(frequency) > 0.0).all()
    assert WIDEST[0] - 1e-12 <= frequency[0] < frequency[-1] <= WIDEST[1] + 1e-12
    assert np.ptp(frequency) > 0.99 * LEAST_WIDTH
    assert abs(np.average(frequency, weights=variance) - end) < 0.02


def test_of_a_record_it_is_its_periodogram():
    times = np.arange(0.0, 400.0, 0.1)
    coordinates = np.zeros((len(times), 6))
    parts = ((0.6, 0.7), (0.4, 1.1))
    coordinates[:, 2] = sum(a * np.sin(w * times + w) for a, w in parts)
    waves = ExpectedWaves.of(Scenario(motion=RecordedMotion(times=times, coordinates=coordinates)))
    frequency, variance = np.array(waves.frequency), np.array(waves.variance)
    assert variance.sum() == pytest.approx(sum(0.5 * (a * w) ** 2 for a, w in parts), rel=0.05)
    for a, w in parts:
        assert variance[abs(frequency - w) < 0.06].sum() == pytest.approx(0.5 * (a * w) ** 2, rel=0.15)


def test_held_out_scenarios_are_not_drawn(monkeypatch):
    source = ScenarioDistribution(hs=(1.0, 2.0))
    drawn = []

    class Watched(ScenarioDistribution):
        def draw(self, rng):
            drawn.append(super().draw(rng))
            return drawn[-1]

    ExpectedWaves.of(Watched(hs=(1.0, 2.0)))
    assert len(drawn) == SCENARIOS
    kept = {scenario.motion for scenario in held_out_scenarios(source, 200)}
    assert all(has_components(motion) for motion in kept)
    assert not kept & {scenario.motion for scenario in drawn}


def test_of_one_scenario_its_own_waves_are_not_looked_at(monkeypatch):
    scenario = one_sea()
    looked_at = []
    spectra = expected_waves._spectra
    monkeypatch.setattr(expected_waves, "_spectra", lambda each: spectra(looked_at.extend(each) or looked_at))
    other = dataclasses.replace(scenario, load_mass=1.01 * scenario.load_mass)  # one that is not cached yet
    ExpectedWaves.of(other)
    assert len(looked_at) == SCENARIOS
    assert scenario.motion.sea.seed not in {each.motion.sea.seed for each in looked_at}


def test_the_same_source_is_reckoned_once():
    assert ExpectedWaves.of(ScenarioDistribution()) is ExpectedWaves.of(ScenarioDistribution())
    assert ExpectedWaves.of(ScenarioDistribution(hs=4.0)) != ExpectedWaves.of(ScenarioDistribution(hs=1.0))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"variances": ((0.1, 0.1), (0.1,))}, "2 frequencies and 1 variances"),
        ({"variances": ()}, "no variances of waves"),
        ({"frequency": (0.0, 1.0)}, r"frequency = 0.0 rad/s"),
        ({"variances": ((0.1, 0.0),)}, r"variance = 0.0 m²/s²"),
        ({"build_up": -1.0}, r"build_up = -1.0 s"),
        ({"build_up": math.inf}, r"build_up = inf s"),
    ],
)
def test_bad_waves_are_refused(changes, words):
    with pytest.raises(InvalidValue, match=words):
        ExpectedWaves(**{"frequency": (0.5, 1.0), "variances": ((0.1, 0.1),), "build_up": 5.0, **changes})
