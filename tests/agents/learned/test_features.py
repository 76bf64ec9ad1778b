import numpy as np
import pytest

from aframe_env import Crane, HarmonicMotion, InvalidValue, Scenario, ScenarioDistribution
from aframe_env.config import TaskConfig
from aframe_env.scenario.sensors import Sensors
from aframe_env.simulation import Simulation
from agents.control.feedback import Feedback
from agents.learned.feature_policy import FeaturePolicy
from agents.learned.features import (
    AHEAD,
    AUTHORITY,
    FAR_AUTHORITY,
    FEATURES,
    LIMIT,
    RISES,
    SENSED_REGULATOR,
    STATE_REGULATOR,
    FeatureConfig,
    Features,
    output_for,
    rope_speed,
)
from agents.rollout import held_out_scenarios, run

PERIOD = 0.1


def ran(observation, rows=12, steps=400, seed=8):
    """Features and full state, (steps, rows, …), in random seas with the drum turning at random."""
    rng = np.random.default_rng(seed)
    simulation = Simulation(rows, TaskConfig(observation=observation, control_period=PERIOD))
    drawn = [simulation.draw(rng) for _ in range(rows)]
    simulation.reset_rows(np.arange(rows), drawn)
    cranes = [scenario.crane for scenario, _ in drawn]
    features = Features(rows, FeatureConfig.of(simulation.config))
    got, true = [features.start(simulation.observe(), cranes)], [simulation.state.copy()]
    output = np.zeros(rows)
    for _ in range(steps):
        output = 0.8 * output + 0.1 * rng.normal(size=rows)
        simulation.advance(features.command(output))
        got.append(features.advance(simulation.observe()))
        true.append(simulation.state.copy())
    return np.array(got, dtype=np.float64), np.array(true)


def depth(got):
    return 2.0 * np.arctanh(got[:, :, FEATURES.index("depth_error")] / 4.0)


def test_exact_readings_give_the_depth_to_centimetres():
    got, true = ran(Sensors.ideal())
    assert np.sqrt(np.mean(true[:, :, 0] ** 2)) > 0.3
    assert np.sqrt(np.mean((depth(got) - true[:, :, 0]) ** 2)) < 0.03


def test_noisy_and_late_readings_give_the_present_better_than_any_one_of_them():
    """The depth sensor's noise is 5 cm, the heave rate's 1 cm/s or 1 %; all are 0.1 s late."""
    got, true = ran("sensors")
    settled = slice(150, None)

    def error(name, scale, truth):
        difference = got[settled, :, FEATURES.index(name)] / scale - truth[settled]
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
    size = np.quantile(np.abs(got), 0.9, axis=(0, 1))
    assert (size < 0.8 * LIMIT).all(), dict(zip(FEATURES, size, strict=True))
    assert (size > 0.05).all(), dict(zip(FEATURES, size, strict=True))


def test_a_row_that_starts_anew_forgets_its_own_past_alone():
    simulation = Simulation(3, TaskConfig(observation="sensors", scenario=ScenarioDistribution(hs=3.0)))
    rng = np.random.default_rng(1)
    simulation.reset_rows(np.arange(3), [simulation.draw(rng) for _ in range(3)])
    cranes = [Crane()] * 3
    restarted, going_on = (Features(3, FeatureConfig(sensors=Sensors())) for _ in range(2))
    for features in (restarted, going_on):
        features.start(simulation.observe(), cranes)
    output = np.full(3, 0.3)
    for _ in range(50):
        commands = [features.command(output) for features in (restarted, going_on)]
        simulation.advance(commands[0])
        for features in (restarted, going_on):
            features.advance(simulation.observe())
    one = np.array([1])
    first = restarted.start(simulation.observe()[one], cranes[:1], one)
    fresh = Features(1, FeatureConfig(sensors=Sensors()))
    np.testing.assert_array_equal(first, fresh.start(simulation.observe()[one], cranes[:1]))
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
    features.start(simulation.observe(), [scenario.crane for scenario, _ in drawn])
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
    """At 1 by the far authority, in seconds' worth of the winch's greatest acceleration; by less for less."""
    scenario = Scenario(motion=HarmonicMotion())
    simulation = Simulation(2, TaskConfig(control_period=PERIOD))
    simulation.reset_rows(np.arange(2), [(scenario, 0)] * 2)
    features = Features(2, FeatureConfig())
    features.start(simulation.observe(), [scenario.crane] * 2)
    angles = []
    for _ in range(30):
        simulation.advance(features.command(np.array([1.0, -0.5])))
        features.advance(simulation.observe())
        angles.append(simulation.state[:, 9].copy())
    speed = scenario.crane.winch.drum_radius * (angles[-1] - angles[-11])
    half = 0.5 * (AUTHORITY + 0.25 * (FAR_AUTHORITY - AUTHORITY))
    want = scenario.crane.winch.max_rope_acceleration * np.array([-FAR_AUTHORITY, half])
    np.testing.assert_allclose(speed, want, rtol=1e-6)


