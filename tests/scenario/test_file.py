import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import (
    Harmonic,
    HarmonicMotion,
    InvalidValue,
    Luffing,
    RecordedMotion,
    Scenario,
    ScenarioDistribution,
    TorqueDrive,
    Vessel,
    Winch,
)
from aframe_env.scenario.crane import Crane, Frame
from aframe_env.scenario.cross_sections import FrameStructure, ISection, Servomotor, Tube
from aframe_env.scenario.file import read_scenario, scenario_text
from aframe_env.scenario.sea import SeaMotion


def back(scenario, folder):
    path = folder / "scenario.toml"
    path.write_text(scenario_text(scenario), encoding="utf-8")
    return read_scenario(path)


@settings(deadline=None, max_examples=30)
@given(
    mass=st.floats(1e3, 3e5),
    level=st.floats(-2500, -30),
    damping=st.floats(0, 1e6),
    terms=st.lists(
        st.builds(
            Harmonic,
            coordinate=st.sampled_from(["heave", "roll", "surge"]),
            amplitude=st.floats(-3, 3),
            period=st.floats(2, 60),
            phase=st.floats(-6, 6),
        ),
        max_size=4,
    ),
)
def test_what_is_written_reads_back_as_the_same_scenario(mass, level, damping, terms, tmp_path_factory):
    scenario = Scenario(
        load_mass=mass,
        target_level=level,
        rope_damping=damping,
        initial="rest",
        motion=HarmonicMotion(harmonics=tuple(terms)),
    )
    assert back(scenario, tmp_path_factory.mktemp("s")) == scenario


def test_random_seas_read_back(tmp_path):
    for seed in range(3):
        scenario = ScenarioDistribution().draw(np.random.default_rng(seed))
        assert back(scenario, tmp_path) == scenario


def test_a_crane_of_ones_own_reads_back(tmp_path):
    tube, beam = Tube(diameter=0.8, wall=0.03), ISection(height=0.9, flange_width=0.5, web=0.02, flange=0.03)
    structure = FrameStructure(leg_section=(tube, beam), beam_section=beam, servomotor=Servomotor(stiffness=2e8))
    scenario = Scenario(crane=Crane(frame=Frame(structure=structure, height=15.0)))
    assert back(scenario, tmp_path) == scenario


def test_an_empty_file_is_the_papers_case(tmp_path):
    path = tmp_path / "empty.toml"
    path.write_text("")
    assert read_scenario(path) == Scenario.paper()


def test_files_are_looked_for_beside_the_scenario(tmp_path):
    times = np.arange(0.0, 30.0, 0.5)
    heave = np.sin(times)
    lines = ["time_s,surge_m,sway_m,heave_m,roll_rad,pitch_rad,yaw_rad"]
    lines += [f"{t},0,0,{z!r},0,0,0" for t, z in zip(times.tolist(), heave.tolist(), strict=True)]
    (tmp_path / "motion.csv").write_text("\n".join(lines))
    (tmp_path / "s.toml").write_text('[motion]\nkind = "recorded"\nfile = "motion.csv"\n')
    motion = read_scenario(tmp_path / "s.toml").motion
    assert isinstance(motion, RecordedMotion)
    np.testing.assert_array_equal(motion.coordinates[:, 2], heave)
    again = back(Scenario(motion=motion), tmp_path).motion
    np.testing.assert_array_equal(again.coordinates, motion.coordinates)
    (tmp_path / "ship.csv").write_text(Vessel.supply().path.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "v.toml").write_text(
        '[motion]\nkind = "sea"\nvessel = "ship.csv"\ndeck_position = [-30, 0, 4]\n[motion.sea]\nhs = 2\ntp = 9\n'
    )
    motion = read_scenario(tmp_path / "v.toml").motion
    assert isinstance(motion, SeaMotion)
    assert motion.vessel.path == tmp_path / "ship.csv"
    assert motion.vessel.deck_position == (-30.0, 0.0, 4.0)
    assert back(Scenario(motion=motion), tmp_path).motion.vessel.deck_position == (-30.0, 0.0, 4.0)


def test_the_drive_of_a_winch_comes_back(tmp_path):
    (tmp_path / "empty.toml").write_text("[crane.winch.drive]\n")
    assert read_scenario(tmp_path / "empty.toml").crane.winch.drive == TorqueDrive()
    scenario = Scenario(crane=Crane(winch=Winch(drive=TorqueDrive(bandwidth=6.0, tension_feedforward=0.5))))
    assert back(scenario, tmp_path) == scenario
    assert back(Scenario(), tmp_path).crane.winch.drive is None


