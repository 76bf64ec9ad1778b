"""The motion reference unit: its heave filter against scipy's, its errors against their statistics."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from scipy import signal
from scipy.linalg import solve_continuous_lyapunov

from aframe_env import Harmonic, HarmonicMotion, InvalidValue, MotionUnit, Scenario, Sensors, TaskConfig
from aframe_env.env import AFrameHeaveEnv
from aframe_env.scenario.motion_unit import Past
from aframe_env.scenario.sensors import CHANNELS, SensorBank

PERIOD = 0.1
FloatArray = npt.NDArray[np.float64]
FREQUENCY, DAMPING = 2.0 * math.pi / 20.0, 0.707
DENOMINATOR = [1.0, 2.0 * DAMPING * FREQUENCY, FREQUENCY**2]


def ideal(unit: MotionUnit, delay: float = 0.0) -> Sensors:
    return replace(Sensors.ideal(), motion_unit=unit, delay=delay)


def read(sensors: Sensors, truth: FloatArray, seed: int = 1, past: Past | None = None) -> FloatArray:
    """Readings (T, channels) of ``truth`` (T, channels) by one row, the first at the reset."""
    bank = SensorBank(sensors, 1, PERIOD)
    bank.reset_row(0, truth[0], seed, past=past)
    return np.array([bank.readings[0].copy(), *(bank.measure(line[None])[0].copy() for line in truth[1:])])


def at_rest(steps: int) -> FloatArray:
    return np.zeros((steps, len(CHANNELS)))


def of_heave(heave: FloatArray, rate: FloatArray) -> FloatArray:
    truth = at_rest(len(heave))
    truth[:, 0], truth[:, 1] = heave, rate
    return truth


@pytest.mark.parametrize("period", [5.0, 9.0, 14.0, 20.0])
def test_gain_and_phase_are_those_of_a_second_order_high_pass(period):
    w, times = 2.0 * math.pi / period, PERIOD * np.arange(2000)
    got = read(ideal(MotionUnit()), of_heave(np.sin(w * times), w * np.cos(w * times)))[1000:]
    _, (passed,) = signal.freqs([1.0, 0.0, 0.0], DENOMINATOR, [w])
    steady = passed * np.exp(1j * w * times[1000:])
    np.testing.assert_allclose(got[:, 0], steady.imag, rtol=0, atol=1e-3)
    np.testing.assert_allclose(got[:, 1], (1j * w * steady).imag, rtol=0, atol=1e-3)
    assert MotionUnit().passed(np.array([1j * w]))[0] == pytest.approx(passed, abs=1e-12)


def test_transient_from_rest_is_that_of_the_filter():
    times = np.arange(0.0, 60.0, PERIOD)
    rise = np.where(times < 10.0, np.sin(0.05 * math.pi * times) ** 2, 1.0)
    rate = np.where(times < 10.0, 0.05 * math.pi * np.sin(0.1 * math.pi * times), 0.0)
    got = read(ideal(MotionUnit()), of_heave(3.0 + rise, rate))
    _, want, _ = signal.lsim(([1.0, 0.0, 0.0], DENOMINATOR), rise, times)
    np.testing.assert_allclose(got[:, 0], want, rtol=0, atol=1e-3)
    _, want, _ = signal.lsim(([1.0, 0.0, 0.0], DENOMINATOR), rate, times)
    np.testing.assert_allclose(got[:, 1], want, rtol=0, atol=1e-3)


@pytest.mark.parametrize("delay", [0.0, 0.37])
def test_on_a_moving_ship_it_has_been_running_for_long(delay):
    waves = [("heave", 1.0, 9.0, 0.4), ("roll", 0.1, 12.0, 1.0), ("pitch", 0.05, 7.0, 2.0)]
    motion = HarmonicMotion(
        harmonics=tuple(Harmonic(coordinate=c, amplitude=a, period=p, phase=f) for c, a, p, f in waves)
    )
    scenario = Scenario(motion=motion)
    x, y, _ = scenario.crane.pulley_position
    coordinates, rates, _ = motion.components().at(PERIOD * np.arange(-1500, 200))
    truth = at_rest(1700)
    for column, each in enumerate((coordinates, rates)):
        truth[:, column] = each[:, 2] + y * each[:, 3] - x * each[:, 4]
    truth[:, 2:4] = coordinates[:, 3:5]
    truth[:, CHANNELS.index("depth_error")] = truth[:, 0]
    sensors = ideal(MotionUnit(lever_arm_error=2.0, angle_bias=0.01), delay)
    for_long = read(sensors, truth)[1500:]
    started = read(sensors, truth[1500:], past=Past.of(scenario))
    np.testing.assert_allclose(started, for_long, rtol=0, atol=2e-3)
    still = read(sensors, truth[1500:])
    assert np.abs(still - for_long)[:50].max() > 0.1


def test_a_past_is_known_of_a_ship_that_moves_in_waves():
    assert Past.of(Scenario(ramp=5.0)) is None
    assert Past.of(Scenario()) is not None


def test_lever_arm_lets_roll_and_pitch_leak_by_its_geometry():
    times = PERIOD * np.arange(1500)
    roll, pitch = 0.1 * np.sin(2 * math.pi * times / 11.0), 0.06 * np.sin(2 * math.pi * times / 8.0 + 1.0)
    truth = at_rest(len(times))
    truth[:, 2], truth[:, 3] = roll, pitch
    # Heights of points 1 m aft and 1 m to port, by the third line of the ZYX rotation.
    aft, port = -np.sin(pitch), np.cos(pitch) * np.sin(roll)
    leaks = [signal.lsim(([1.0, 0.0, 0.0], DENOMINATOR), each, times)[1] for each in (aft, port)]
    arms = []
    for seed in range(60):
        leaked = read(ideal(MotionUnit(lever_arm_error=0.5)), truth, seed)[600:, 0]
        arm, *_ = np.linalg.lstsq(np.stack(leaks, axis=1)[600:], leaked, rcond=None)
        np.testing.assert_allclose(np.stack(leaks, axis=1)[600:] @ arm, leaked, rtol=0, atol=2e-3)
        arms.append(arm)
    assert np.std(arms) == pytest.approx(0.5, rel=4.0 / math.sqrt(2 * 120))


def test_rate_of_the_leak_is_the_derivative_of_the_leak():
    times = PERIOD * np.arange(1500)
    truth = at_rest(len(times))
    truth[:, 2] = 0.1 * np.sin(2 * math.pi * times / 11.0)
    got = read(ideal(MotionUnit(lever_arm_error=2.0)), truth, seed=3)[600:]
    np.testing.assert_allclose(got[1:-1, 1], (got[2:, 0] - got[:-2, 0]) / (2 * PERIOD), rtol=0, atol=3e-3)
    assert np.ptp(got[:, 1]) > 0.05


def test_drift_of_a_ship_at_rest_is_the_accelerometers_through_the_filter():
    deviation, time = 0.02, 15.0
    unit = MotionUnit(acceleration_drift=deviation, drift_time=time)
    bank = SensorBank(ideal(unit), 400, PERIOD)
    for row in range(400):
        bank.reset_row(row, at_rest(1)[0], row)
    readings = [bank.measure(at_rest(400))[:, :2].copy() for _ in range(900)]
    late = np.array(readings[300::100]).reshape(-1, 2)
    a = np.array([[0.0, 1.0, 0.0], [-DENOMINATOR[2], -DENOMINATOR[1], 1.0], [0.0, 0.0, -1.0 / time]])
    variance = solve_continuous_lyapunov(a, -np.diag([0.0, 0.0, 2.0 * deviation**2 / time]))
    np.testing.assert_allclose(late.std(axis=0), np.sqrt(np.diag(variance)[:2]), rtol=0.08)


def test_angles_have_a_constant_bias_of_their_own():
    found = []
    for seed in range(300):
        got = read(ideal(MotionUnit(angle_bias=0.01)), at_rest(5), seed)
        assert np.ptp(got, axis=0).max() == 0.0
        assert not got[0, [0, 1, *range(4, len(CHANNELS))]].any()
        found.append(got[0, 2:4])
    assert np.std(found) == pytest.approx(0.01, rel=4.0 / math.sqrt(2 * 600))


def test_dropouts_are_as_many_and_as_long_as_they_should_be_and_freeze_the_unit_alone():
    steps, rate, mean = 60_000, 4.0, 1.5
    truth = np.random.default_rng(0).normal(size=(steps, len(CHANNELS)))
    got = read(ideal(MotionUnit(dropouts=rate, dropout_time=mean)), truth)
    frozen = got[1:] == got[:-1]
    out = frozen[:, 0]
    assert np.array_equal(frozen[:, :4], np.tile(out[:, None], 4))
    assert not frozen[:, 4:].any()
    begins = np.flatnonzero(np.diff(out.astype(int)) == 1)
    minutes_live = (~out).sum() * PERIOD / 60.0
    assert len(begins) == pytest.approx(rate * minutes_live, abs=4.0 * math.sqrt(rate * minutes_live))
    assert out.sum() * PERIOD / len(begins) == pytest.approx(mean, rel=4.0 / math.sqrt(len(begins)))


REAL = MotionUnit(
    heave_period=(15.0, 25.0),
    lever_arm_error=0.5,
    acceleration_drift=0.01,
    angle_bias=0.002,
    dropouts=20.0,
)


def test_heave_period_is_drawn_from_its_interval():
    w, times = 2.0 * math.pi / 12.0, PERIOD * np.arange(1200)
    truth = of_heave(np.sin(w * times), w * np.cos(w * times))
    gains = [np.ptp(read(ideal(MotionUnit(heave_period=(15.0, 25.0))), truth, seed)[800:, 0]) for seed in range(40)]
    least, most = (
        2.0 * abs(signal.freqs([1, 0, 0], [1, 2 * DAMPING * f, f * f], [w])[1][0])
        for f in (2 * math.pi / 15.0, 2 * math.pi / 25.0)
    )
    assert least - 2e-3 < min(gains) < least + 0.2 * (most - least)
    assert most + 2e-3 > max(gains) > most - 0.2 * (most - least)


def test_rows_are_read_apart_and_go_on_elsewhere():
    truth = np.random.default_rng(0).normal(size=(80, len(CHANNELS)))
    sensors = replace(Sensors(), motion_unit=REAL)
    bank, other = SensorBank(sensors, 3, PERIOD), SensorBank(sensors, 1, PERIOD)
    for row in range(3):
        bank.reset_row(row, truth[0], seed=row)
    alone = [read(sensors, truth, seed=row) for row in range(3)]
    for step, now in enumerate(truth[1:], start=1):
        if step == 40:
            other.write_row(0, bank.copy_row(2))
            bank = copy.deepcopy(bank)
        together = bank.measure(np.tile(now, (3, 1)))
        np.testing.assert_array_equal(together, [each[step] for each in alone])
        if step >= 40:
            np.testing.assert_array_equal(other.measure(now[None])[0], alone[2][step])
    assert not np.array_equal(alone[0], alone[1])


def test_an_environment_goes_on_where_it_was():
    env = AFrameHeaveEnv(observation=replace(Sensors(), motion_unit=REAL))
    env.reset(seed=2)
    action = np.ones(1, dtype=np.float32)
    for _ in range(30):
        env.step(action)
    state = env.get_state()
    first = [env.step(action)[0] for _ in range(30)]
    env.set_state(state)
    np.testing.assert_array_equal([env.step(action)[0] for _ in range(30)], first)


def test_a_unit_is_data():
    given = {"delay": 0.2, "motion_unit": {"heave_period": [15.0, 25.0], "dropouts": 2.0}}
    config = TaskConfig(observation=given)
    assert config.sensors is not None
    assert config.sensors.motion_unit == MotionUnit(heave_period=(15.0, 25.0), dropouts=2.0)
    assert TaskConfig(**config.plain()) == config


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"heave_period": 0.5}, r"heave_period = 0.5 s: must be in \[1, 1000\] s"),
        ({"heave_damping": 1.0}, "heave_damping = 1.0 of critical"),
        ({"dropouts": -1.0}, "dropouts = -1.0 per minute"),
        ({"lever_arm_error": math.nan}, "lever_arm_error = nan m"),
    ],
)
def test_a_unit_that_cannot_be_is_refused(change, message):
    with pytest.raises(InvalidValue, match=message):
        MotionUnit(**change)
    with pytest.raises(InvalidValue, match="motion_unit = 3"):
        Sensors(motion_unit=3)  # type: ignore[arg-type]
