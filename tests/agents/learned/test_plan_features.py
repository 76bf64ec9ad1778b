import numpy as np
import pytest

from aframe_env import Crane, InvalidValue, ScenarioDistribution, Winch
from aframe_env.config import TaskConfig
from aframe_env.scenario.sensors import Sensors
from aframe_env.simulation import Simulation
from aframe_env.suite import find_task
from aframe_env.task import DRUM_ANGLE
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.learned.agent import output_zero
from agents.learned.features import LIMIT, FeatureConfig
from agents.learned.plan_features import PLAN_FEATURES, PlanFeatures
from agents.registry import BuildContext, choose
from agents.rollout import held_out_scenarios, run

WEAK = Crane(winch=Winch(max_rope_speed=1.0, max_rope_acceleration=0.6))
ROUGH = ScenarioDistribution(hs=(0.5, 4.0), tp=(7.0, 9.0), crane=WEAK)


def begun(rows, observation="state", steps=0, source=ROUGH, seed=3):
    """Rows in rough seas, their features after so many steps, and their last values."""
    rng = np.random.default_rng(seed)
    simulation = Simulation(rows, TaskConfig(observation=observation, scenario=source))
    drawn = [simulation.draw(rng) for _ in range(rows)]
    simulation.reset_rows(np.arange(rows), drawn)
    features = PlanFeatures(rows, FeatureConfig.of(simulation.config, "predictive"))
    values = [features.start(simulation.observe(), [scenario for scenario, _ in drawn])]
    for _ in range(steps):
        simulation.advance(features.command(np.zeros(rows)))
        values.append(features.advance(simulation.observe()))
    return simulation, features, np.array(values)


@pytest.mark.parametrize("sensors", [None, Sensors()])
def test_an_output_of_zero_is_predictive_control(sensors):
    scenarios = held_out_scenarios(ROUGH, 4)
    task = TaskConfig(observation=sensors or "state", scenario=ROUGH)
    config = FeatureConfig.of(task, "predictive")
    law = PredictiveControl(PlanningConfig(sensors=sensors, waves=config.waves))
    silent = run(output_zero(config), scenarios, task)
    np.testing.assert_array_equal(silent.drum_speed, run(law, scenarios, task).drum_speed)
    assert (abs(silent.drum_speed) > 0.1).any()


@pytest.mark.parametrize("name", ["MRU", "DeepRope", "Preview"])
def test_on_a_tasks_sensors_an_output_of_zero_is_adaptive_predictive_control(name):
    """With the delays that it finds out, the filter for heavy ropes, the radar's heave, and the task's waves."""
    task = find_task(name)
    scenarios, config = task.scenarios("train", 3), TaskConfig(**task.arguments).replaced(episode_duration=15.0)
    law = choose("adaptive predictive control").policy(BuildContext(scenarios=scenarios, config=config))
    expected = run(law, scenarios, config).drum_speed
    silent = run(output_zero(FeatureConfig.of(config, "predictive", adapts=True)), scenarios, config)
    np.testing.assert_array_equal(silent.drum_speed, expected)
    assert (abs(expected) > 0.1).any()
    told = run(output_zero(FeatureConfig.of(config, "predictive")), scenarios, config)
    assert not np.array_equal(told.drum_speed, expected)


def test_only_predictive_control_on_sensors_adapts():
    with pytest.raises(InvalidValue, match="action = 'residual': must be False"):
        FeatureConfig(sensors=Sensors(), adapts=True)
    with pytest.raises(InvalidValue, match="the full state is observed: must be False"):
        FeatureConfig(action="predictive", adapts=True)


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_features_are_finite_and_of_order_one(observation):
    _, _, values = begun(8, observation, steps=300)
    assert values.shape[2] == len(PLAN_FEATURES) == len(set(PLAN_FEATURES))
    size = np.quantile(abs(values), 0.9, axis=(0, 1))
    assert (size < 0.8 * LIMIT).all(), dict(zip(PLAN_FEATURES, size, strict=True))
    assert (size > 0.005).all(), dict(zip(PLAN_FEATURES, size, strict=True))


def test_an_output_turns_the_drum_by_its_share_of_what_the_winch_can_gain_where_it_nears_its_limits():
    turned, told = [], []
    for output in (0.0, 0.3):
        simulation, features, values = begun(40, steps=150)
        before = simulation.state[:, DRUM_ANGLE].copy()
        simulation.advance(features.command(np.full(40, output)))
        turned.append(simulation.state[:, DRUM_ANGLE] - before)
        told.append(dict(zip(PLAN_FEATURES, values[-1].T.astype(float), strict=True)))
    demand = np.maximum(told[0]["acceleration_demand_49"], told[0]["speed_demand_49"])
    weight = np.clip((demand - 0.6) / 0.4, 0.0, 1.0)
    planned = told[0]["planned_change"]
    share = np.clip(planned + 0.3 * weight, -1.0, 1.0) - planned
    assert (weight == 0.0).any()
    assert (weight == 1.0).any()
    assert ((weight > 0.0) & (weight < 1.0)).any()
    within = (abs(planned) < 0.65) & (abs(told[0]["drum_speed"]) < 0.9)
    expected = 0.5 * share * WEAK.winch.max_acceleration * 0.1**2
    assert (turned[1] - turned[0])[within] == pytest.approx(expected[within], abs=1e-7)


def test_the_plan_foretells_what_predictive_control_then_does_where_the_waves_are_known():
    """The depth error that is expected a second ahead is the one that comes, but for what the waves do otherwise."""
    values = begun(6, steps=300)[2]
    column = PLAN_FEATURES.index("depth_error_expected_10")
    expected = values[:-11, :, column] / 4.0
    came = np.arctanh(np.clip(values[11:, :, 0] / 4.0, -0.999, 0.999)) * 2.0
    large = abs(came) > 0.2
    assert large.sum() > 30
    assert np.corrcoef(expected[large], came[large])[0, 1] > 0.8


def test_a_row_that_starts_anew_forgets_its_own_past_alone():
    simulation, features, _ = begun(3, "sensors", steps=60)
    _, going_on, _ = begun(3, "sensors", steps=60)
    scenario, seed = simulation.draw(np.random.default_rng(9))
    simulation.reset_rows(np.array([1]), [(scenario, seed)])
    first = features.start(simulation.observe()[[1]], [scenario], np.array([1]))
    fresh = PlanFeatures(1, FeatureConfig.of(simulation.config, "predictive"))
    np.testing.assert_allclose(first, fresh.start(simulation.observe()[[1]], [scenario]), atol=1e-6)
    # Row 1 now sees another load: the filters of the other rows must not.
    command = features.command(np.zeros(3))
    assert command[[0, 2]] == pytest.approx(going_on.command(np.zeros(3))[[0, 2]], abs=1e-12)
    assert command[1] == pytest.approx(fresh.command(np.zeros(1))[0], abs=1e-9)
