"""The filters against Gaussian conditioning on all readings at once: the same estimate without any recursion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.signal import freqs, lsim

from aframe_env.scenario.motion_unit import MotionUnit
from aframe_env.scenario.sensors import Sensors
from agents.control.expected_waves import ExpectedWaves
from agents.control.rope import RopeModel
from agents.control.rope_filter import ACCELERATION_NOISE, RopeFilter
from agents.control.wave_bank import WaveBank
from agents.control.wave_filter import WaveFilter

PERIOD = 0.1
WAVES = ExpectedWaves(frequency=(0.5, 0.8, 1.3), variances=((0.02, 0.2, 0.07),), build_up=1.0)


def conditioned(a, start, stirs, rows, readings, noises):
    """Mean of the last state, given readings[k] (m,) = rows[k] (m, n) @ state k + noise; state 0 has none."""
    steps, n = len(stirs), len(a)
    # All states are linear in the first one and the stirs.
    sources = block_diag(start, *stirs)
    to_state = [np.hstack([np.eye(n), np.zeros((n, n * steps))])]
    for k in range(steps):
        step = a @ to_state[-1]
        step[:, n * (k + 1) : n * (k + 2)] += np.eye(n)
        to_state.append(step)
    seen = np.vstack([rows[k] @ to_state[k + 1] for k in range(steps)])
    noise = np.diag(np.concatenate(noises) ** 2)
    gain = to_state[-1] @ sources @ seen.T @ np.linalg.inv(seen @ sources @ seen.T + noise)
    return gain @ np.concatenate(readings)


@pytest.mark.parametrize("build_up", [1.0, 0.0], ids=["from rest", "moves already"])
def test_the_wave_filter_is_the_conditional_mean(build_up):
    waves = replace(WAVES, build_up=build_up)
    bank = WaveBank(waves=waves, rate_noise=0.012, depth_noise=0.05, damping=0.05, offset_drift=1e-4)
    variance = np.array(WAVES.variance)
    hold, steps = 5, 23
    rng = np.random.default_rng(2)
    rates, depths = rng.normal(0.0, 0.5, steps), rng.normal(0.0, 0.3, steps)
    filtered = WaveFilter(2, PERIOD, hold, bank)
    exponent = -bank.damping + 1j * np.array(WAVES.frequency)
    a = block_diag(*[np.exp(z.real * PERIOD) * rotation(z.imag * PERIOD) for z in exponent], 1.0)
    see_rate = np.array([1.0, 0.0] * 3 + [0.0])
    # The integral of Re(s exp(λ t)) is Re(s exp(λ t) / λ).
    see_depth = np.append(np.stack([(1 / exponent).real, -(1 / exponent).imag], axis=1).ravel(), 1.0)
    stirs, rows, readings, noises = [], [], [], []
    for k in range(1, steps + 1):
        filtered.advance(np.array([rates[k - 1], 0.0]))
        filtered.correct(np.array([depths[k - 1], 0.0]) - filtered.heave())
        grow = 2.0 * PERIOD / build_up if k * PERIOD < build_up else 1.0 - np.exp(-2.0 * bank.damping * PERIOD)
        stirred = np.stack([2.0 * variance * grow, np.zeros(3)], axis=1).ravel()
        stirs.append(np.diag(np.append(stirred, bank.offset_drift * PERIOD)))
        there = k % hold == 0
        rows.append(np.array([see_rate, see_depth] if there else [see_rate]))
        readings.append(np.array([rates[k - 1], depths[k - 1]] if there else [rates[k - 1]]))
        noises.append(np.array([bank.rate_noise, bank.depth_noise] if there else [bank.rate_noise]))
    # A ship that moves already has the whole variance in both parts of every oscillator.
    start = np.diag(np.append(np.zeros(6) if build_up else np.repeat(variance, 2), 1e-6))
    want = conditioned(a, start, stirs, rows, readings, noises)
    assert filtered.heave()[0] == pytest.approx(see_depth @ want, rel=1e-6)
    assert filtered.rate(np.array([0.0]))[0, 0] == pytest.approx(see_rate @ want, rel=1e-6)
    ahead = np.linspace(0.0, 1.5, 1501)
    rate = filtered.rate(ahead)[:, 0]
    assert filtered.path(ahead[-1:])[0, 0] == pytest.approx(np.trapezoid(rate, ahead), abs=1e-6)
    phasors = filtered.phasors()[0] * np.exp(np.outer([0.0, 1.5], filtered.exponents))
    assert np.diff(phasors.real.sum(axis=1))[0] == pytest.approx(filtered.path(ahead[-1:])[0, 0], abs=1e-12)
    step = 1e-4
    around = filtered.rate(np.array([0.7 - step, 0.7 + step]))[:, 0]
    assert filtered.acceleration(np.array([0.7]))[0, 0] == pytest.approx(
        (around[1] - around[0]) / (2.0 * step), abs=1e-6
    )
    assert filtered.heave()[1] == 0.0  # the other row's readings were all zero


@pytest.mark.parametrize("build_up", [1.0, 0.0], ids=["from rest", "moves already"])
def test_kinds_of_sea_count_by_the_likelihood_of_all_readings_at_the_height_that_suits_each_best(build_up):
    kinds = ((0.02, 0.2, 0.07), (0.2, 0.02, 0.01), (0.01, 0.03, 0.2))
    steps, rng = 40, np.random.default_rng(5)
    noise, damping = 1e-3, 0.05
    waves = ExpectedWaves(frequency=WAVES.frequency, variances=kinds, build_up=build_up)
    bank = WaveBank(waves=waves, rate_noise=noise, depth_noise=np.inf, damping=damping, offset_drift=0.0)
    readings = 0.4 * np.cos(0.8 * PERIOD * np.arange(1, steps + 1)) + 0.02 * rng.normal(size=steps)
    filtered = WaveFilter(1, PERIOD, 1, bank)
    for reading in readings:
        filtered.advance(np.array([reading]))
    # Covariance of all readings at once: each oscillator is a damped, turning, stirred pair of its own.
    log_likelihood, alone = [], []
    for variance in kinds:
        covariance = noise**2 * np.eye(steps)
        for omega, size in zip(WAVES.frequency, variance, strict=True):
            turn = np.exp(-damping * PERIOD) * rotation(omega * PERIOD)
            state = np.eye(2) * (0.0 if build_up else size)
            states = []
            for k in range(1, steps + 1):
                grow = 2.0 * PERIOD / build_up if k * PERIOD < build_up else 1.0 - np.exp(-2.0 * damping * PERIOD)
                state = turn @ state @ turn.T + np.diag([2.0 * size * grow, 0.0])
                states.append(state)
            for j in range(steps):
                ahead = states[j]
                for i in range(j, steps):
                    covariance[i, j] += ahead[0, 0]
                    if i > j:
                        covariance[j, i] += ahead[0, 0]
                    ahead = turn @ ahead
        height = readings @ np.linalg.solve(covariance, readings) / steps
        log_likelihood.append(-0.5 * (steps * np.log(height) + np.linalg.slogdet(covariance)[1]))
        one = WaveFilter(1, PERIOD, 1, replace(bank, waves=replace(waves, variances=(variance,))))
        for reading in readings:
            one.advance(np.array([reading]))
        alone.append(one.path(np.array([1.0]))[0, 0])
    likelihood = np.exp(np.array(log_likelihood) - max(log_likelihood))
    assert filtered.probability[0] == pytest.approx(likelihood / likelihood.sum(), rel=1e-4, abs=1e-12)
    assert filtered.path(np.array([1.0]))[0, 0] == pytest.approx(filtered.probability[0] @ alone, rel=1e-9)


def test_a_kind_of_sea_is_found_out_and_foretold_as_if_it_were_known():
    frequency = tuple(np.linspace(0.4, 1.4, 21))
    kinds = tuple(tuple(1e-4 + 0.05 * np.exp(-(((np.array(frequency) - f) / 0.08) ** 2))) for f in (0.6, 0.8, 1.0, 1.2))
    waves = ExpectedWaves(frequency=frequency, variances=kinds, build_up=0.0)
    rng, rows = np.random.default_rng(3), 40
    phase, size = rng.uniform(0.0, 2.0 * np.pi, (rows, 21)), np.sqrt(2.0 * np.array(kinds[2]))

    def heave_rate(time):
        return (size * np.cos(np.array(frequency) * time + phase)).sum(axis=1)

    bank = WaveBank(waves=waves, rate_noise=0.005, depth_noise=np.inf)
    mixed, told = (
        WaveFilter(rows, PERIOD, 1, bank),
        WaveFilter(rows, PERIOD, 1, replace(bank, waves=replace(waves, variances=kinds[2:3]))),
    )
    for k in range(400):
        for each in (mixed, told):
            each.advance(heave_rate(k * PERIOD))
    assert np.median(mixed.probability[:, 2]) > 0.95
    ahead = np.array([3.0])
    truth = heave_rate(399 * PERIOD + 3.0)
    missed = [np.sqrt(np.mean((each.rate(ahead)[0] - truth) ** 2)) for each in (mixed, told)]
    assert missed[0] < 1.05 * missed[1]
    mixed.start(np.array([1]))
    assert mixed.probability[1] == pytest.approx(np.full(4, 0.25))
    assert mixed.probability[0, 2] > 0.5


def rotation(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def test_the_rope_filter_is_the_conditional_mean():
    frequency, noise, rate_noise, steps = np.array([1.5, 3.0]), np.array([0.01, 0.004]), 0.02, 15
    rng = np.random.default_rng(4)
    stretch = rng.normal(0.0, 0.05, (steps, 2))
    model = RopeModel.of(frequency, 0.03, PERIOD)
    rope = RopeFilter(2, rate_noise)
    rope.start(model, PERIOD, noise)
    for reading in stretch:
        rope.advance(np.zeros(2), reading)
    # The fourth is the bias of the reading: the first one's error, which does not change.
    see = np.array([[-1.0, 0.0, 1.0, 1.0]])
    for i in range(2):
        a, b = block_diag(model.a[i, :3, :3], 1.0), np.append(model.b[i, :3], 0.0)
        process_noise = rate_noise**2 * np.outer(b, b) + np.diag([0.0, (ACCELERATION_NOISE * PERIOD) ** 2, 0.0, 0.0])
        start = np.diag([1e-4, 1e-4, 1e-4, noise[i] ** 2])
        arguments = ([process_noise] * steps, [see] * steps, stretch[:, i : i + 1], [noise[i : i + 1]] * steps)
        want = conditioned(a, start, *arguments)
        assert rope.load_velocity[i] == pytest.approx(want[1], rel=1e-6)
        assert rope.stretch[i] == pytest.approx(want[2] - want[0], rel=1e-6)


def test_the_rope_filter_follows_a_load_that_it_is_told_of_exactly():
    """The end of the rope swings to and fro; the estimates are those of the rope's own model."""
    model = RopeModel.of(np.array([2.0]), 0.03, PERIOD)
    rope = RopeFilter(1, 0.01)
    rope.start(model, PERIOD, np.array([1e-6]))
    z = np.zeros((1, 4))
    for k in range(200):
        speed = np.array([0.5 * np.cos(0.7 * k * PERIOD)])
        z[:, 3] = 0.0
        z = model.advance(z, speed)
        rope.advance(speed, z[:, 2] - z[:, 0])
    assert rope.load_velocity[0] == pytest.approx(z[0, 1], abs=1e-6)
    assert abs(z[0, 1]) > 0.05


