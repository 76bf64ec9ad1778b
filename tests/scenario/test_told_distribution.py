"""Cranes, delays and what is told, drawn."""

from dataclasses import fields, replace

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from aframe_env import (
    Crane,
    InvalidValue,
    LoadShape,
    Rope,
    ScenarioDistribution,
    Sensors,
    TaskConfig,
    Told,
    Water,
    Winch,
    read_scenarios,
    scenario_text,
)
from aframe_env.env import AFrameHeaveEnv
from aframe_env.vector_env import AFrameHeaveVectorEnv

SHAPE = LoadShape(volume=2.0, added_mass_vertical=4e4, drag_area_vertical=30.0)
DRAWN = {
    "axial_stiffness": (1.5e8, 2.5e8),
    "max_rope_speed": (1.5, 2.5),
    "max_rope_acceleration": (1.0, 2.0),
    "lag": (0.0, 0.3),
    "sensor_delay": (0.05, 0.4),
}
ERRORS = {"told_mass_error": 0.2, "told_stiffness_error": 0.1, "told_added_mass_error": 0.5, "told_drag_error": 0.4}
WET = {"water": Water(), "load": SHAPE}


def drawn(count=200, **changes):
    distribution = ScenarioDistribution(**changes)
    return [distribution.draw(np.random.default_rng(seed)) for seed in range(count)]


def values(scenario):
    """What is drawn of crane and sensors, and the shares by which it is told wrongly."""
    true, told = scenario, scenario.as_told
    return {
        "axial_stiffness": true.crane.rope.axial_stiffness,
        "max_rope_speed": true.crane.winch.max_rope_speed,
        "max_rope_acceleration": true.crane.winch.max_rope_acceleration,
        "lag": true.crane.winch.lag,
        "sensor_delay": true.sensor_delay,
        "told_mass_error": told.load_mass / true.load_mass - 1.0,
        "told_stiffness_error": told.crane.rope.axial_stiffness / true.crane.rope.axial_stiffness - 1.0,
        "told_added_mass_error": told.load.added_mass_vertical / true.load.added_mass_vertical - 1.0,
        "told_drag_error": told.load.drag_area_vertical / true.load.drag_area_vertical - 1.0,
    }


def test_draws_fill_their_ranges_and_no_more():
    found = [values(each) for each in drawn(**WET, **DRAWN, **ERRORS)]
    ranges = DRAWN | {name: (-error, error) for name, error in ERRORS.items()}
    for name, (low, high) in ranges.items():
        column = np.array([each[name] for each in found])
        width = high - low
        assert low - 1e-12 <= column.min() < low + 0.1 * width, name
        assert high - 0.1 * width < column.max() <= high + 1e-12, name
    table = np.array([[each[name] for name in ranges] for each in found])
    independent = np.corrcoef(table.T) - np.eye(len(ranges))
    assert abs(independent).max() < 0.3  # 200 numbers: five standard deviations are 0.35


@pytest.mark.parametrize("name", [*DRAWN, *ERRORS])
def test_one_draw_more_leaves_the_others_alone(name):
    every = {**DRAWN, **ERRORS}
    rest = {key: value for key, value in every.items() if key != name}
    for one, other in zip(drawn(5, **WET, **every), drawn(5, **WET, **rest), strict=True):
        assert (one.load_mass, one.target_level, one.motion) == (other.load_mass, other.target_level, other.motion)
        ours, theirs = values(one), values(other)
        assert ours.pop(name) != theirs.pop(name)
        assert ours == pytest.approx(theirs, rel=1e-9)


def test_where_nothing_of_it_is_drawn_scenarios_are_as_they_were():
    # Drawn before there was anything to be told wrongly.
    scenario = ScenarioDistribution().draw(np.random.default_rng(7))
    assert (scenario.load_mass, scenario.target_level) == (83765.5543001637, -1482.5997175354296)
    assert (scenario.rope_damping, scenario.motion.sea.seed) == (8816.854038404996, 2703657537750762)
    assert scenario.as_told is scenario
    assert (scenario.crane, scenario.sensor_delay) == (Crane(), None)


def test_what_is_told_for_all_is_told_in_each():
    told = Told(lag=0.15, max_rope_speed=2.0)
    for each in drawn(5, lag=(0.0, 0.3), max_rope_speed=(1.5, 2.5), told=told, told_mass_error=0.2):
        winch = each.as_told.crane.winch
        assert (winch.lag, winch.max_rope_speed) == (0.15, 2.0)
        assert each.as_told.load_mass != each.load_mass


