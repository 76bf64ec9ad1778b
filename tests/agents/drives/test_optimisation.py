import numpy as np
import pytest
from scipy.optimize import least_squares

from aframe_env import Harmonic, HarmonicMotion, InvalidValue, Scenario, ScenarioDistribution
from agents.drives.functions import spline_matrices
from agents.drives.guesses import required_angle
from agents.drives.objectives import Objective, coarse_step
from agents.drives.optimisation import optimise


def paper(damping=1.5e4):
    return Scenario.paper(initial="rest", rope_damping=damping)


@pytest.fixture(scope="module")
def found():
    """The paper's four drives."""
    return {
        (family, name): optimise(family, paper(), name, 36.0, intervals=18, harmonics=1, max_evaluations=20_000)
        for family in ("spline", "harmonic")
        for name in ("omega1", "omega2")
    }


def test_paper_case_comes_to_rest(found):
    still = Objective(paper(), 36.0).still()
    assert still.amplitude > 2.0
    for (family, _), drive in found.items():
        assert drive.amplitude <= (0.040 if family == "spline" else 0.005)
    assert found["spline", "omega1"].amplitude > 4.0 * found["harmonic", "omega1"].amplitude


def test_each_objective_is_least_where_it_was_the_goal(found):
    for family in ("spline", "harmonic"):
        one, two = found[family, "omega1"], found[family, "omega2"]
        assert one.omega1 < two.omega1
        assert two.omega2 < one.omega2


def test_spline_reaches_the_optimum_that_gauss_newton_finds():
    """The drive enters nearly linearly: least squares on the depth error knows the least Ω1."""
    scenario = paper()
    objective = Objective(scenario, 24.0, coarse_step(scenario))
    angle, speed = spline_matrices(24.0, 12, objective.times)

    def error(v):
        objective.evaluate(angle @ v, speed @ v)
        return objective._errors * np.sqrt(objective.step)

    least = least_squares(error, np.linalg.lstsq(angle, required_angle(objective), rcond=None)[0])
    best = objective.evaluate(angle @ least.x, speed @ least.x).omega1
    drive = optimise("spline", scenario, "omega1", 24.0, intervals=12).drive
    assert objective.drive(drive).omega1 < 1.01 * best


@pytest.mark.parametrize(("family", "harmonics"), [("spline", 0), ("harmonic", 1)])
def test_gauss_newton_finds_the_same_drive_in_far_fewer_evaluations(found, family, harmonics):
    kwargs = {"intervals": 18, "harmonics": harmonics or 1}
    one = optimise(family, paper(), "omega1", 36.0, optimiser="gauss-newton", **kwargs)
    assert one.omega1 == pytest.approx(found[family, "omega1"].omega1, rel=1e-3)
    assert one.evaluations < 0.2 * found[family, "omega1"].evaluations
    times = np.linspace(0.0, 36.0, 400)
    np.testing.assert_allclose(one.drive.angle(times), found[family, "omega1"].drive.angle(times), atol=2e-3)


def test_omega2_starts_from_what_gauss_newton_found(found):
    two = optimise("harmonic", paper(), "omega2", 36.0, harmonics=1, optimiser="gauss-newton")
    assert two.omega2 == pytest.approx(found["harmonic", "omega2"].omega2, rel=2e-2)


def test_a_start_from_a_like_scenarios_drive_leads_to_the_same_optimum():
    """The optimum of a load 1 % heavier is next door."""
    kwargs = {"duration": 36.0, "harmonics": 1}
    near = optimise("harmonic", Scenario.paper(initial="rest", rope_damping=1.5e4, load_mass=1.01e5), **kwargs)
    cold = optimise("harmonic", paper(), **kwargs)
    warm = optimise("harmonic", paper(), start=near.drive.variables, **kwargs)
    assert warm.omega1 == pytest.approx(cold.omega1, rel=1e-2)
    with pytest.raises(InvalidValue, match="start of shape"):
        optimise("harmonic", paper(), start=[1.0, 2.0], **kwargs)


def test_neighbours_run_side_by_side_as_they_run_alone():
    scenario = ScenarioDistribution().draw(np.random.default_rng(1))
    objective = Objective(scenario, 20.0, coarse_step(scenario))
    angle, speed = spline_matrices(20.0, 8, objective.times)
    x = 0.3 * np.sin(np.arange(8.0))
    perturbed = objective.perturbed_errors(angle @ x, speed @ x, angle, speed)
    for j in range(8):
        alone = objective.errors(angle @ x + angle[:, j], speed @ x + speed[:, j])
        np.testing.assert_allclose(perturbed[:, j], alone, atol=1e-9)


def test_figures_are_those_of_the_drive_itself(found):
    drive = found["harmonic", "omega1"]
    outcome = Objective(paper(), 36.0).drive(drive.drive)
    assert (drive.omega1, drive.omega2) == (outcome.omega1, outcome.omega2)


def test_the_same_seed_finds_the_same_drive():
    kwargs = {"duration": 12.0, "intervals": 6, "max_evaluations": 800}
    first, second = (optimise("spline", paper(), "omega2", seed=5, **kwargs) for _ in range(2))
    assert first.drive == second.drive
    assert first.evaluations == second.evaluations <= 800


def test_it_needs_no_luck_in_random_seas():
    distribution = ScenarioDistribution()
    for seed in range(4):
        scenario = distribution.draw(np.random.default_rng(seed))
        still = Objective(scenario, 60.0).still()
        drive = optimise("spline", scenario, "omega1", 60.0, intervals=48, max_evaluations=4000)
        assert drive.rms < 0.05 * still.rms


def test_required_angle_of_pure_heave_is_the_heave_over_the_radius():
    scenario = Scenario(motion=HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=2.0, period=12.0),)))
    objective = Objective(scenario, 12.0)
    strain = scenario.weight / scenario.crane.rope.axial_stiffness
    want = 2.0 * np.sin(2 * np.pi * objective.times / 12.0) / (0.75 * (1.0 + strain))
    np.testing.assert_allclose(required_angle(objective), want, atol=1e-9)


def test_progress_is_reported():
    seen = []
    optimise("harmonic", paper(), "omega1", 12.0, harmonics=1, progress=lambda n, best: seen.append((n, best)))
    counts, values = zip(*seen, strict=True)
    assert list(counts) == sorted(counts)
    assert list(values) == sorted(values, reverse=True)


@pytest.mark.parametrize(
    ("kwargs", "words"),
    [
        ({"family": "square"}, "family = 'square': must be one of 'spline', 'harmonic'"),
        ({"objective": "omega3"}, "objective = 'omega3'"),
        ({"intervals": 2}, r"intervals = 2: must be in \[3, 500\]"),
        ({"harmonics": 0}, r"harmonics = 0: must be in \[1, 64\]"),
        ({"duration": -5.0}, r"duration = -5.0 s: must be in \[0.1, 3600\] s"),
        ({"max_evaluations": 0}, "max_evaluations = 0"),
        ({"seed": -1}, "seed = -1"),
        ({"optimiser": "luck"}, "optimiser = 'luck': must be one of 'nelder-mead', 'gauss-newton'"),
    ],
)
def test_bad_arguments_are_named(kwargs, words):
    with pytest.raises(InvalidValue, match=words):
        optimise(**{"family": "spline", "scenario": paper(), **kwargs})
