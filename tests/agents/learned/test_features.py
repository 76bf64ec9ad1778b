import numpy as np
import pytest

from aframe_env import Crane, HarmonicMotion, InvalidValue, Scenario, ScenarioDistribution, Told, Winch
from aframe_env.config import TaskConfig
from aframe_env.scenario.sensors import Sensors
from aframe_env.simulation import Simulation
from agents.learned.features import AUTHORITY, LIMIT, SENSED_FEATURES, STATE_FEATURES, FeatureConfig, Features
from agents.learned.interface import InterfaceConfig

PERIOD = 0.1


def ran(observation, rows=12, steps=400, seed=8):
    """Features and full state, (steps, rows, …), in random seas with the drum turning at random."""
    rng = np.random.default_rng(seed)
    simulation = Simulation(rows, TaskConfig(observation=observation, control_period=PERIOD))
    drawn = [simulation.draw(rng) for _ in range(rows)]
    simulation.reset_rows(np.arange(rows), drawn)
    lifts = [scenario for scenario, _ in drawn]
    features = Features(rows, FeatureConfig.of(simulation.config))
    got, true = [features.start(simulation.observe(), lifts)], [simulation.state.copy()]
    output = np.zeros(rows)
    for _ in range(steps):
        output = 0.8 * output + 0.1 * rng.normal(size=rows)
        simulation.advance(features.command(output))
        got.append(features.advance(simulation.observe()))
        true.append(simulation.state.copy())
    return np.array(got, dtype=np.float64), np.array(true)


def depth(got):
    return 2.0 * np.arctanh(got[:, :, SENSED_FEATURES.index("depth_error")] / 4.0)


def test_exact_readings_give_the_depth_to_centimetres():
    got, true = ran(Sensors.ideal())
    assert np.sqrt(np.mean(true[:, :, 0] ** 2)) > 0.3
    assert np.sqrt(np.mean((depth(got) - true[:, :, 0]) ** 2)) < 0.03


def test_noisy_and_late_readings_give_the_present_better_than_any_one_of_them():
    """The depth sensor's noise is 5 cm, the heave rate's 1 cm/s or 1 %; all are 0.1 s late."""
    got, true = ran("sensors")
    settled = slice(150, None)

    def error(name, scale, truth):
        difference = got[settled, :, SENSED_FEATURES.index(name)] / scale - truth[settled]
        return np.median(np.sqrt(np.mean(difference**2, axis=0)))

    off = np.median(np.sqrt(np.mean((depth(got) - true[:, :, 0])[settled] ** 2, axis=0)))
    assert off < 0.02
    assert error("load_velocity_z", 5.0, true[:, :, 1]) < 0.03
    assert error("pulley_velocity_z", 1.0, true[:, :, 7]) < 0.015
    late = np.median(np.sqrt(np.mean((true[1:, :, 7] - true[:-1, :, 7])[settled] ** 2, axis=0)))
    assert late > 0.02  # what a reading that is 0.1 s late would be off by, without any noise


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_features_are_of_order_one_over_the_distribution(observation):
    got, _ = ran(observation)
    names = STATE_FEATURES if observation == "state" else SENSED_FEATURES
    size = np.quantile(np.abs(got), 0.9, axis=(0, 1))
    assert (size < 0.8 * LIMIT).all(), dict(zip(names, size, strict=True))
    assert (size > 0.05).all(), dict(zip(names, size, strict=True))


def test_a_row_that_starts_anew_forgets_its_own_past_alone():
    simulation = Simulation(3, TaskConfig(observation="sensors", scenario=ScenarioDistribution(hs=3.0)))
    rng = np.random.default_rng(1)
    simulation.reset_rows(np.arange(3), [simulation.draw(rng) for _ in range(3)])
    lifts = [Scenario()] * 3
    restarted, going_on = (Features(3, FeatureConfig.of(simulation.config)) for _ in range(2))
    for features in (restarted, going_on):
        features.start(simulation.observe(), lifts)
    output = np.full(3, 0.3)
    for _ in range(50):
        commands = [features.command(output) for features in (restarted, going_on)]
        simulation.advance(commands[0])
        for features in (restarted, going_on):
            features.advance(simulation.observe())
    one = np.array([1])
    first = restarted.start(simulation.observe()[one], lifts[:1], one)
    fresh = Features(1, FeatureConfig.of(simulation.config))
    np.testing.assert_array_equal(first, fresh.start(simulation.observe()[one], lifts[:1]))
    for features, count in ((restarted, 3), (going_on, 3), (fresh, 1)):
        features.command(output[:count])
    simulation.advance(commands[0])
    after, want = restarted.advance(simulation.observe()), going_on.advance(simulation.observe())
    np.testing.assert_array_equal(after[[0, 2]], want[[0, 2]])
    np.testing.assert_array_equal(after[1], fresh.advance(simulation.observe()[one])[0])
    assert not np.array_equal(after[1], want[1])