def test_what_no_file_holds_can_not_be_written():
    motion = RecordedMotion(times=np.arange(20.0), coordinates=np.zeros((20, 6)))
    with pytest.raises(InvalidValue, match="not read from a file"):
        scenario_text(Scenario(motion=motion))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("load_mas = 1", "unknown key 'load_mas'"),
        ("load_mass = 'a'", "[load_mass] 'a': must be a number"),
        ("load_mass = true", "[load_mass] True: must be a number"),
        ("load_mass = -1", "load_mass = -1.0 kg: must be in [0.001, 1e+07] kg"),
        ("target_level = 50", "target_level = 50.0 m: must be below the pulley"),
        ("[crane.winch]\nmax_rope_speed = true", "[crane.winch.max_rope_speed] True: must be a number"),
        ("[crane]\ndrum_position = [1, 2]", "[crane.drum_position]"),
        ("[crane.frame.structure.leg_section]\nkind = 'pipe'", "kind = 'pipe': must be one of 'box'"),
        ("[crane.frame.structure.leg_section]\nkind = 'tube'", "key 'diameter' is missing"),
        ("[crane.frame.structure.leg_section]\nwall = 1", "[crane.frame.structure.leg_section] key 'kind' is missing"),
        (
            "[crane.frame.structure]\nbeam_section = [{kind = 'tube', diameter = 1, wall = 'a'}]",
            "[crane.frame.structure.beam_section[0].wall] 'a': must be a number",
        ),
        ("motion = 3", "[motion] 3: must be a table with a kind"),
        ("[motion]\nkind = 'foo'", "[motion] kind = 'foo': must be one of 'harmonic', 'sea', 'recorded'"),
        ("[motion]\nhs = 3", "[motion] key 'kind' is missing: must be one of 'harmonic', 'sea', 'recorded'"),
        ("[motion]\nkind = 'sea'", "[motion.sea] key 'sea' is missing"),
        ("[motion]\nkind = 'sea'\nvessel = 3\n[motion.sea]\nhs = 2\ntp = 8", "[motion.vessel] 3: must be of type str"),
        ("[motion]\nkind = 'sea'\ndeck_position = [1]\n[motion.sea]\nhs = 2\ntp = 8", "[motion.deck_position]"),
        ("[motion]\nkind = 'sea'\n[motion.sea]\nhs = 'a'\ntp = 8", "[motion.sea.hs] 'a': must be a number"),
        ("[motion]\nkind = 'sea'\n[motion.sea]\nhs = 50\ntp = 8", "[motion.sea] hs = 50.0 m: must be in [0, 30] m"),
        ("[motion]\nkind = 'sea'\n[motion.sea]\nhs = 5\ntp = 8\nx = 1", "[motion.sea] unknown key 'x'"),
        ("[motion]\nkind = 'sea'\n[motion.sea]\nhs = 2", "[motion.sea.tp] key 'tp' is missing"),
        ("[motion]\nkind = 'sea'\nship = 'a'\n[motion.sea]\nhs = 2\ntp = 8", "unknown key 'ship'"),
        ("[motion]\nkind = 'sea'\n[motion.sea]\nhs = 2\ntp = 8\nspectrum = 'x'", "spectrum = 'x': must be one of"),
        ("[motion]\nkind = 'recorded'\nfile = 'n.csv'", "n.csv': cannot be read"),
        ("[motion]\nkind = 'recorded'", "[motion.file] key 'file' is missing"),
        ("a =", "not TOML"),
    ],
)
def test_a_bad_file_is_named_with_its_key(text, words, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(InvalidValue) as caught:
        read_scenario(path)
    assert str(path) in str(caught.value)
    assert words in str(caught.value)


def test_an_unreadable_file(tmp_path):
    with pytest.raises(InvalidValue, match="cannot be read"):
        read_scenario(tmp_path / "absent.toml")


def test_a_frame_that_luffs_is_read_in_degrees_and_written_so_that_it_reads_back_the_same(tmp_path):
    (tmp_path / "swing.toml").write_text(
        "target_level = -20.0\n[crane.frame]\nluffing_angle = -0.6981317\n[crane.winch]\nmin_rope_length = 10.0\n"
        "[luffing]\npoints = [[0, -40.0], [60, 25.0], [130, -37.3]]\nmax_speed = 0.2\n"
    )
    scenario = read_scenario(tmp_path / "swing.toml")
    angles = (math.radians(-40.0), math.radians(25.0), math.radians(-37.3))
    assert scenario.luffing == Luffing(points=tuple(zip((0.0, 60.0, 130.0), angles, strict=True)), max_speed=0.2)
    assert back(scenario, tmp_path) == scenario
