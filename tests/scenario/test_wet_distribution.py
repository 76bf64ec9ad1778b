"""Distributions of heavy ropes and loads in water."""

from __future__ import annotations

import math
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from aframe_env import (
    Crane,
    InvalidValue,
    LoadShape,
    Rope,
    Scenario,
    ScenarioDistribution,
    TaskConfig,
    Water,
    read_scenarios,
    scenario_text,
)
from aframe_env.dynamics.start import critical_damping
from aframe_env.simulation import Simulation

SHAPE = LoadShape(
    volume=7.6,
    added_mass_vertical=4e4,
    added_mass_horizontal=3e4,
    drag_area_vertical=25.0,
    drag_area_horizontal=20.0,
)
WET = ScenarioDistribution(
    crane=Crane(rope=Rope.six_strand()),
    rope_length=(50.0, 2500.0),
    water=Water(current=((0.0, 0.6, 0.2), (200.0, 0.1, 0.0))),
    load=SHAPE,
    added_mass_factor=(0.7, 1.4),
    drag_factor=(0.5, 2.0),
    current_factor=(0.0, 1.5),
    current_turn=(-math.pi, math.pi),
)


def drawn(source: ScenarioDistribution, count: int, seed: int = 0) -> list[Scenario]:
    rng = np.random.default_rng(seed)
    return [source.draw(rng) for _ in range(count)]


def test_drawn_loads_are_of_one_density_and_form() -> None:
    plain = replace(WET, added_mass_factor=1.0, drag_factor=1.0)
    for scenario in drawn(plain, 20):
        size = scenario.load_mass / 60e3
        assert scenario.load.volume == pytest.approx(size * 7.6)
        assert scenario.load.added_mass_horizontal == pytest.approx(size * 3e4)
        # Edges go with the cube root: areas with its square.
        assert scenario.load.drag_area_vertical**3 == pytest.approx(size**2 * 25.0**3)
        assert scenario.weight / scenario.load_mass == pytest.approx(9.81 * (1.0 - 1025.0 * 7.6 / 60e3))
    assert replace(plain, load_mass=35e3).draw(np.random.default_rng(1)).load == SHAPE


def test_factors_and_currents_are_drawn_from_their_intervals() -> None:
    scenarios = drawn(WET, 300)
    added = [s.load.added_mass_vertical / s.load_mass * 60e3 / 4e4 for s in scenarios]
    drag = [s.load.drag_area_horizontal / 20.0 * (60e3 / s.load_mass) ** (2.0 / 3.0) for s in scenarios]
    currents = [np.array(s.water.current) for s in scenarios if s.water is not None]
    speed = [float(np.hypot(*c[0, 1:])) / math.hypot(0.6, 0.2) for c in currents]
    turn = [math.remainder(math.atan2(c[0, 2], c[0, 1]) - math.atan2(0.2, 0.6), 2.0 * math.pi) for c in currents]
    for found, low, high in ((added, 0.7, 1.4), (drag, 0.5, 2.0), (speed, 0.0, 1.5), (turn, -math.pi, math.pi)):
        assert low <= min(found) + 1e-9 < low + 0.03 * (high - low)
        assert high - 0.03 * (high - low) < max(found) <= high + 1e-9
        assert np.mean(found) == pytest.approx(0.5 * (low + high), abs=0.06 * (high - low))
    # A profile keeps its form, and depths.
    assert all(np.hypot(*c[1, 1:]) == pytest.approx(np.hypot(*c[0, 1:]) * 0.1 / math.hypot(0.6, 0.2)) for c in currents)
    assert {tuple(c[:, 0]) for c in currents} == {(0.0, 200.0)}


def test_what_is_wet_draws_nothing_anew_of_sea_load_and_rope() -> None:
    light = ScenarioDistribution(rope_length=WET.rope_length)
    for a, b in zip(drawn(light, 5), drawn(WET, 5), strict=True):
        assert (a.motion, a.load_mass, a.target_level) == (b.motion, b.load_mass, b.target_level)


def test_damping_is_a_share_of_what_stops_the_bobbing_in_water() -> None:
    for scenario in drawn(replace(WET, rope_damping_ratio=0.04), 20):
        critical = critical_damping(scenario.rope_stiffness, scenario.moved_mass)
        assert scenario.rope_damping == pytest.approx(0.04 * critical, rel=1e-6)


@settings(deadline=None, max_examples=40)
@given(
    mass=st.tuples(st.floats(5e3, 5e4), st.floats(5e4, 1.2e5)),
    length=st.tuples(st.floats(30.0, 400.0), st.floats(400.0, 2800.0)),
    density=st.floats(1500.0, 7800.0),
    rope=st.floats(0.5, 30.0),
    factor=st.floats(0.0, 3.0),
)
def test_all_is_valid_that_a_distribution_draws_once_it_is_one(
    mass: tuple[float, float], length: tuple[float, float], density: float, rope: float, factor: float
) -> None:
    try:
        source = ScenarioDistribution(
            crane=Crane(rope=Rope(mass_per_length=rope, solid_diameter=0.02, outer_diameter=0.03)),
            load_mass=mass,
            rope_length=length,
            water=Water(),
            load=LoadShape(volume=0.5 * sum(mass) / density, added_mass_vertical=1e4),
            added_mass_factor=(0.0, factor),
        )
    except InvalidValue:
        assume(False)
    for scenario in drawn(source, 20):
        assert scenario.weight > 0.0
        assert length[0] <= scenario.rope_length <= length[1]


