"""Distributions of one's own: read from a file, with recorded motions and sensors."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import (
    Channel,
    Crane,
    Frame,
    InvalidValue,
    RecordedMotion,
    RecordedWindow,
    Scenario,
    ScenarioDistribution,
    Sensors,
    TaskConfig,
    Winch,
    read_scenario,
    read_scenarios,
    scenario_text,
)
from aframe_env.scenario.file import _Distribution


def record(duration: float, period: float = 9.0, *, path: Path | None = None) -> RecordedMotion:
    """Heave of one period, sampled at 10 Hz."""
    times = np.arange(round(10 * duration) + 1) * 0.1
    coordinates = np.zeros((len(times), 6))
    coordinates[:, 2] = 1.5 * np.sin(2 * np.pi * times / period)
    motion = RecordedMotion(times=times, coordinates=coordinates)
    if path is None:
        return motion
    header = "time_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg"
    lines = [",".join(f"{value:.9g}" for value in (t, *row)) for t, row in zip(times, coordinates, strict=True)]
    path.write_text("\n".join([header, *lines]))
    return RecordedMotion.from_csv(path)


def test_the_file_has_the_fields_of_the_distribution() -> None:
    assert {f.name for f in fields(_Distribution)} == {f.name for f in fields(ScenarioDistribution)} | {"deck_position"}


@settings(deadline=None, max_examples=25)
@given(
    hs=st.tuples(st.floats(0.0, 2.0), st.floats(2.0, 6.0)),
    tp=st.floats(5.0, 15.0),
    gamma=st.one_of(st.just("dnv"), st.floats(1.0, 10.0), st.just((1.0, 5.0))),
    mass=st.tuples(st.floats(1e3, 2e4), st.floats(2e4, 2e5)),
    spreading=st.one_of(st.none(), st.integers(1, 40)),
    speed=st.floats(0.5, 4.0),
    delay=st.floats(0.0, 1.0),
)
def test_what_is_written_reads_back_as_the_same_distribution(
    hs, tp, gamma, mass, spreading, speed, delay, tmp_path_factory
):
    source = ScenarioDistribution(
        hs=hs,
        tp=tp,
        gamma=gamma,
        load_mass=mass,
        spreading=spreading,
        crane=Crane(winch=Winch(max_rope_speed=speed), frame=Frame(height=14.0)),
        sensors=Sensors(delay=delay, tension=Channel(noise=500.0)),
    )
    path = tmp_path_factory.mktemp("d") / "mine.toml"
    path.write_text(scenario_text(source), encoding="utf-8")
    assert read_scenarios(path) == source


def test_records_read_back(tmp_path):
    source = ScenarioDistribution(records=(record(90.0, path=tmp_path / "a.csv"),), window=61.0)
    (tmp_path / "mine.toml").write_text(scenario_text(source), encoding="utf-8")
    back = read_scenarios(tmp_path / "mine.toml")
    assert back.window == 61.0
    rng, twin = np.random.default_rng(3), np.random.default_rng(3)
    a, b = source.draw(rng).motion, back.draw(twin).motion
    assert (a.start, a.duration) == (b.start, b.duration)
    np.testing.assert_array_equal(a.table(0.1), b.table(0.1))
    scenario = source.draw(rng)
    (tmp_path / "one.toml").write_text(scenario_text(scenario), encoding="utf-8")
    np.testing.assert_array_equal(read_scenario(tmp_path / "one.toml").motion.table(0.1), scenario.motion.table(0.1))


def test_a_window_is_a_stretch_of_the_record():
    whole = record(120.0)
    window = RecordedWindow(record=whole, start=17.3, duration=60.0)
    times = np.linspace(0.0, 60.0, 77)
    np.testing.assert_array_equal(window.at(times), whole.at(times + 17.3))
    exact = 1.5 * np.sin(2 * np.pi * (17.3 + 0.2 * np.arange(301)) / 9.0)
    np.testing.assert_allclose(window.table(0.2)[:, 2], exact, atol=1e-6)


def test_every_start_in_every_record_is_as_likely():
    source = ScenarioDistribution(records=(record(70.0), record(100.0)), window=60.0, ramp=0.0)
    rng = np.random.default_rng(0)
    motions = [source.draw(rng).motion for _ in range(2000)]
    starts = [np.array([m.start for m in motions if m.record is each]) for each in source.records]
    # 10 s of starts in the one, 40 s in the other.
    assert len(starts[0]) / 2000 == pytest.approx(0.2, abs=0.03)
    for found, room in zip(starts, (10.0, 40.0), strict=True):
        assert np.mean(found) == pytest.approx(0.5 * room, rel=0.1)
        assert 0.0 <= found.min() < 0.05 * room
        assert 0.95 * room < found.max() <= room


def test_records_do_not_pile_up_in_the_environment():
    """Memory does not depend on how many stretches have been met, and each is met as it is."""
    source = ScenarioDistribution(records=(record(300.0),), window=60.0, ramp=0.0)
    envs = gymnasium.make_vec(
        "AFrameHeave-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        scenario=source,
        autoreset_mode="SameStep",
        episode_duration=0.2,
    )
    envs.reset(seed=0)
    engine = envs.unwrapped.simulation.engine
    for _ in range(200):
        envs.step(np.zeros((3, 1), dtype=np.float32))
    assert len(engine.records) <= 8 * 601
    deck = engine.deck()
    for row, scenario in enumerate(envs.unwrapped.scenarios):
        np.testing.assert_allclose(deck[row], scenario.motion.at([0.0])[0, 0], atol=1e-12)
        envs.unwrapped.simulation.advance(np.zeros(3))
    deck = engine.deck()
    for row, scenario in enumerate(envs.unwrapped.scenarios):
        np.testing.assert_allclose(deck[row], scenario.motion.at([0.3])[0, 0], atol=1e-5)


def test_sensors_of_a_distribution_measure_its_task():
    sensors = Sensors(delay=0.3)
    source = ScenarioDistribution(sensors=sensors)
    assert TaskConfig(scenario=source, observation="sensors").sensors == sensors
    assert TaskConfig(scenario=source).sensors is None
    other = Sensors.ideal()
    assert TaskConfig(scenario=source, observation=other).sensors == other


def test_an_environment_takes_files_and_mappings(tmp_path):
    told = {"kind": "distribution", "hs": [1.0, 2.0], "load_mass": 40e3, "crane": {"winch": {"max_rope_speed": 1.5}}}
    path = tmp_path / "mine.toml"
    path.write_text('kind = "distribution"\nhs = [1.0, 2.0]\nload_mass = 40e3\n[crane.winch]\nmax_rope_speed = 1.5\n')
    own = ScenarioDistribution(hs=(1.0, 2.0), load_mass=40e3, crane=Crane(winch=Winch(max_rope_speed=1.5)))
    seen = []
    for scenario in (told, path, str(path), own):
        env = gymnasium.make("AFrameHeave-v0", scenario=scenario)
        assert env.action_space.high[0] == 2.0
        seen.append(env.reset(seed=5)[0])
        assert env.unwrapped.scenario.load_mass == 40e3
    for each in seen[1:]:
        np.testing.assert_array_equal(each, seen[0])
    env = gymnasium.make("AFrameHeave-v0", scenario={"load_mass": 30e3})
    env.reset(seed=0)
    assert env.unwrapped.scenario == Scenario(load_mass=30e3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('kind = "seas"', r"mine.toml: kind = 'seas': must be one of 'scenario', 'distribution'"),
        ('kind = "distribution"\nhs = [2.0, 1.0]', r"hs = \(2.0, 1.0\) m: the low end is above the high end"),
        ('kind = "distribution"\nhs = "big"', r"\[hs\] 'big': must be a number"),
        ('kind = "distribution"\nhs = [1.0]', r"mine.toml: \[hs\] must be 2 numbers"),
        ('kind = "distribution"\ncrane = "big"', r"mine.toml: \[crane\] must be a table"),
        ("hs = [1.0, 2.0]", 'mine.toml: .hs. belongs to a distribution: begin the file with kind = "distribution"'),
        ('kind = "distribution"\nwindow = 30.0', r"mine.toml: window = 30 s: goes with records, and there are none"),
        ('kind = "distribution"\nwaves = 1', r"unknown key 'waves': must be one of"),
        ('kind = "distribution"\ngamma = "broad"', r"gamma = 'broad': must be 'dnv', a number or"),
        ('kind = "distribution"\nrecords = ["absent.csv"]', r"absent.csv': cannot be read"),
        ('kind = "distribution"\nvessel = "absent.csv"', r"mine.toml: .*absent.csv"),
        ('kind = "distribution"\n[sensors]\ndelay = -1.0', r"delay = -1.0 s: must be in \[0, 10\] s"),
        ('kind = "distribution"\n[sensors.wind]\nnoise = 1.0', r"unknown key 'wind'"),
    ],
)
def test_bad_files_are_one_clear_line(text, words, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(InvalidValue, match=words) as raised:
        read_scenarios(path)
    assert "\n" not in str(raised.value)


def test_bad_records():
    with pytest.raises(InvalidValue, match=r"window = 60 s: must be in \(0, 50\] s, the length of a record"):
        ScenarioDistribution(records=(record(50.0),))
    with pytest.raises(InvalidValue, match=r"records = 'x\.csv': must be a RecordedMotion"):
        ScenarioDistribution(records=("x.csv",))
    with pytest.raises(InvalidValue, match=r"duration = 50.0 s: must be in \(0, 49\] s"):
        RecordedWindow(record=record(50.0), start=1.0, duration=50.0)
    with pytest.raises(InvalidValue, match=r"hs = 2.0: goes with seas, and records stand in their place"):
        ScenarioDistribution(records=(record(99.0),), hs=2.0)
    source = ScenarioDistribution(records=(record(99.0),))
    env = gymnasium.make("AFrameHeave-v0", scenario=source, episode_duration=90.0)
    with pytest.raises(InvalidValue, match="episode_duration = 90 s"):
        env.reset(seed=0)


def test_a_distribution_is_no_scenario(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('kind = "distribution"')
    assert read_scenarios(path) == ScenarioDistribution()
    with pytest.raises(InvalidValue, match="a distribution of scenarios: must be one scenario"):
        read_scenario(path)
