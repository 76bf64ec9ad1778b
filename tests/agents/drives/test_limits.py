"""Drives under the winch's limits against the real engine, and drives with a free start."""

from dataclasses import replace

import numpy as np
import pytest

from aframe_env import Harmonic, HarmonicMotion, InvalidValue, Scenario, ScenarioDistribution
from agents.control.optimum import saturating
from agents.drives.functions import HarmonicDrive, SplineDrive
from agents.drives.objectives import Objective, coarse_step
from agents.drives.optimisation import optimise
from agents.drives.policy import DrivePolicy
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run

PERIOD = 0.1


@pytest.fixture(scope="module")
def met():
    """Two seas in reach of the winch, and three that are not."""
    scenarios = held_out_scenarios(ScenarioDistribution(), 40)
    chosen = [scenarios[i] for i in (0, 2, 26, 32, 39)]
    assert saturating(chosen).tolist() == [False, False, True, True, True]
    return chosen


@pytest.fixture(scope="module")
def limited(met):
    return {
        intervals: [
            optimise("spline", s, intervals=intervals, optimiser="gauss-newton", control_period=PERIOD) for s in met
        ]
        for intervals in (48, 96)
    }


def played(drives, scenarios):
    return run(DrivePolicy(name="S", drives=drives), scenarios)


def test_what_is_optimised_is_what_the_engine_plays(met, limited):
    still = run(DrumStill(), met).rms
    for drives in limited.values():
        episodes = played(drives, met)
        np.testing.assert_allclose(
            [d.rms / s for d, s in zip(drives, still, strict=True)], episodes.rms / still, atol=2e-5
        )


@pytest.mark.parametrize("lag", [0.0, 0.4])
def test_any_drive_is_played_as_by_the_engine(lag):
    """Out of reach, under way at once, and on a winch with a lag that the follower does not reckon with."""
    scenario = held_out_scenarios(ScenarioDistribution(), 1)[0]
    scenario = _with_winch(scenario, lag=lag, max_rope_speed=1.0, max_rope_acceleration=0.5)
    drive = HarmonicDrive(duration=60.0, amplitudes=(2.0, 1.0), frequencies=(0.7, 1.3), phases=(0.1, 1.0))
    objective = Objective(scenario, 60.0, 0.01, PERIOD)
    found = optimise("spline", scenario, duration=1.0, max_evaluations=1)
    outcome = objective.drive(drive)
    episodes = played([replace(found, drive=drive)], [scenario])
    assert outcome.omega1 == pytest.approx(episodes.omega1[0], rel=1e-5)
    assert outcome.omega2 == pytest.approx(episodes.omega2[0], rel=1e-3)


def _with_winch(scenario, **winch):
    return replace(scenario, crane=replace(scenario.crane, winch=replace(scenario.crane.winch, **winch)))


def test_where_the_winch_saturates_it_pays_to_know(met, limited):
    unlimited = [optimise("spline", s, intervals=96, optimiser="gauss-newton") for s in met[2:]]
    assert (played(limited[96][2:], met[2:]).rms < 0.8 * played(unlimited, met[2:]).rms).all()


def test_more_intervals_are_never_worse(met, limited):
    """The knots of 48 intervals are among those of 96; natural ends and local optima leave half a percent."""
    still = run(DrumStill(), met).rms
    few, many = (played(limited[n], met).rms / still for n in (48, 96))
    assert (many[:2] < few[:2]).all()
    assert (many < few + 0.01).all()


def test_a_free_start_at_zero_is_the_fixed_start():
    scenario = Scenario.paper(initial="rest", rope_damping=1.5e4)
    objective = Objective(scenario, 20.0)
    values = [1.0, 2.0, -1.0, 0.5]
    fixed = SplineDrive.from_variables(values, 20.0)
    assert objective.drive(SplineDrive.from_variables([0.0, *values], 20.0, free_start=True)) == objective.drive(fixed)
    harmonics = [2.5, 0.53, 0.2]
    fixed = HarmonicDrive.from_variables(harmonics, 20.0)
    free = HarmonicDrive.from_variables([-2.5 * np.sin(0.2), *harmonics], 20.0, free_start=True)
    assert objective.drive(free).omega1 == pytest.approx(objective.drive(fixed).omega1, rel=1e-12)


def test_a_drum_that_starts_elsewhere_has_moved_a_load_that_hangs_at_rest():
    """In a calm sea a constant drive leaves the load where the rope's law says, for all the time."""
    calm = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=0.0, period=10.0),))
    scenario = Scenario(motion=calm, initial="rest")
    drive = SplineDrive.from_variables([0.8] * 5, 10.0, free_start=True)
    radius, strain = scenario.crane.winch.drum_radius, scenario.weight / scenario.crane.rope.axial_stiffness
    error = Objective(scenario, 10.0).trajectory(drive)[1]
    np.testing.assert_allclose(error, -0.8 * radius * (1.0 + strain), atol=1e-6)


@pytest.mark.parametrize(("family", "optimiser"), [("spline", "nelder-mead"), ("harmonic", "gauss-newton")])
def test_a_free_start_leaves_no_more_than_a_fixed_one(family, optimiser):
    scenario = Scenario.paper(initial="rest", rope_damping=1.5e4)
    kwargs = {"duration": 36.0, "intervals": 18, "harmonics": 1, "optimiser": optimiser}
    fixed = optimise(family, scenario, **kwargs)
    free = optimise(family, scenario, free_start=True, **kwargs)
    assert len(free.drive.variables) == len(fixed.drive.variables) + 1
    assert 0.9 * fixed.omega1 < free.omega1 < fixed.omega1


def test_bad_arguments_are_named():
    scenario = Scenario.paper()
    with pytest.raises(InvalidValue, match="free_start, control_period: give one of the two"):
        optimise("spline", scenario, free_start=True, control_period=0.1)
    with pytest.raises(InvalidValue, match=r"duration = 36.05 s: must be whole control steps of 0.1 s"):
        Objective(scenario, 36.05, coarse_step(scenario), 0.1)
    with pytest.raises(InvalidValue, match=r"must be \(3 n \+ 1,\)"):
        HarmonicDrive.from_variables([1.0, 2.0, 3.0], 10.0, free_start=True)
