import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import Harmonic, HarmonicMotion, InvalidValue, Scenario, ScenarioDistribution
from agents.drives import map as drive_map
from agents.drives.forecast import Harmonics, Measurement, fit_harmonics, known_harmonics, tip_heave
from agents.drives.functions import HarmonicDrive, RampedDrive
from agents.drives.map import DriveMap, Node, ideal_ratio, optimise_node
from agents.drives.map_policy import DriveMapPolicy
from agents.drives.objectives import Objective
from agents.policy import DrumStill, Knowledge
from agents.rollout import held_out_scenarios, run

AXES = ([0.5, 2.0, 4.0], [5.0, 9.0, 20.0], [1e4, 5e4, 1.1e5], [40.0, 300.0, 1600.0])


def made(ratio):
    axes = [np.array(axis) for axis in AXES]
    return DriveMap(*axes, np.asarray(ratio, dtype=complex), np.zeros((3, 3, 3, 3)))


def ideal():
    """The map that the closed form gives."""
    ratio = [
        [[[ideal_ratio(Node(amplitude=a, period=p, mass=m, length=d).scenario) for d in AXES[3]] for m in AXES[2]]]
        for a, p in [(1.0, 10.0)]
    ]
    return made(np.broadcast_to(np.array(ratio), (3, 3, 3, 3)))


def test_the_map_is_exact_at_its_nodes():
    rng = np.random.default_rng(0)
    ratio = rng.normal(size=(3, 3, 3, 3)) + 1j * rng.normal(size=(3, 3, 3, 3))
    found = made(ratio).ratio_at(*np.meshgrid(*AXES, indexing="ij"))
    np.testing.assert_allclose(found, ratio, atol=1e-13)


@settings(deadline=None, max_examples=30)
@given(u=st.tuples(*[st.floats(0.0, 1.0)] * 4), c=st.tuples(*[st.floats(-2, 2)] * 4))
def test_between_the_nodes_it_is_linear_in_amplitude_log_period_mass_and_log_length(u, c):
    def plane(a, p, m, d):
        return c[0] * a + c[1] * np.log(p) + c[2] * m / 1e5 + 1j * c[3] * np.log(d)

    ratio = plane(*np.meshgrid(*map(np.array, AXES), indexing="ij"))
    place = [axis[0] + x * (axis[-1] - axis[0]) for axis, x in zip(AXES, u, strict=True)]
    assert made(ratio).ratio_at(*place) == pytest.approx(plane(*place), abs=1e-11)


def test_beyond_the_grid_its_edge_counts():
    ratio = np.random.default_rng(1).normal(size=(3, 3, 3, 3))
    assert made(ratio).ratio_at(9.0, 60.0, 2e5, 9e3) == pytest.approx(ratio[-1, -1, -1, -1])
    assert made(ratio).ratio_at(0.0, 1.0, 1.0, 1.0) == pytest.approx(ratio[0, 0, 0, 0])


@pytest.mark.parametrize(
    ("amplitude", "period", "mass", "length"),
    [(1.0, 8.0, 5e4, 300.0), (4.0, 6.0, 1.1e5, 60.0), (0.3, 18.0, 2e4, 900.0), (2.0, 5.5, 1.1e5, 1600.0)],
)
def test_the_optimum_of_a_node_is_the_closed_form(amplitude, period, mass, length):
    """Constant tension: the unstretched length follows the tip, shortened by the strain m g / (E_R F_R)."""
    node = Node(amplitude=amplitude, period=period, mass=mass, length=length)
    found = optimise_node(node)
    want = 1.0 / (1.0 + mass * 9.81 / 2.0e8)
    assert ideal_ratio(node.scenario) == pytest.approx(want, rel=1e-12)
    assert complex(found.real, found.imaginary) == pytest.approx(want, abs=5e-4)
    assert found.remaining < 3e-4