def test_it_reads_back_and_travels_with_the_environment(tmp_path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "wet.toml"
    path.write_text(scenario_text(WET), encoding="utf-8")
    assert read_scenarios(path) == WET
    env = gymnasium.make("AFrameHeave-v0", scenario=path, observation="sensors")
    assert env.spec is not None
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    first, second = env.reset(seed=3)[0], again.reset(seed=3)[0]
    np.testing.assert_array_equal(first, second)
    assert again.unwrapped.scenario.water is not None
    hand = tmp_path / "hand.toml"
    hand.write_text(
        'kind = "distribution"\nadded_mass_factor = [0.7, 1.4]\n[crane.rope]\nmass_per_length = 19.55\n[water]\n'
        "[load]\nvolume = 7.6\nadded_mass_vertical = 4e4\n"
    )
    source = read_scenarios(hand)
    assert isinstance(source, ScenarioDistribution)
    assert (source.water, source.added_mass_factor) == (Water(), (0.7, 1.4))


def test_rows_of_a_vector_are_single_environments() -> None:
    """Short ropes of one spring and long ones of many, with sensors, to the bit, control step by control step."""
    arguments = {"scenario": replace(WET, rope_length=(50.0, 150.0)), "observation": "sensors", "episode_duration": 1.0}
    rows = 6
    envs = gymnasium.make_vec(
        "AFrameHeave-v0", num_envs=rows, vectorization_mode="vector_entry_point", autoreset_mode="SameStep", **arguments
    )
    observed = envs.reset(seed=11)[0]
    singles = [gymnasium.make("AFrameHeave-v0", **arguments) for _ in range(rows)]
    np.testing.assert_array_equal(observed, [env.reset(seed=11 + i)[0] for i, env in enumerate(singles)])
    assert {env.unwrapped.scenario.springs > 1 for env in singles} == {False, True}
    rng = np.random.default_rng(0)
    for _ in range(8):
        actions = rng.uniform(-1.0, 1.0, (rows, 1)).astype(np.float32)
        seen, rewards, *_ = envs.step(actions)
        for i, env in enumerate(singles):
            alone, reward, *_ = env.step(actions[i])
            np.testing.assert_array_equal(seen[i], alone)
            assert rewards[i] == reward


def test_light_rows_keep_their_bits_beside_heavy_ones() -> None:
    scenarios = [s for pair in zip(drawn(ScenarioDistribution(), 3), drawn(WET, 3), strict=True) for s in pair]
    mixed = Simulation(len(scenarios), TaskConfig(scenario=scenarios[0]))
    mixed.reset_rows(np.arange(len(scenarios)), [(s, 0) for s in scenarios])
    alone = [Simulation(1, TaskConfig(scenario=s)) for s in scenarios]
    for simulation, scenario in zip(alone, scenarios, strict=True):
        simulation.reset_rows(np.arange(1), [(scenario, 0)])
    for step in range(20):
        speeds = np.sin(0.3 * step + np.arange(len(scenarios)))
        mixed.advance(speeds)
        for i, simulation in enumerate(alone):
            simulation.advance(speeds[i : i + 1])
            np.testing.assert_array_equal(mixed.state[i], simulation.state[0])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"water": None}, r"added_mass_factor = \(0.7, 1.4\): goes with water, and there is none"),
        ({"water": Water()}, r"current_factor = \(0.0, 1.5\): goes with a current, and the water has none"),
        ({"current_factor": 12.0}, r"current_factor = 12.0: the current would run at 7.58947 m/s: must be at most 5 m"),
        ({"drag_factor": (2.0, 1.0)}, r"drag_factor = \(2.0, 1.0\): the low end is above the high end"),
        ({"added_mass_factor": -1.0}, r"added_mass_factor = -1.0: must be in \[0, 100\]"),
        ({"current_turn": 7.0}, r"current_turn = 7.0 rad: must be in"),
        ({"load": replace(SHAPE, volume=60.0)}, r"volume = .*: a load of .* kg floats: must be below"),
        ({"rope_length": (50.0, 3100.0)}, r"3100 m needs 3105.47 m of unstretched rope"),
        ({"rope_length": (50.0, 2900.0), "load_mass": (1e5, 3.3e5)}, "with its load: must be below 3.42e"),
        ({"load": 3.0}, "load = 3.0: must be a LoadShape"),
    ],
)
def test_what_does_not_go_together_is_one_sentence(changes, words) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidValue, match=words) as raised:
        replace(WET, **changes)
    assert "\n" not in str(raised.value)


def test_full_model_draws_from_it_too() -> None:
    env = gymnasium.make_vec(
        "AFrameHeave-v0", num_envs=3, scenario=WET, model="rfem", rfes=(5, 2), episode_duration=1.0
    )
    env.reset(seed=4)
    for _ in range(10):
        observation, reward, *_ = env.step(np.ones((3, 1), dtype=np.float32))
        assert np.isfinite(observation).all()
        assert (np.abs(reward) < 10.0).all()
