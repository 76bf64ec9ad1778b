"""Sensors: delay, sampling, resolution and noise, each against its definition."""

from __future__ import annotations

import math
from dataclasses import replace

import gymnasium
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import Channel, InvalidValue, Scenario, ScenarioDistribution, Sensors
from aframe_env.env import AFrameHeaveEnv
from aframe_env.scenario.sensors import CHANNELS, SensorBank
from aframe_env.task import PULLEY_VELOCITY_Z

PERIOD = 0.1
FloatArray = npt.NDArray[np.float64]


def readings(sensors: Sensors, truth: FloatArray, seed: int = 1) -> FloatArray:
    """Readings (T, channels) of ``truth`` (T, channels) by one row, the first at the reset."""
    bank = SensorBank(sensors, 1, PERIOD)
    bank.reset_row(0, truth[0], seed)
    out = [bank.readings[0].copy()]
    for row in truth[1:]:
        out.append(bank.measure(row[None])[0].copy())
    return np.array(out)


def record(steps: int = 60) -> FloatArray:
    """A true history (T, channels)."""
    return np.random.default_rng(0).normal(0.0, 3.0, (steps, len(CHANNELS)))


def test_ideal_sensors_read_the_truth() -> None:
    np.testing.assert_array_equal(readings(Sensors.ideal(), record()), record())


@settings(max_examples=50, deadline=None)
@given(delay=st.floats(0.0, 3.0))
def test_reading_is_the_truth_of_delay_ago(delay: float) -> None:
    """Between control steps the truth is interpolated; before the start it was what it was at the start."""
    truth = record()
    got = readings(replace(Sensors.ideal(), delay=delay), truth)
    steps = np.arange(len(truth), dtype=float)
    want = np.column_stack([np.interp(steps - delay / PERIOD, steps, column) for column in truth.T])
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-6)


@pytest.mark.parametrize("steps", [0, 1, 7])
def test_delay_of_whole_control_steps_is_exact(steps: int) -> None:
    truth = record()
    got = readings(replace(Sensors.ideal(), delay=steps * PERIOD), truth)
    np.testing.assert_array_equal(got[steps:], truth[: len(truth) - steps])
    np.testing.assert_array_equal(got[:steps], np.tile(truth[0], (steps, 1)))