@pytest.mark.parametrize("gain", [0.0, 0.6, 1.3])
def test_another_gain_leaves_what_the_rope_oscillator_answers(gain):
    """Steady state of m ẍ + d ẋ + c x = c s + d ṡ, s = (1 - gain/ideal) z the rope's end: the linear model's answer."""
    amplitude, period = 0.2, 9.0
    node = Node(amplitude=amplitude, period=period, mass=8e4, length=800.0, damping_ratio=0.2)
    scenario = node.scenario
    drive = RampedDrive(duration=180.0, variables=np.array([gain * amplitude / 0.75, 2.0 * math.pi / period, 0.0]))
    times, error = Objective(scenario, 180.0, 0.02).trajectory(drive)
    w, wn, zeta = 2.0 * math.pi / period, scenario.rope_frequency, 0.2
    transfer = (wn**2 + 2j * zeta * wn * w) / (wn**2 - w**2 + 2j * zeta * wn * w)
    want = abs(transfer) * abs(1.0 - gain / ideal_ratio(scenario)) * amplitude
    late = times > 180.0 - 2.0 * period - 1e-9
    basis = np.stack([np.sin(w * times), np.cos(w * times), np.ones(len(times))], axis=1)[late]
    sine, cosine, _ = np.linalg.lstsq(basis, error[late], rcond=None)[0]
    assert math.hypot(sine, cosine) == pytest.approx(want, rel=5e-3)


def test_a_drive_for_two_harmonics_is_the_sum_of_theirs():
    heave = Harmonics(np.array([1.0, 0.4]), np.array([0.6, 1.1]), np.array([0.3, -2.0]))
    scenario = Scenario.paper()
    times = np.linspace(0.0, 60.0, 301)
    drive = ideal().drive(scenario, heave, 60.0)
    want = ideal_ratio(scenario) * (heave.at(times) - heave.at(np.zeros(1))) / 0.75
    np.testing.assert_allclose(drive.angle(times), want, atol=1e-3)


def test_a_ramped_drive_is_the_ramp_times_the_harmonics():
    variables = np.array([1.0, 0.7, 0.4, 0.3, 1.9, -1.0])
    plain = HarmonicDrive.from_variables(variables, 60.0)
    times = np.linspace(0.0, 60.0, 601)
    np.testing.assert_allclose(RampedDrive(duration=60.0, variables=variables).angle(times), plain.angle(times))
    ramped = RampedDrive(duration=60.0, variables=variables, ramp=10.0)
    assert float(ramped.angle(0.0)) == 0.0
    s = np.clip(times / 10.0, 0.0, 1.0)
    at_start = math.sin(0.4) + 0.3 * math.sin(-1.0)
    want = (6 * s**5 - 15 * s**4 + 10 * s**3) * (plain.angle(times) + at_start)
    np.testing.assert_allclose(ramped.angle(times), want, atol=1e-12)
    step = 1e-5
    slope = (ramped.angle(times[1:-1] + step) - ramped.angle(times[1:-1] - step)) / (2 * step)
    np.testing.assert_allclose(ramped.speed(times[1:-1]), slope, atol=1e-6)


def test_tip_heave_is_the_engines_and_its_harmonics_nearly_are():
    scenario = ScenarioDistribution(ramp=0.0).draw(np.random.default_rng(4))
    objective = Objective(scenario, 30.0, 0.05)
    heave = tip_heave(scenario, objective.times)
    np.testing.assert_allclose(heave, objective.path[:, 2] - scenario.crane.pulley_position[2], atol=1e-5)
    # What is not linear in the deck's angles: squares of roll and pitch times the pulley's height.
    angles = scenario.motion.components().at(objective.times)[0][:, 3:5]
    slack = 10.0 * np.square(angles).sum(axis=1).max()
    np.testing.assert_allclose(known_harmonics(scenario).at(objective.times), heave, atol=slack + 1e-9)


@settings(deadline=None, max_examples=15)
@given(
    first=st.tuples(st.floats(0.3, 3.0), st.floats(0.4, 0.8), st.floats(-3.0, 3.0)),
    second=st.tuples(st.floats(0.3, 3.0), st.floats(1.0, 2.0), st.floats(-3.0, 3.0)),
)
def test_harmonics_of_a_record_are_found(first, second):
    times = np.arange(-240, 1) * 0.5
    want = Harmonics(*np.array([first, second]).T)
    found = fit_harmonics(times, want.at(times) + 0.7, 2)
    ahead = np.arange(1, 120) * 0.5
    np.testing.assert_allclose(found.at(ahead), want.at(ahead), atol=1e-3)