@pytest.mark.parametrize("observation", ["state", Sensors.ideal()], ids=["state", "exact sensors"])
def test_without_output_the_drum_takes_up_the_pulleys_motion(observation):
    """What is left is the drift of many small misses, and the load's bobbing on its rope."""
    rng = np.random.default_rng(3)
    simulation = Simulation(
        8, TaskConfig(observation=observation, control_period=PERIOD, scenario=ScenarioDistribution(hs=2.0))
    )
    drawn = [simulation.draw(rng) for _ in range(8)]
    simulation.reset_rows(np.arange(8), drawn)
    features = Features(8, FeatureConfig.of(simulation.config))
    features.start(simulation.observe(), [scenario for scenario, _ in drawn])
    rope_end, pulley = [], []
    radius = drawn[0][0].crane.winch.drum_radius
    for _ in range(300):
        simulation.advance(features.command(np.zeros(8)))
        features.advance(simulation.observe())
        pulley.append(simulation.state[:, 6])
        rope_end.append(simulation.state[:, 6] - radius * simulation.state[:, 9])
    assert np.std(pulley) > 0.3
    assert np.std(rope_end) < 0.15 * np.std(pulley)


def test_an_output_moves_the_ropes_end():
    """At 1 by the authority: a quarter of a second's worth of the winch's greatest acceleration."""
    scenario = Scenario(motion=HarmonicMotion())
    simulation = Simulation(2, TaskConfig(control_period=PERIOD))
    simulation.reset_rows(np.arange(2), [(scenario, 0)] * 2)
    features = Features(2, FeatureConfig.of(simulation.config))
    features.start(simulation.observe(), [scenario] * 2)
    angles = []
    for _ in range(30):
        simulation.advance(features.command(np.array([1.0, -0.5])))
        features.advance(simulation.observe())
        angles.append(simulation.state[:, 9].copy())
    speed = scenario.crane.winch.drum_radius * (angles[-1] - angles[-11])
    np.testing.assert_allclose(speed, AUTHORITY * scenario.crane.winch.max_rope_acceleration * np.array([-1.0, 0.5]))


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_the_speed_action_is_the_drums_speed(observation):
    """As a share of the winch's greatest, with nothing below it; and the observer is told what it turned the drum."""
    simulation = Simulation(2, TaskConfig(observation=observation, control_period=PERIOD))
    rng = np.random.default_rng(6)
    drawn = [simulation.draw(rng) for _ in range(2)]
    simulation.reset_rows(np.arange(2), drawn)
    features = Features(2, FeatureConfig.of(simulation.config, "speed"))
    features.start(simulation.observe(), [scenario for scenario, _ in drawn])
    most = drawn[0][0].crane.winch.max_speed
    for output in (0.01, -0.02, 0.03):
        command = features.command(np.array([output, 2.0]))
        np.testing.assert_allclose(command, [output * most, most])
        simulation.advance(command)
        features.advance(simulation.observe())
    got = features.advance(simulation.observe())
    rope_speed = drawn[0][0].crane.winch.drum_radius * simulation.state[:, 10]
    column = STATE_FEATURES.index("rope_end_speed")
    pulley = got[:, STATE_FEATURES.index("pulley_velocity_z")]
    np.testing.assert_allclose(got[:, column] / 10.0, pulley - rope_speed, atol=1e-4 if observation == "state" else 0.1)


def test_the_winch_that_was_told_is_appended_where_it_is_asked_for():
    true = Scenario(
        crane=Crane(winch=Winch(lag=0.1)), told=Told(max_rope_speed=2.0, max_rope_acceleration=1.5, lag=0.2)
    )
    simulation = Simulation(2, TaskConfig(scenario=true))
    simulation.reset_rows(np.arange(2), [(true, 0), (Scenario(), 0)])
    told = [true.as_told, Scenario()]
    plain, longer = (Features(2, FeatureConfig.of(simulation.config, winch=winch)) for winch in (False, True))
    observation = simulation.observe()
    values = longer.start(observation, told)
    assert longer.names == (*plain.names, "winch_speed", "winch_acceleration", "winch_lag")
    assert np.array_equal(values[:, :-3], plain.start(observation, told))
    assert values[:, -3:] == pytest.approx(np.array([[1.0, 1.5, 1.0], [1.5, 2.0, 0.0]]))
    # One row begins anew on the other winch, the other goes on.
    again = longer.start(observation[:1], [Scenario()], np.array([0]))
    assert again[0, -3:] == pytest.approx([1.5, 2.0, 0.0])
    assert longer.advance(observation)[:, -3:] == pytest.approx(np.array([[1.5, 2.0, 0.0]] * 2))


def test_predictive_control_has_the_winch_already():
    with pytest.raises(InvalidValue, match="winch = True: the features of predictive control"):
        FeatureConfig(action="predictive", winch=True)
    with pytest.raises(InvalidValue, match="winch = True: the features of predictive control"):
        InterfaceConfig(action="predictive", winch=True)
