import numpy as np
import pytest

from aframe_env import ScenarioDistribution
from aframe_env.sensors import Sensors
from aframe_env.simulation import Simulation
from agents.estimation import FadingPolynomial
from agents.features import SENSED_FEATURES, FeatureMaker

ALL = slice(None)


def test_a_fading_polynomial_is_the_weighted_least_squares_parabola():
    rng = np.random.default_rng(3)
    signal = np.cumsum(rng.normal(size=400))
    memory, period = 0.7, 0.2
    polynomial = FadingPolynomial(1, memory, period)
    polynomial.start(signal[:1], ALL)
    for value in signal[1:]:
        polynomial.advance(np.array([value]))
    ages = -period * np.arange(len(signal))[::-1]
    weights = memory ** (np.arange(len(signal))[::-1] / 2)  # polyfit squares them
    bend, rate, value = np.polyfit(ages[-100:], signal[-100:], 2, w=weights[-100:])
    assert polynomial.value(ALL)[0] == pytest.approx(value, rel=1e-6)
    assert polynomial.rate(ALL)[0] == pytest.approx(rate, rel=1e-6)
    assert polynomial.bend(ALL)[0] == pytest.approx(2.0 * bend, rel=1e-6)


def depth_estimates(sensors, rows=12, steps=400):
    """Estimates and true depth errors, both (steps, rows), in random seas with the drum turning at random."""
    rng = np.random.default_rng(8)
    simulation = Simulation(rows, observation=sensors, control_period=0.1)
    drawn = [simulation.draw(rng) for _ in range(rows)]
    simulation.reset_rows(np.arange(rows), drawn)
    maker = FeatureMaker(simulation.quantities, rows, 0.1)
    got, true = [maker.start(simulation.observe(), np.arange(rows))], [simulation.state[:, 0].copy()]
    command = np.zeros(rows)
    for _ in range(steps):
        command = 0.8 * command + 0.1 * rng.normal(size=rows)
        simulation.advance(command)
        got.append(maker.advance(simulation.observe()))
        true.append(simulation.state[:, 0].copy())
    return 0.5 * np.array(got)[:, :, SENSED_FEATURES.index("depth_error_estimate")], np.array(true)


def test_exact_readings_give_the_depth_to_centimetres():
    estimate, true = depth_estimates(Sensors.ideal())
    assert np.sqrt(np.mean(true**2)) > 0.3
    assert np.sqrt(np.mean((estimate - true) ** 2)) < 0.02


def test_noisy_readings_give_the_depth_better_than_the_depth_sensor():
    """Its noise alone is 5 cm; the readings speak of the moment 0.1 s ago."""
    estimate, true = depth_estimates(Sensors())
    error = (estimate[1:] - true[:-1])[100:]
    assert np.median(np.sqrt(np.mean(error**2, axis=0))) < 0.03


def test_a_row_that_starts_anew_forgets_its_own_past_alone():
    simulation = Simulation(3, observation="sensors", scenario=ScenarioDistribution(hs=3.0))
    rng = np.random.default_rng(1)
    simulation.reset_rows(np.arange(3), [simulation.draw(rng) for _ in range(3)])
    restarted, going_on = (FeatureMaker(simulation.quantities, 3, 0.1) for _ in range(2))
    for maker in (restarted, going_on):
        maker.start(simulation.observe(), np.arange(3))
    for _ in range(50):
        simulation.advance(np.full(3, 0.1))
        for maker in (restarted, going_on):
            maker.advance(simulation.observe())
    one = np.array([1])
    first = restarted.start(simulation.observe()[one], one)
    fresh = FeatureMaker(simulation.quantities, 1, 0.1)
    np.testing.assert_array_equal(first, fresh.start(simulation.observe()[one], np.array([0])))
    simulation.advance(np.full(3, 0.1))
    after, want = restarted.advance(simulation.observe()), going_on.advance(simulation.observe())
    np.testing.assert_array_equal(after[[0, 2]], want[[0, 2]])
    np.testing.assert_array_equal(after[1], fresh.advance(simulation.observe()[one])[0])
    assert not np.array_equal(after[1], want[1])