def two_sines(times):
    """Heave rate and heave, m/s and m."""
    w1, w2 = 0.65, 0.95
    return (
        0.6 * np.cos(w1 * times) + 0.4 * np.cos(w2 * times + 1.0),
        0.6 / w1 * np.sin(w1 * times) + 0.4 / w2 * np.sin(w2 * times + 1.0),
    )


def test_two_sines_are_foretold():
    """Once the filter has followed them, 0.1 s to 2 s ahead; a held value would be off by 2 sin(ω τ / 2)."""
    sea = ExpectedWaves(frequency=tuple(np.linspace(0.35, 1.6, 48)), variances=((0.26 / 48,) * 48,), build_up=10.0)
    waves = WaveFilter(2, PERIOD, 10, WaveBank.of(sea, Sensors()))
    ahead = np.array([0.1, 0.5, 2.0])
    missed_rate, missed_path, held = [], [], []
    for k in range(1500):
        now = k * PERIOD
        rate, heave = two_sines(now)
        waves.advance(np.array([rate, 0.0]))
        if k > 600:
            later_rate, later_heave = two_sines(now + ahead)
            missed_rate.append(waves.rate(ahead)[:, 0] - later_rate)
            missed_path.append(waves.path(ahead)[:, 0] - (later_heave - heave))
            held.append(rate - later_rate)
    rms, held_rms = np.sqrt(np.mean(np.square(missed_rate), axis=0)), np.sqrt(np.mean(np.square(held), axis=0))
    power = 0.5 * (0.6 * 2.0 * np.sin(0.5 * 0.65 * ahead)) ** 2 + 0.5 * (0.4 * 2.0 * np.sin(0.5 * 0.95 * ahead)) ** 2
    assert held_rms == pytest.approx(np.sqrt(power), rel=0.05)
    assert (rms < 0.35 * held_rms).all()
    assert (np.sqrt(np.mean(np.square(missed_path), axis=0)) < 0.35 * ahead * held_rms).all()
    assert not waves.rate(ahead)[:, 1].any()  # the other row's sea is none of this one's