def test_the_regulators_output_is_the_inverse_of_what_an_output_asks_for():
    outputs = np.concatenate([np.linspace(-1.0, 1.0, 41), [1e-9, -1e-6]])
    for acceleration in (0.3, 2.0):
        np.testing.assert_allclose(
            output_for(np, rope_speed(outputs, acceleration), acceleration), outputs, rtol=1e-9, atol=1e-15
        )
    np.testing.assert_allclose(output_for(np, np.array([-99.0, 99.0]), 1.0), [-1.0, 1.0])


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_an_agent_that_says_what_the_regulator_says_is_the_law(observation):
    """On the same readings; left alone, rounding sets their two limit cycles apart."""
    scenarios = held_out_scenarios(ScenarioDistribution(), 4)
    column = FEATURES.index("regulator")
    made_for = FeatureConfig.of(TaskConfig(observation=observation))
    agent = FeaturePolicy(lambda features: features[:, column], made_for)
    law = Feedback(made_for.sensors, STATE_REGULATOR if observation == "state" else SENSED_REGULATOR, made_for.waves)
    apart, size = [], []

    class Shadowed:
        name, knows = law.name, law.knows

        def reset(self, scenarios, control_period):
            for policy in (agent, law):
                policy.reset(scenarios, control_period)

        def act(self, observation, time):
            said, command = (policy.act(observation, time) for policy in (agent, law))
            apart.append(np.abs(said - command))
            size.append(np.abs(command))
            return command

    run(Shadowed(), scenarios, observation=observation, episode_duration=20.0)
    assert np.mean(size) > 0.1
    assert np.quantile(apart, 0.9) < 1e-3
    assert np.mean(apart) < 0.02 * np.mean(size)


@pytest.mark.parametrize(("observation", "most"), [("state", 0.15), ("sensors", 0.35)])
def test_what_is_foretold_comes(observation, most):
    """Half a minute on: 1 s ahead better than a velocity that stays as it is, and the rise with it."""
    got, true = ran(observation, steps=500)
    ahead, late = round(1.0 / PERIOD), slice(300, 450)
    now, later = true[late, :, 7], true[300 + ahead : 450 + ahead, :, 7]
    velocity = got[late, :, FEATURES.index("pulley_velocity_z_in_1_s")]
    rise = got[late, :, FEATURES.index("pulley_rise_in_1_s")]
    risen = true[300 + ahead : 450 + ahead, :, 6] - true[late, :, 6]

    def rms(difference):
        return np.median(np.sqrt(np.mean(difference**2, axis=0)))

    assert rms(now - later) > 0.3 * rms(later)
    assert rms(velocity - later) < most * rms(now - later)
    assert rms(rise - risen) < 0.5 * most * rms(now - later)
    assert (1.0 in AHEAD, 1.0 in RISES) == (True, True)


def test_the_innovation_is_what_was_not_foretold():
    got, _ = ran("sensors", rows=2, steps=50)
    assert np.abs(got[0, :, FEATURES.index("heave_rate_innovation")]).max() == 0.0
    assert np.abs(got[1:, :, FEATURES.index("heave_rate_innovation")]).min() > 0.0


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_as_a_speed_the_output_is_the_drums(observation):
    """As a share of the winch's, and the features go on as with any other command that does the same."""
    scenario = Scenario(motion=HarmonicMotion())
    config = TaskConfig(control_period=PERIOD, observation=observation, episode_duration=30.0)
    simulation = Simulation(2, config)
    simulation.reset_rows(np.arange(2), [(scenario, 0)] * 2)
    features = Features(2, FeatureConfig.of(config, action="speed"))
    first = simulation.observe()
    features.start(first, [scenario.crane] * 2)
    limit = scenario.crane.winch.max_speed
    output = np.array([0.2, -1.5])
    for _ in range(40):
        command = features.command(output)
        np.testing.assert_array_equal(command, [0.2 * limit, -limit])
        simulation.advance(command)
        got = features.advance(simulation.observe())
    share = got[:, FEATURES.index("drum_speed_share")]
    np.testing.assert_allclose(share, simulation.state[:, 10] / limit, atol=1e-6)
    np.testing.assert_allclose(share, [0.2, -1.0], atol=1e-6)


def test_an_unknown_action_is_refused():
    with pytest.raises(InvalidValue, match="action = 'force': must be one of 'residual', 'speed'"):
        FeatureConfig(action="force")