def test_of_a_delay_that_is_drawn_the_sensors_are_told():
    late = drawn(5, sensor_delay=(0.2, 0.4), sensors=Sensors(delay=0.3))
    assert all(each.as_told.sensor_delay == 0.3 != each.sensor_delay for each in late)


def test_in_the_middle_all_is_told_truly():
    drawn = {**DRAWN, "sensor_delay": (0.0, 0.4), "sensors": Sensors(delay=0.2)}
    source = ScenarioDistribution(**drawn, told_mass_error=0.2, told_stiffness_error=0.1)
    nominal = source.nominal()
    assert (nominal.sensor_delay, nominal.crane.winch.lag) == (0.2, 0.15)
    assert nominal.as_told is nominal


def test_the_action_space_is_that_of_the_fastest_winch_and_a_slower_one_clips():
    source = ScenarioDistribution(max_rope_speed=(0.5, 2.5))
    env = AFrameHeaveEnv(scenario=source)
    assert env.action_space.high[0] == np.float32(2.5 / 0.75)
    env.reset(seed=0)
    most = env.scenario.crane.winch.max_speed
    assert most < 0.9 * env.action_space.high[0]
    for _ in range(30):
        observation, *_ = env.step(env.action_space.high)
    assert observation[10] == pytest.approx(most, rel=1e-6)


def test_rows_of_a_vector_environment_are_the_scalar_ones():
    source = ScenarioDistribution(**DRAWN, told_mass_error=0.2, told_stiffness_error=0.1)
    arguments = {"scenario": source, "observation": "sensors", "episode_duration": 3.0}
    rows = AFrameHeaveVectorEnv(3, autoreset_mode=AutoresetMode.DISABLED, **arguments)
    env = AFrameHeaveEnv(**arguments)
    together = [rows.reset(seed=4)[0]] + [rows.step(np.full((3, 1), 0.5, np.float32))[0] for _ in range(30)]
    for row in range(3):
        alone = [env.reset(seed=4 + row)[0]] + [env.step(np.full(1, 0.5, np.float32))[0] for _ in range(30)]
        assert np.array_equal(np.array(together)[:, row], alone)


def test_a_file_reads_back_as_it_was_written(tmp_path):
    source = ScenarioDistribution(**WET, **DRAWN, **ERRORS, told=Told(lag=0.1))
    (tmp_path / "mine.toml").write_text(scenario_text(source), encoding="utf-8")
    back = read_scenarios(tmp_path / "mine.toml")
    assert all(getattr(back, f.name) == getattr(source, f.name) for f in fields(source) if f.name != "vessel")
    scenario = replace(source.draw(np.random.default_rng(0)), told=Told(load=SHAPE, mass_per_length=20.0, lag=0.1))
    (tmp_path / "one.toml").write_text(scenario_text(scenario), encoding="utf-8")
    once = read_scenarios(tmp_path / "one.toml")
    assert (once.told, once.sensor_delay, once.crane) == (scenario.told, scenario.sensor_delay, scenario.crane)
    assert TaskConfig(scenario=source).plain()["scenario"]["told_mass_error"] == 0.2


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"lag": (0.3, 0.1)}, "lag = .* s: the low end is above"),
        ({"lag": -0.1}, r"lag = -0.1 s: must be in \[0, 10000\]"),
        ({"max_rope_speed": 0.0}, "max_rope_speed = 0.0 m/s"),
        ({"sensor_delay": (0.0, 11.0)}, r"sensor_delay \(high\) = 11.0 s"),
        ({"told_mass_error": 1.0}, "told_mass_error = 1.0"),
        ({"told_mass_error": 0.1, "told": Told(load_mass=5e4)}, "told_mass_error = 0.1: must be 0 where told"),
        ({"told": Told(sensor_delay=0.2)}, "told: sensor_delay = 0.2 s: must be None"),
        ({"told_drag_error": 0.1}, "told_drag_error = 0.1: goes with water"),
        ({"told": Told(load_mass=5e5)}, "told: load_mass = 500000.0 kg"),
        ({"axial_stiffness": (10.0, 2e8)}, "target_level = "),
    ],
)
def test_what_cannot_be_drawn_is_refused(changes, says):
    with pytest.raises(InvalidValue, match=says):
        ScenarioDistribution(**changes)


def test_a_heavy_rope_may_be_drawn_too():
    heavy = Crane(rope=Rope.six_strand(), winch=Winch(max_rope_length=4000.0))
    for each in drawn(5, crane=heavy, axial_stiffness=(1.5e8, 2.5e8), told_stiffness_error=0.2, **WET):
        assert 1.5e8 <= each.crane.rope.axial_stiffness <= 2.5e8
        assert each.as_told.crane.rope.mass_per_length == heavy.rope.mass_per_length