def test_a_bias_of_the_stretch_is_told_from_the_bobbing():
    """The first reading said too much weight: the load's stretch is off by the same all along, and does not swing."""
    model, bias, noise = RopeModel.of(np.array([2.0]), 0.03, PERIOD), 0.02, np.array([0.02])
    rope = RopeFilter(1, 0.01)
    rope.start(model, PERIOD, noise)
    z, left = np.zeros((1, 4)), []
    for k in range(600):
        speed = np.array([0.3 * np.cos(0.7 * k * PERIOD)])
        z[:, 3] = 0.0
        z = model.advance(z, speed)
        rope.advance(speed, z[:, 2] - z[:, 0] + bias)
        left.append(rope.stretch[0] - (z[0, 2] - z[0, 0]))
    assert np.abs(left[300:]).max() < 0.25 * bias


def washed_out(unit, frequency, times):
    """Heave rate (T,) of cos(w t), and what a unit reads of it by scipy's word."""
    cutoff = 2.0 * np.pi / unit.heave_period
    _, (passed,) = freqs([1.0, 0.0, 0.0], [1.0, 2.0 * unit.heave_damping * cutoff, cutoff**2], [frequency])
    return np.cos(frequency * times), (passed * np.exp(1j * frequency * times)).real


@pytest.mark.parametrize("dropouts", [False, True])
def test_the_wave_filter_undoes_a_units_heave_filter(dropouts):
    unit, times = MotionUnit(heave_period=20.0, dropouts=2.0), PERIOD * np.arange(600)
    waves = replace(WAVES, frequency=(0.4, 0.6, 0.8, 1.0), variances=((0.1, 0.1, 0.1, 0.1),), build_up=0.0)
    bank = WaveBank(waves=waves, rate_noise=0.02, depth_noise=np.inf)
    rate, read = washed_out(unit, 0.8, times)
    heard = np.array([not dropouts or k % 100 < 80 for k in range(600)])
    # What is not heard for two seconds in ten leaves more to be guessed of the unit's filter, too.
    for each, error in ((replace(bank, unit=unit), 0.08 if dropouts else 0.03), (bank, None)):
        found = WaveFilter(1, PERIOD, 10, each)
        found.start()
        if found.finds:
            found.find(read[:1], np.zeros(1))
        told = [found.rate(np.zeros(1))[0, 0]]
        for k in range(1, 600):
            last = read[k] if heard[k] else 7.0  # what is not heard counts for nothing
            found.advance(np.array([last]), heard[k : k + 1])
            told.append(found.rate(np.zeros(1))[0, 0])
        off = np.abs(np.array(told) - rate)[300:]
        assert off.max() < error if error else off.max() > 0.4


