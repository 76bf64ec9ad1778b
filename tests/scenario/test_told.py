import pickle
from dataclasses import replace

import pytest

from aframe_env import Crane, InvalidValue, LoadShape, Rope, Scenario, Told, Water, Winch

SHAPE = LoadShape(volume=5.0, added_mass_vertical=3e4, drag_area_vertical=20.0)


def test_what_was_told_takes_the_place_of_what_is():
    true = Scenario(
        water=Water(),
        told=Told(
            load_mass=8e4,
            load=SHAPE,
            axial_stiffness=1.5e8,
            mass_per_length=3.0,
            lag=0.2,
            max_rope_speed=2.0,
            max_rope_acceleration=1.0,
            sensor_delay=0.3,
        ),
    )
    told = true.as_told
    assert (told.load_mass, told.load, told.sensor_delay) == (8e4, SHAPE, 0.3)
    assert told.crane.rope == Rope(axial_stiffness=1.5e8, mass_per_length=3.0)
    assert told.crane.winch == Winch(lag=0.2, max_rope_speed=2.0, max_rope_acceleration=1.0)
    assert (true.load_mass, true.crane) == (1e5, Crane())


def test_nothing_of_the_truth_is_left_in_what_was_told():
    true = Scenario(load_mass=123_457.0, told=Told(load_mass=1e5))
    told = true.as_told
    assert told.told is None
    assert told == Scenario()
    assert told.as_told is told
    assert b"123457" not in pickle.dumps(told)
    assert all(value is not true and value != 123_457.0 for value in vars(told).values())


@pytest.mark.parametrize("told", [None, Told(), Told(load_mass=1e5, axial_stiffness=2e8, lag=0.0, load=LoadShape())])
def test_where_all_was_told_truly_it_is_the_very_scenario(told):
    true = Scenario(told=told)
    assert true.as_told is true


def test_target_and_rope_counter_are_not_told_wrongly():
    true = Scenario(target_level=-1000.0, told=Told(load_mass=6e4, axial_stiffness=1e8))
    told = true.as_told
    assert told.target_level == true.target_level
    assert told.free_length == true.free_length
    assert replace(told).free_length != true.free_length  # what would hold the load there, were it so
    assert pickle.loads(pickle.dumps(told)).free_length == true.free_length


@pytest.mark.parametrize(
    ("told", "says"),
    [
        (Told(load_mass=-1.0), "told: load_mass = -1.0 kg"),
        (Told(load_mass=9e5), "told: load_mass = 900000.0 kg"),
        (Told(lag=-0.1), "told: lag = -0.1 s"),
        (Told(sensor_delay=11.0), "told: sensor_delay = 11.0 s"),
        (Told(load=SHAPE), "told: load = "),
        ("heavy", "told = "),
    ],
)
def test_what_cannot_be_cannot_be_told(told, says):
    with pytest.raises(InvalidValue, match=says):
        Scenario(told=told)
