"""Scenarios and their distribution: what is drawn, sub-streams, and refusals that name the value."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import (
    Channel,
    Crane,
    Frame,
    Harmonic,
    HarmonicMotion,
    InvalidValue,
    Rope,
    Scenario,
    ScenarioDistribution,
    Sea,
    SeaMotion,
    Sensors,
    Winch,
)
from aframe_env.engine import Engine
from aframe_env.env import AFrameHeaveEnv


def draw(seed: int, **changes: Any) -> Scenario:
    return ScenarioDistribution(**changes).draw(np.random.default_rng(seed))


def sea_of(scenario: Scenario) -> Sea:
    assert isinstance(scenario.motion, SeaMotion)
    return scenario.motion.sea


def damping_ratio(scenario: Scenario) -> float:
    return scenario.rope_damping / (2.0 * math.sqrt(scenario.rope_stiffness * scenario.load_mass))


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_draws_lie_in_their_intervals(seed: int) -> None:
    scenario = draw(seed)
    sea = sea_of(scenario)
    assert 0.5 <= sea.hs <= 4.0
    assert 6.0 <= sea.tp <= 14.0
    assert 0.0 <= sea.heading <= 2.0 * math.pi
    assert 20e3 <= scenario.load_mass <= 100e3
    assert 50.0 - 1e-9 <= scenario.rope_length <= 1500.0 + 1e-9
    assert 0.01 - 1e-12 <= damping_ratio(scenario) <= 0.05 + 1e-12


def test_draws_fill_their_intervals_evenly() -> None:
    count = 2000
    rng = np.random.default_rng(0)
    source = ScenarioDistribution()
    drawn = [source.draw(rng) for _ in range(count)]
    columns = [
        ([sea_of(s).hs for s in drawn], 0.5, 4.0),
        ([sea_of(s).tp for s in drawn], 6.0, 14.0),
        ([sea_of(s).heading for s in drawn], 0.0, 2.0 * math.pi),
        ([s.load_mass for s in drawn], 20e3, 100e3),
        ([s.rope_length for s in drawn], 50.0, 1500.0),
        ([damping_ratio(s) for s in drawn], 0.01, 0.05),
    ]
    unit = np.array([(np.array(values) - low) / (high - low) for values, low, high in columns])
    assert (np.abs(unit.mean(axis=1) - 0.5) < 4.0 * math.sqrt(1.0 / 12.0 / count)).all()
    assert (np.abs(unit.var(axis=1) - 1.0 / 12.0) < 4.0 * math.sqrt(1.0 / 180.0 / count)).all()
    assert np.abs(np.corrcoef(unit) - np.eye(len(unit))).max() < 4.5 / math.sqrt(count)


SUB_STREAMS: list[tuple[str, dict[str, Any]]] = [
    ("sea", {"hs": 2.0, "tp": (7.0, 8.0), "gamma": (1.0, 5.0), "spreading": 4, "components": 8, "heading": 0.0}),
    ("load", {"load_mass": (5e4, 6e4)}),
    ("rope", {"rope_length": 300.0, "rope_damping_ratio": (0.0, 0.1)}),
]


@pytest.mark.parametrize(("changed", "arguments"), SUB_STREAMS)
def test_changing_one_distribution_leaves_the_other_draws_alone(changed: str, arguments: dict[str, Any]) -> None:
    """The next draws too: a sub-stream takes as many numbers however it is set."""
    source, other = ScenarioDistribution(), ScenarioDistribution(**arguments)
    rng, twin = np.random.default_rng(4), np.random.default_rng(4)
    for _ in range(3):
        a, b = source.draw(rng), other.draw(twin)
        same = {
            "sea": sea_of(a) == sea_of(b),
            "load": a.load_mass == b.load_mass,
            "rope": a.rope_length == b.rope_length and damping_ratio(a) == pytest.approx(damping_ratio(b), rel=1e-12),
        }
        assert same == {name: name != changed for name in same}
        assert sea_of(a).seed == sea_of(b).seed


def test_scenario_option_is_the_episode() -> None:
    env = AFrameHeaveEnv()
    env.reset(seed=1, options={"scenario": Scenario.paper()})
    assert env.scenario == Scenario.paper()
    env.reset()
    assert env.scenario != Scenario.paper()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scenario(load_mass=0.0), r"load_mass = 0.0 kg: must be in \[0.001, 1e\+07\] kg"),
        (lambda: Scenario(load_mass=math.nan), "load_mass = nan kg: must be in"),
        (lambda: Scenario(load_mass="heavy"), r"load_mass = 'heavy': must be a number in \[0.001, 1e\+07\] kg"),
        (lambda: Scenario(load_mass=True), "load_mass = True: must be a number"),
        (lambda: Scenario(load_mass=3.5e5), r"load_mass = 350000.0 kg: must be in \(0, 348624\) kg, .* at 3.42e\+06 N"),
        (lambda: Scenario(rope_damping=-1.0), r"rope_damping = -1.0 N s/m: must be in \[0, 1e\+08\] N s/m"),
        (lambda: Scenario(target_level=11.0), r"target_level = 11.0 m: must be below the pulley.*10.8757\) m"),
        (lambda: Scenario(target_level=5.0), r"target_level = 5.0 m needs .* m of unstretched.*in \(20, 3000\) m"),
        (lambda: Scenario(target_level=-5e3), r"target_level = -5000.0 m needs .* the winch's limits"),
        (lambda: Scenario(target_level=-math.inf), "target_level = -inf m: must be in"),
        (lambda: Scenario(initial="moving"), "initial = 'moving': must be one of 'comoving', 'rest'"),
        (lambda: Scenario(ramp=-1.0), r"ramp = -1.0 s: must be 0, or in \[0.001, 10000\] s"),
        (lambda: Scenario(gravity=0.0), r"gravity = 0.0 m/s²: must be in \[0.001, 100\] m/s²"),
        (lambda: Scenario(crane=None), "crane = None: must be a Crane"),
        (lambda: Scenario(motion=2.0), "motion = 2.0: must be a ship motion"),
        (lambda: ScenarioDistribution(hs=(3.0, 1.0)), r"hs = \(3.0, 1.0\) m: the low end is above the high end"),
        (lambda: ScenarioDistribution(hs=(1.0, 2.0, 3.0)), r"hs = .*: must be a number or a tuple"),
        (lambda: ScenarioDistribution(tp=(1.0, 9.0)), r"tp \(low\) = 1.0 s: must be in \[2, 40\] s"),
        (lambda: ScenarioDistribution(gamma="high"), "gamma = 'high': must be 'dnv', a number or a tuple"),
        (lambda: ScenarioDistribution(load_mass=(-1.0, 5.0)), r"load_mass \(low\) = -1.0 kg"),
        (lambda: ScenarioDistribution(rope_length=(1.0, 50.0)), r"rope_length = \(1.0, 50.0\) m: .* in \(20, 3000\) m"),
        (lambda: ScenarioDistribution(rope_length=9e3), r"rope_length = 9000.0 m: .* in \(20, 3000\) m, the winch's"),
        (lambda: ScenarioDistribution(rope_length=[50.0, 90.0]), r"rope_length = .*: must be a number or a tuple"),
        (lambda: ScenarioDistribution(heading=(0.0, 360.0)), r"heading \(high\) = 360.0 rad: must be in \[-6.28319,"),
        (lambda: ScenarioDistribution(load_mass=(1e5, 4e5)), r"load_mass = 400000.0 kg: .*the rope parts at 3.42e\+06"),
        (lambda: ScenarioDistribution(rope_damping_ratio=2.0), r"rope_damping_ratio = 2.0 of critical: .*\[0, 1\]"),
        (lambda: ScenarioDistribution(components=0), r"components = 0: must be in \[1, 4096\]"),
        (lambda: ScenarioDistribution(spectrum="flat"), "spectrum = 'flat': must be one of 'jonswap', 'pierson-m"),
        (lambda: Sea(hs=-1.0, tp=8.0), r"hs = -1.0 m: must be in \[0, 30\] m"),
        (lambda: Sea(hs=1.0, tp=0.0), r"tp = 0.0 s: must be in \[2, 40\] s"),
        (lambda: Sea(hs=1.0, tp=8.0, heading=180.0), r"heading = 180.0 rad: must be in \[-6.28319, 6.28319\] rad"),
        (lambda: Sea(hs=1.0, tp=8.0, gamma=0.5), r"gamma = 0.5: must be in \[1, 10\]"),
        (lambda: Sea(hs=1.0, tp=8.0, spreading=0), r"spreading = 0: must be in \[1, 100\]"),
        (lambda: Sea(hs=1.0, tp=8.0, seed=1.5), "seed = 1.5: must be an integer"),
        (lambda: SeaMotion(sea=3.0), "sea = 3.0: must be a Sea"),
        (lambda: SeaMotion(sea=Sea(hs=1.0, tp=8.0), vessel="tug"), "vessel = 'tug': must be a Vessel"),
        (lambda: Harmonic(coordinate="bob", amplitude=1.0, period=5.0), "coordinate = 'bob': must be one of 'surge'"),
        (lambda: Harmonic(coordinate="roll", amplitude=9.0, period=5.0), "amplitude = 9.0 rad"),
        (lambda: Harmonic(coordinate="heave", amplitude=1.0, period=0.0), "period = 0.0 s"),
        (lambda: HarmonicMotion(harmonics=(1.0,)), "harmonics = 1.0: must be a Harmonic"),
        (lambda: Rope(axial_stiffness=0.0), r"axial_stiffness = 0.0 N: must be in \[1, 1e\+12\] N"),
        (lambda: Rope(breaking_load=-1.0), "breaking_load = -1.0 N"),
        (lambda: Winch(drum_diameter=0.0), "drum_diameter = 0.0 m"),
        (lambda: Winch(max_rope_speed=-1.0), "max_rope_speed = -1.0 m/s"),
        (lambda: Winch(max_rope_acceleration=0.0), "max_rope_acceleration = 0.0 m/s²"),
        (lambda: Winch(lag=-0.1), "lag = -0.1 s"),
        (
            lambda: Winch(min_rope_length=50.0, max_rope_length=40.0),
            r"max_rope_length = 40.0 m: must be in \(50, 100000\]",
        ),
        (lambda: Frame(luffing_angle=2.0), r"luffing_angle = 2.0 rad: must be in \[-1.4, 1.4\] rad"),
        (lambda: Crane(drum_position=(0.0, 1.0)), r"drum_position = \(0.0, 1.0\): must be 3 numbers in m"),
        (lambda: Crane(drum_position=Crane().pulley_position), "must not be the pulley's place"),
        (lambda: Channel(noise=-1.0), "noise = -1.0 of the channel's unit"),
        (lambda: Channel(period=math.inf), "period = inf s"),
        (lambda: Sensors(delay=-0.1), r"delay = -0.1 s: must be in \[0, 10\] s"),
        (lambda: Sensors(heave=0.1), "heave = 0.1: must be a Channel"),
        (lambda: Engine(0, 0.1), "rows = 0"),
        (lambda: Engine(1, 5.0), r"control_period = 5.0 s: must be in \[0.001, 2\] s"),
        (lambda: AFrameHeaveEnv(max_inner_step=0.0), r"max_inner_step = 0.0 s: must be in \[1e-06, 0.2\] s"),
        (lambda: AFrameHeaveEnv(episode_duration=0.01), r"episode_duration = 0.01 s: must be in \[0.1, 1e\+06\] s"),
        (lambda: AFrameHeaveEnv(scenario=1.0), "scenario = 1.0: must be a Scenario, a ScenarioDistribution, a file or"),
        (lambda: AFrameHeaveEnv(scenario="absent.toml"), "scenario = 'absent.toml': cannot be read"),
        (lambda: AFrameHeaveEnv(scenario={"kind": "sea"}), "scenario: kind = 'sea': must be one of 'scenario', "),
        (
            lambda: AFrameHeaveEnv(control_step=0.1),
            "unexpected keyword argument 'control_step': must be one of control_period, ",
        ),
        (lambda: AFrameHeaveEnv(render_mode="ansi"), "render_mode = 'ansi'"),
        (lambda: AFrameHeaveEnv().reset(options={"sea": 1}), "options: unknown key 'sea': must be 'scenario'"),
        (lambda: AFrameHeaveEnv().reset(options={"scenario": 1}), r"options\['scenario'\] = 1: must be a Scenario"),
    ],
)
def test_bad_input_names_value_range_and_unit(make: Any, message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        make()


def test_servomotors_without_a_lever_are_refused():
    with pytest.raises(InvalidValue, match=r"servomotor_deck_x = 0.0 m: the servomotors' line passes the feet at 0 m"):
        Frame(servomotor_deck_x=0.0)
    # Upright, it is the cylinder's height over its base times its length.
    frame = Frame(luffing_angle=0.0, servomotor_height=3.0, servomotor_deck_x=-4.0)
    assert frame.servomotor_arm == pytest.approx(3.0 * 4.0 / 5.0)
