import json
import math
from dataclasses import replace

import numpy as np
import pytest

from aframe_env import Harmonic, HarmonicMotion, Scenario, ScenarioDistribution
from aframe_env.config import TaskConfig
from aframe_env.task import SENSED, STATE
from agents.drives.following import Follower
from agents.drives.functions import RampedDrive
from agents.policy import DrumStill, Knowledge
from agents.rollout import held_out_scenarios, run
from train.sensitivity import __main__ as sensitivity
from train.sensitivity.analysis import curves, leftover, sobol_indices
from train.sensitivity.factors import FACTORS, NOMINAL, AlteredMotion, Factor, altered
from train.sensitivity.misinformed import Misinformed


def test_sobol_indices_of_the_ishigami_function():
    """Closed forms with a = 7, b = 0.1."""
    a, b, pi = 7.0, 0.1, math.pi
    variance = a**2 / 8 + b * pi**4 / 5 + b**2 * pi**8 / 18 + 0.5
    first = np.array([0.5 * (1 + b * pi**4 / 5) ** 2, a**2 / 8, 0.0]) / variance
    both = 8 * b**2 * pi**8 / 225 / variance
    factors = [Factor(name, -pi, pi, 0.0, name) for name in "xyz"]

    def ishigami(values):
        x, y, z = values.T
        return np.sin(x) + a * np.sin(y) ** 2 + b * z**4 * np.sin(x)

    found, output = sobol_indices(factors, ishigami, 4096, 1)
    assert len(output) == 4096 * 5
    np.testing.assert_allclose([index.first for index in found], first, atol=0.02)
    np.testing.assert_allclose([index.total for index in found], first + np.array([both, 0.0, both]), atol=0.02)
    assert all(0.0 < index.total_interval < 0.05 for index in found)
    for seed in (0, 1):
        assert sobol_indices(factors, ishigami, 64, seed)[0] == sobol_indices(factors, ishigami, 64, seed)[0]


def test_what_does_not_vary_has_no_indices():
    found, _ = sobol_indices(FACTORS, lambda values: np.ones(len(values)), 8, 0)
    assert {(index.first, index.total) for index in found} == {(0.0, 0.0)}


def test_the_true_scenario_is_the_assumed_one_altered():
    assumed = held_out_scenarios(ScenarioDistribution(), 1)[0]
    same = altered(assumed, NOMINAL)
    assert replace(same, motion=assumed.motion) == assumed
    true = altered(assumed, (1.1, 0.9, 0.8, 2.0, 1.05, 0.3))
    assert true.load_mass == pytest.approx(1.1 * assumed.load_mass)
    assert true.rope_length == pytest.approx(0.9 * assumed.rope_length)
    assert true.crane.rope.axial_stiffness == pytest.approx(1.6e8)
    assert true.rope_damping == pytest.approx(2.0 * assumed.rope_damping)
    heave = Harmonic(coordinate="heave", amplitude=2.0, period=10.0, phase=0.2)
    motion = AlteredMotion(HarmonicMotion(harmonics=(heave,)), 1.05, 0.3)
    times = np.linspace(0.0, 30.0, 31)
    want = 2.0 * np.sin(2.0 * math.pi * times / 10.5 + 0.5)
    np.testing.assert_allclose(motion.components().at(times)[0, :, 2], want, atol=1e-12)


class Remembers:
    """A policy that keeps what it was told."""

    name = "remembers"

    def __init__(self, knows):
        self.knows = knows

    def reset(self, scenarios, control_period):
        self.scenarios = list(scenarios)

    def act(self, observation, time):
        self.observation = observation
        return np.arange(len(observation), dtype=np.float64)


@pytest.mark.parametrize(("knows", "quantities"), [(Knowledge.STATE, STATE), (Knowledge.SENSORS, SENSED)])
def test_an_agent_is_told_the_assumed_mass_and_length_and_measures_the_rest(knows, quantities):
    assumed = held_out_scenarios(ScenarioDistribution(), 2)
    policy = Remembers(knows)
    misinformed = Misinformed(policy, assumed, np.array([1, 0, 1]))
    misinformed.reset([altered(s, (1.2, 0.8, 1.0, 1.0, 1.0, 0.0)) for s in assumed], 0.1)
    assert policy.scenarios == [assumed[1], assumed[0], assumed[1]]
    observation = np.arange(3.0 * len(quantities), dtype=np.float32).reshape(3, -1)
    before = observation.copy()
    misinformed.act(observation, 0.0)
    np.testing.assert_array_equal(observation, before)
    told = {"load_mass": [assumed[i].load_mass for i in (1, 0, 1)]}
    told["rope_length"] = [assumed[i].free_length for i in (1, 0, 1)]
    for column, quantity in enumerate(quantities):
        want = told.get(quantity.name, before[:, column])
        np.testing.assert_allclose(policy.observation[:, column], want, rtol=1e-6)