@pytest.mark.parametrize(("period", "held"), [(0.0, 1), (0.1, 1), (0.3, 3), (1.0, 10)])
def test_sample_is_held_until_the_next(period: float, held: int) -> None:
    truth = record()
    got = readings(replace(Sensors.ideal(), depth_error=Channel(period=period)), truth)
    depth = CHANNELS.index("depth_error")
    np.testing.assert_array_equal(got[:, depth], truth[np.arange(len(truth)) // held * held, depth])
    np.testing.assert_array_equal(np.delete(got, depth, axis=1), np.delete(truth, depth, axis=1))


@settings(max_examples=50, deadline=None)
@given(resolution=st.floats(1e-4, 5.0))
def test_reading_is_the_nearest_step_of_the_resolution(resolution: float) -> None:
    truth = record()
    angle = CHANNELS.index("drum_angle")
    got = readings(replace(Sensors.ideal(), drum_angle=Channel(resolution=resolution)), truth)[:, angle]
    counts = got / resolution
    np.testing.assert_allclose(counts, np.round(counts), rtol=0, atol=1e-9)
    assert np.abs(got - truth[:, angle]).max() <= resolution / 2 * (1 + 1e-9)


@pytest.mark.parametrize("correlation_time", [0.0, 0.5, 5.0])
def test_noise_has_its_deviation_and_correlation(correlation_time: float) -> None:
    """First-order Gauss-Markov: autocorrelation exp(-t/τ), stationary from the start."""
    count, deviation = 40_000, 0.3
    sensors = replace(Sensors.ideal(), heave=Channel(noise=deviation, correlation_time=correlation_time))
    truth = np.full((count, len(CHANNELS)), 2.0)
    error = readings(sensors, truth)[:, 0] - 2.0
    rho = math.exp(-PERIOD / correlation_time) if correlation_time else 0.0
    independent = count * (1 - rho) / (1 + rho)
    assert abs(error.mean()) < 4.0 * deviation / math.sqrt(independent)
    squares = count * (1 - rho**2) / (1 + rho**2)
    assert abs(error.var() / deviation**2 - 1.0) < 4.0 * math.sqrt(2.0 / squares)
    lagged = np.mean(error[1:] * error[:-1]) / error.var()
    assert abs(lagged - rho) < 4.0 * math.sqrt((1 - rho**2) / count) + 4.0 / count
    first = np.array([readings(sensors, truth[:1], seed)[0, 0] - 2.0 for seed in range(1000)])
    assert abs(first.var() / deviation**2 - 1.0) < 4.0 * math.sqrt(2.0 / 1000)


def test_relative_noise_where_it_is_the_larger() -> None:
    sensors = replace(Sensors.ideal(), tension=Channel(noise=2.0, relative_noise=0.01))
    column = CHANNELS.index("tension")
    for level, deviation in ((-100.0, 2.0), (1000.0, 10.0)):
        error = readings(sensors, np.full((10_000, len(CHANNELS)), level))[:, column] - level
        assert abs(error.std() / deviation - 1.0) < 4.0 / math.sqrt(2.0 * 10_000)


def test_errors_of_channels_and_of_rows_are_independent() -> None:
    noisy = Sensors(delay=0.0, **{name: Channel(noise=1.0) for name in CHANNELS})
    truth = np.zeros((10_000, len(CHANNELS)))
    errors = np.column_stack([readings(noisy, truth, seed=1), readings(noisy, truth, seed=2)])
    correlation = np.corrcoef(errors.T) - np.eye(errors.shape[1])
    assert np.abs(correlation).max() < 4.5 / math.sqrt(10_000)


def test_rows_are_read_apart() -> None:
    """A row starts again, and the others' delayed and held readings go on as they were."""
    sensors = replace(Sensors(), delay=0.25)
    truth = record()
    bank = SensorBank(sensors, 3, PERIOD)
    for row in range(3):
        bank.reset_row(row, truth[0], seed=row)
    got = []
    for k, value in enumerate(truth[1:], start=1):
        got.append(bank.measure(np.tile(value, (3, 1)))[1].copy())
        if k == 20:
            bank.reset_row(0, truth[5], seed=9)
    np.testing.assert_array_equal(got, readings(sensors, truth, seed=1)[1:])


def episode(observation: str | Sensors, seed: int, actions: FloatArray) -> FloatArray:
    env = gymnasium.make("AFrameHeave-v0", observation=observation, scenario=ScenarioDistribution(hs=(2.0, 4.0)))
    out = [env.reset(seed=seed)[0]]
    for action in actions:
        out.append(env.step(action)[0])
        assert env.observation_space.contains(out[-1])
    return np.array(out)


ACTIONS = np.random.default_rng(5).uniform(-2.0, 2.0, (200, 1)).astype(np.float32)


def test_episode_of_ideal_sensors_shows_the_state() -> None:
    """Shared quantities of the two observations are the same numbers; roll and pitch those of the sea's motion."""
    sensed, state = episode(Sensors.ideal(), 3, ACTIONS), episode("state", 3, ACTIONS)
    np.testing.assert_array_equal(sensed[:, [0, 1, 4, 5, 6, 7, 8]], state[:, [6, 7, 9, 10, 11, 0, 12]])
    np.testing.assert_array_equal(sensed[:, 9], state[0, 13])
    env = gymnasium.make("AFrameHeave-v0", scenario=ScenarioDistribution(hs=(2.0, 4.0))).unwrapped
    env.reset(seed=3)
    scenario: Scenario = env.scenario  # type: ignore[attr-defined]
    times = np.arange(201) * PERIOD
    s = np.minimum(times / scenario.ramp, 1.0)
    factor = s**3 * (10 - 15 * s + 6 * s**2)
    angles = factor[:, None] * scenario.motion.components().at(times)[0][:, 3:5]  # type: ignore[union-attr]
    np.testing.assert_allclose(sensed[:, 2:4], angles, rtol=0, atol=1e-7)


def test_seed_makes_the_readings() -> None:
    one, again, other = (episode("sensors", seed, ACTIONS) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, again)
    assert np.isfinite(one).all()
    assert (one[1:, :2] != other[1:, :2]).all()


def test_channel_may_be_later_than_the_others() -> None:
    sensors = replace(Sensors.ideal(), delay=0.25, depth_error=Channel(delay=0.8))
    truth = np.random.default_rng(2).normal(size=(40, len(CHANNELS)))
    found = readings(sensors, truth, seed=1)
    # 2.5 and 10.5 control steps ago.
    np.testing.assert_allclose(found[12:, 0], 0.5 * (truth[10:-2, 0] + truth[9:-3, 0]), rtol=0, atol=1e-12)
    depth = CHANNELS.index("depth_error")
    np.testing.assert_allclose(found[12:, depth], 0.5 * (truth[2:-10, depth] + truth[1:-11, depth]), rtol=0, atol=1e-12)


def test_transponder_takes_the_sounds_time() -> None:
    channel = Sensors.transponder(3000.0).depth_error
    assert (channel.delay, channel.period) == (2.0, 5.0)
    assert Sensors.transponder(0.0, delay=0.2).delay == 0.2
    with pytest.raises(InvalidValue, match="depth = -3"):
        Sensors.transponder(-3.0)


def test_rows_may_be_late_by_delays_of_their_own():
    late, own, longer = (SensorBank(Sensors(delay=d), 1, 0.1) for d in (0.1, 0.25, 0.43))
    bank = SensorBank(Sensors(delay=0.1), 3, 0.1)
    truth = np.random.default_rng(0).normal(size=(30, len(CHANNELS)))
    for alone, index, delay in ((late, 0, None), (own, 1, 0.25), (longer, 2, 0.43)):
        alone.reset_row(0, truth[0], seed=5)
        bank.reset_row(index, truth[0], seed=5, delay=delay)
    for step, now in enumerate(truth[1:]):
        if step == 10:
            # One that has gone on for some time, in a bank that has never had a row so late.
            other = SensorBank(Sensors(delay=0.1), 1, 0.1)
            other.write_row(0, bank.copy_row(2), delay=0.43)
        together = bank.measure(np.tile(now, (3, 1)))
        apart = [alone.measure(now[None])[0] for alone in (late, own, longer)]
        assert np.array_equal(together, apart)
        if step >= 10:
            assert np.array_equal(other.measure(now[None])[0], apart[2])
    assert not np.array_equal(together[0], together[2])


def test_a_scenario_may_have_a_delay_of_its_own():
    late = Scenario(sensor_delay=0.3)
    sensors = Sensors.ideal()
    env = AFrameHeaveEnv(scenario=late, observation=sensors)
    env.reset(seed=0)
    pulley, readings = [], []
    for _ in range(20):
        readings.append(env.step(np.ones(1, dtype=np.float32))[0][1])
        pulley.append(env.simulation.state[0, PULLEY_VELOCITY_Z])
    assert readings[5:] == pytest.approx(pulley[2:-3], abs=1e-6)