def test_measuring_forecasts_a_regular_wave_and_leaves_a_random_sea_alone():
    ahead = np.arange(1, 120) * 0.5
    regular = ScenarioDistribution(components=1).draw(np.random.default_rng(2))
    heave = tip_heave(regular, ahead)
    np.testing.assert_allclose(Measurement().forecast(regular).at(ahead), heave, atol=0.02 * np.abs(heave).max())
    for scenario in held_out_scenarios(ScenarioDistribution(), 3):
        forecast = Measurement().forecast(scenario)
        # Nothing after the start was looked at: the same record, the same forecast; and it is small.
        heave = tip_heave(scenario, ahead)
        assert forecast.at(ahead).std() < 0.7 * heave.std()


def test_the_policy_in_the_environment():
    still, seas = {}, {}
    for kind, distribution in (("regular", ScenarioDistribution(components=1)), ("random", ScenarioDistribution())):
        scenarios = held_out_scenarios(distribution, 4)
        still[kind] = run(DrumStill(), scenarios).rms
        seas[kind] = scenarios
    every, measured = DriveMapPolicy(ideal(), None), DriveMapPolicy(ideal())
    assert (every.knows, measured.knows) == (Knowledge.FUTURE, Knowledge.CLOCK)
    assert "240 s before the start" in measured.measured
    for kind, scenarios in seas.items():
        assert np.median(run(every, scenarios).rms / still[kind]) < 0.03
    assert np.median(run(measured, seas["regular"]).rms / still["regular"]) < 0.03
    assert np.all(run(measured, seas["random"]).rms < 1.5 * still["random"])


def test_the_future_is_not_looked_at():
    """A motion that changes only after the start leads to the same drive."""

    class Recorded:
        def __init__(self):
            self.asked = []

        def components(self):
            outer = self

            class Spy:
                def at(self, times):
                    outer.asked.append(float(np.max(times)))
                    return HarmonicMotion.paper().components().at(times)

            return Spy()

    motion = Recorded()
    scenario = Scenario(motion=motion)
    DriveMapPolicy(ideal()).reset([scenario], 0.1)
    assert motion.asked
    assert max(motion.asked) <= 0.0


def test_a_map_survives_the_disk_and_a_damaged_one_is_refused(tmp_path):
    original = made(np.random.default_rng(2).normal(size=(3, 3, 3, 3)))
    data, card = drive_map.serialise(original, "python -m train.drive_map", {"numpy": "2"})
    (tmp_path / drive_map.ARRAYS).write_bytes(data)
    (tmp_path / drive_map.CARD).write_text(card, encoding="utf-8")
    again = drive_map.load(tmp_path)
    for name in (*drive_map.AXES, "ratio", "remaining"):
        np.testing.assert_array_equal(getattr(again, name), getattr(original, name))
    (tmp_path / drive_map.ARRAYS).write_bytes(data[:-1] + b"x")
    with pytest.raises(InvalidValue, match="does not match the sha256"):
        drive_map.load(tmp_path)
    with pytest.raises(InvalidValue, match="no drive map in"):
        drive_map.load(tmp_path / "elsewhere")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: DriveMap(*[np.array([2.0, 1.0])] * 4, np.ones((2,) * 4), np.ones((2,) * 4)), "amplitude: must be"),
        (lambda: made(np.full((3, 3, 3, 3), np.nan)), "must be finite"),
        (lambda: made(np.ones((3, 3, 3))), r"must be \(3, 3, 3, 3\)"),
        (lambda: Measurement(record=100.0), r"record = 100.0 s: must be in \[180, 100000\] s"),
        (lambda: ideal().drive(Scenario.paper(), known_harmonics(Scenario.paper()), -1.0), "duration = -1.0 s"),
    ],
)
def test_bad_maps_are_refused(make, words):
    with pytest.raises(InvalidValue, match=words):
        make()


def test_a_motion_that_heaves_only_is_its_own_harmonic():
    heave = Harmonic(coordinate="heave", amplitude=1.5, period=9.0, phase=0.4)
    found = known_harmonics(Scenario(motion=HarmonicMotion(harmonics=(heave,))))
    times = np.linspace(0.0, 20.0, 50)
    np.testing.assert_allclose(found.at(times), 1.5 * np.sin(2 * np.pi / 9.0 * times + 0.4), atol=1e-12)