def test_rows_of_one_clock_do_the_same():
    assumed = held_out_scenarios(ScenarioDistribution(), 2)
    policy = Remembers(Knowledge.CLOCK)
    misinformed = Misinformed(policy, assumed, np.array([1, 0, 1]))
    misinformed.reset([], 0.1)
    assert policy.scenarios == assumed
    assert misinformed.act(np.zeros((3, 14), dtype=np.float32), 0.0).tolist() == [1.0, 0.0, 1.0]


class Ideal:
    """Keeps the tension at the weight in a regular heave that starts gently."""

    name, knows = "ideal", Knowledge.CLOCK

    def reset(self, scenarios, control_period):
        drives = [
            RampedDrive(duration=60.0, variables=np.array([0.8 / 0.75, 2.0 * math.pi / 12.0, 0.0]), ramp=s.ramp)
            for s in scenarios
        ]
        self.follower = Follower(drives, scenarios, control_period)

    def act(self, observation, time):
        return self.follower.command(time)


def test_a_wrong_phase_leaves_twice_the_sine_of_half_of_it():
    """On a short, stiff rope the load follows the rope's end: \\|1 - exp(iδ)\\| of the heave is left."""
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=0.8, period=12.0),))
    assumed = Scenario(motion=motion, load_mass=2e4, target_level=-50.0, rope_damping=2e4, ramp=12.0)
    still = run(DrumStill(), [assumed]).rms
    values = np.tile(NOMINAL, (3, 1))
    values[:, 5] = 0.0, 0.2, -0.4
    left = leftover(Ideal(), [assumed], still, TaskConfig(), values)[:, 0]
    assert left[0] < 0.01
    np.testing.assert_allclose(left[1:], 2.0 * np.sin([0.1, 0.2]), rtol=0.03)


def test_one_at_a_time_moves_one_thing_only():
    seen = []

    def evaluate(values):
        seen.append(values)
        return values[:, :1] * values[:, 4:5]

    found = curves(evaluate, 5)
    changed = (seen[0] != np.array(NOMINAL)).sum(axis=1)
    assert sorted(set(changed.tolist())) == [0, 1]
    assert [curve.factor for curve in found] == [factor.name for factor in FACTORS]
    assert np.ravel(found[0].left).tolist() == list(found[0].values)
    assert set(np.ravel(found[1].left).tolist()) == {1.0}


def test_the_command_writes_curves_and_indices(tmp_path, monkeypatch):
    out = tmp_path / "out"
    few = ("--scenarios", "1", "--points", "3", "--samples", "2", "--workers", "1", "--optimiser", "gauss-newton")
    policies = ("--policies", "drum still", "S-Ω1")
    monkeypatch.setattr("sys.argv", ["train.sensitivity", *policies, *few, "--out", str(out)])
    assert sensitivity.main() == 0
    still, drive = json.loads((out / "sensitivity.json").read_text(encoding="utf-8"))
    assert (still["policy"], still["knows"], drive["policy"]) == ("drum still", "nothing", "S-Ω1")
    for curve, factor in zip(drive["curves"], FACTORS, strict=True):
        assert curve["factor"] == factor.name
        assert np.ravel(curve["left"])[1] < 0.1  # as assumed
    phase = np.ravel(drive["curves"][-1]["left"])
    assert phase[[0, 2]] == pytest.approx(2.0 * math.sin(math.pi / 12.0), rel=0.15)
    assert np.ravel(still["curves"][-1]["left"])[1] == pytest.approx(1.0)
    assert 0.0 < drive["median"] <= drive["high"] <= drive["worst"]
    for name in ("one_at_a_time.png", "sobol.png"):
        assert (out / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--samples", "100"), "samples = 100: must be a power of two"),
        (("--policies", "S-Ω3"), "policy = 'S-Ω3': must be one of 'drum still', 'S-Ω1'"),
        (("--policies", "S-Ω1", "S-Ω1"), "each named once"),
        (("--policies", "drive map", "--drive-map", "absent"), "no drive map in 'absent'"),
    ],
)
def test_bad_options_are_one_clear_line(options, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = options if "--policies" in options else ("--policies", "S-Ω1", *options)
    monkeypatch.setattr("sys.argv", ["train.sensitivity", *options])
    with pytest.raises(SystemExit) as stopped:
        sensitivity.main()
    assert stopped.value.code == 2
    # Refused by the options themselves, the line stands wrapped in a box.
    assert words in " ".join(capsys.readouterr().err.replace("│", " ").replace("|", " ").split())
    assert not list(tmp_path.iterdir())
