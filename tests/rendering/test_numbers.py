"""What is drawn, in numbers: scene, sea surface, history and view."""

from __future__ import annotations

import math

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aframe_env import Scenario, ScenarioDistribution, Sea, SeaMotion
from aframe_env.config import TaskConfig
from aframe_env.rendering.history import History
from aframe_env.rendering.scene import scene_of
from aframe_env.rendering.view import View, round_limit
from aframe_env.rendering.water import water_of
from aframe_env.simulation import Simulation

lengths = st.floats(-2000.0, 2000.0)
shares = st.floats(-0.9, 0.9)


@given(
    origin=st.tuples(lengths, lengths),
    scale=st.floats(0.1, 1000.0),
    recession=st.tuples(shares, shares),
    point=st.tuples(lengths, lengths, lengths),
)
def test_view_there_and_back(
    origin: tuple[float, float],
    scale: float,
    recession: tuple[float, float],
    point: tuple[float, float, float],
) -> None:
    view = View(origin, scale, recession)
    pixel = view.pixels(point)
    np.testing.assert_allclose(view.metres(pixel, point[1]), point, atol=1e-6)


def test_view_has_x_to_the_right_and_z_up() -> None:
    view = View((100.0, 50.0), 10.0)
    np.testing.assert_array_equal(view.pixels([[2.0, 7.0, 0.0], [0.0, 7.0, 3.0]]), [[120.0, 50.0], [100.0, 20.0]])


@given(st.floats(0.0, 1e4))
def test_round_limit_is_close_above(value: float) -> None:
    limit = round_limit(value)
    assert limit >= value * (1.0 - 1e-6)
    assert limit <= max(0.06, 2.0 * value) * (1.0 + 1e-6)


@pytest.mark.parametrize("rows", [1, 3])
def test_scene_is_what_the_simulation_says(rows: int) -> None:
    simulation = Simulation(rows, TaskConfig(scenario=ScenarioDistribution(hs=4.0)))
    rng = np.random.default_rng(5)
    simulation.reset_rows(np.arange(rows), [simulation.draw(rng) for _ in range(rows)])
    for _ in range(250):
        simulation.advance(rng.uniform(-3.0, 3.0, rows))
    for row in range(rows):
        scene, scenario = scene_of(simulation, row), simulation.scenarios[row]
        assert scenario is not None
        # The engine turns the deck by code of its own.
        np.testing.assert_allclose(scene.on_deck(scenario.crane.pulley_position), scene.pulley, atol=1e-9)
        np.testing.assert_allclose(scene.rotation @ scene.rotation.T, np.eye(3), atol=1e-12)
        offset = scene.load - scene.pulley
        np.testing.assert_allclose(offset[:2], simulation.state[row, 2:4], atol=1e-9)
        assert scene.depth_error == pytest.approx(simulation.state[row, 0], abs=1e-9)
        assert scene.rope_length == pytest.approx(
            scenario.free_length + scene.drum_angle * scenario.crane.winch.drum_radius
        )
        assert scene.time == pytest.approx(25.0)


def test_scene_of_the_environment() -> None:
    env = gymnasium.make("AFrameHeave-v0").unwrapped
    with pytest.raises(gymnasium.error.ResetNeeded):
        scene_of(env.simulation, 0)
    env.reset(seed=4)
    for _ in range(30):
        _, _, _, _, info = env.step(np.array([1.0], dtype=np.float32))
    scene = scene_of(env.simulation, 0)
    np.testing.assert_array_equal(scene.load, info["load_position"])
    assert (scene.tension, scene.slack, scene.time) == (info["rope_tension"], info["slack"], info["time"])
    assert scene.drum_command == 1.0


@pytest.mark.parametrize("heading", [0.3, 2.0, math.pi, 5.0])
def test_surface_is_the_seas_elevation_at_the_reference_point(heading: float) -> None:
    motion = SeaMotion(sea=Sea(hs=3.0, tp=9.0, heading=heading, spreading=4, seed=2))
    water = water_of(Scenario(motion=motion))
    reference, deck = motion.vessel.reference_point, motion.vessel.deck_position
    times = np.linspace(0.0, 50.0, 11)
    # Deck axes: x aft, y to starboard.
    x, y = deck[0] - reference[0], deck[1] - reference[1]
    heights = [float(water.heights([x], y, time)[0]) for time in times]
    np.testing.assert_allclose(heights, motion.sea.waves().elevation(times) - deck[2], atol=1e-9)


def test_head_waves_travel_aft() -> None:
    water = water_of(Scenario(motion=SeaMotion(sea=Sea(hs=2.0, tp=8.0, heading=math.pi, components=1, seed=1))))
    omega = float(water.frequency[0])
    speed = 9.81 / omega
    place = np.linspace(-50.0, 50.0, 21)
    np.testing.assert_allclose(water.heights(place + speed * 0.7, 0.0, 4.7), water.heights(place, 0.0, 4.0), atol=1e-9)


def test_waves_build_up_with_the_ships_motion_and_harmonic_motion_has_none() -> None:
    sea = SeaMotion(sea=Sea(hs=3.0, tp=9.0))
    water = water_of(Scenario(motion=sea, ramp=10.0))
    place = np.linspace(-50.0, 10.0, 30)
    np.testing.assert_array_equal(water.heights(place, 0.0, 0.0), water.level)
    assert np.ptp(water.heights(place, 0.0, 12.0)) > 0.3
    np.testing.assert_array_equal(water_of(Scenario.paper()).heights(place, 0.0, 3.0), -5.0)


def test_history_is_of_the_present_episode() -> None:
    simulation = Simulation(2, TaskConfig(control_period=0.5))
    rng = np.random.default_rng(0)
    history = History(simulation.control_period)

    def start(row: int) -> None:
        simulation.reset_rows(np.array([row]), [simulation.draw(rng)])

    start(0)
    start(1)
    history.record(simulation)
    for step in range(1, 9):
        simulation.advance(np.zeros(2))
        if step == 5:
            start(1)
        history.record(simulation)
    np.testing.assert_allclose(history.of(0)[:, 0], 0.5 * np.arange(9))
    np.testing.assert_allclose(history.of(1)[:, 0], 0.5 * np.arange(4))
    np.testing.assert_array_equal(history.of(0)[-1, 1:], simulation.state[0, [0, 6]])