def test_the_wave_filter_undoes_a_units_heave_filter_in_waves_that_come_in_groups():
    """Readings by scipy's integration of the unit's filter, whose memory is as long as the groups."""
    unit, times = MotionUnit(heave_period=20.0), PERIOD * np.arange(900)
    rate = 0.5 * (1.0 - np.cos(2.0 * np.pi * times / 40.0)) * np.cos(0.8 * times)
    cutoff = 2.0 * np.pi / unit.heave_period
    _, read, _ = lsim(([1.0, 0.0, 0.0], [1.0, 2.0 * unit.heave_damping * cutoff, cutoff**2]), rate, times)
    waves = replace(WAVES, frequency=(0.4, 0.6, 0.8, 1.0), variances=((0.1, 0.1, 0.1, 0.1),), build_up=0.0)
    found = WaveFilter(1, PERIOD, 10, WaveBank(waves=waves, rate_noise=0.02, depth_noise=np.inf, unit=unit))
    found.start()
    found.find(read[:1], np.zeros(1))
    told = [0.0]
    for k in range(1, len(times)):
        found.advance(read[k : k + 1])
        told.append(found.rate(np.zeros(1))[0, 0])
    off = np.array(told) - rate
    assert np.sqrt(np.mean(off[100:] ** 2)) < 0.05 * np.sqrt(np.mean(rate[100:] ** 2))


def test_the_first_readings_find_a_moving_ship():
    unit = MotionUnit()
    waves = replace(WAVES, build_up=0.0)
    found = WaveFilter(3, PERIOD, 10, WaveBank(waves=waves, rate_noise=0.02, depth_noise=0.05, unit=unit))
    found.start()
    found.find(np.array([0.2]), np.array([1.1]), np.array([1]))
    assert found.heave()[1] == pytest.approx(1.1, abs=0.05)
    assert not found.heave()[[0, 2]].any()
