"""The objectives against DOP853 on equations written here, with the drum moved by the drive exactly."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from aframe_env import InvalidValue, RecordedMotion, Scenario, ScenarioDistribution
from agents.drives.functions import HarmonicDrive, SplineDrive
from agents.drives.objectives import Objective, coarse_step


def oracle(scenario, drive, duration):
    """Ω1, Ω2 and x_L3 - h at a fine grid of times, from eqs. (25), (26), (31), (32), (37), (38)."""
    crane, motion = scenario.crane, scenario.motion.components()
    on_deck = np.array(crane.pulley_position)
    stiffness, radius = crane.rope.axial_stiffness, crane.winch.drum_radius
    drum_to_pulley = math.dist(crane.pulley_position, crane.drum_position)

    def pulley(t):
        q = motion.at([t])[0][0]
        s = min(t / scenario.ramp, 1.0) if scenario.ramp else 1.0
        q = q * s**3 * (10 - 15 * s + 6 * s * s)
        return q[:3] + Rotation.from_euler("ZYX", q[:2:-1]).apply(on_deck)

    def velocity(t, step=1e-4):
        if t < 2 * step:  # one-sided, of the same order
            return (-3 * pulley(t) + 4 * pulley(t + step) - pulley(t + 2 * step)) / (2 * step)
        return (8 * (pulley(t + step) - pulley(t - step)) - pulley(t + 2 * step) + pulley(t - 2 * step)) / (12 * step)

    def slope(t, y):
        rope, dx = pulley(t) - y[:3], velocity(t) - y[3:6]
        distance = np.linalg.norm(rope)
        length = scenario.free_length + radius * float(drive.angle(t))
        stretch = distance + drum_to_pulley - length
        rate = rope @ dx / distance - radius * float(drive.speed(t))
        tension = max(0.0, stiffness / length * stretch + scenario.rope_damping * rate)
        acceleration = tension / scenario.load_mass * rope / distance
        acceleration[2] -= scenario.gravity
        return np.concatenate([y[3:6], acceleration, [(y[2] - scenario.target_level) ** 2]])

    start = pulley(0.0) - [0.0, 0.0, scenario.rope_length]
    moving = velocity(0.0) if scenario.initial == "comoving" else np.zeros(3)
    grid = np.linspace(0.0, duration, round(duration / 0.01) + 1)
    y0 = np.concatenate([start, moving, [0.0]])
    solution = solve_ivp(slope, (0.0, duration), y0, method="DOP853", rtol=1e-10, atol=1e-10, t_eval=grid)
    error = solution.y[2] - scenario.target_level
    return float(solution.y[6, -1]), float(np.abs(error).max()), error


PAPER_DRIVE = HarmonicDrive(duration=12.0, amplitudes=(2.5,), frequencies=(0.53,), phases=(0.05,))


@pytest.mark.parametrize(
    ("scenario", "drive"),
    [
        (Scenario.paper(initial="rest", rope_damping=2e4), PAPER_DRIVE),
        (Scenario.paper(), SplineDrive.from_variables([1.0, 2.4, 1.2, -1.5, -2.0, 0.3], 12.0)),
        (ScenarioDistribution().draw(np.random.default_rng(4)), PAPER_DRIVE),
    ],
    ids=["paper at rest", "paper comoving", "random sea"],
)
def test_objectives_agree_with_dop853(scenario, drive):
    objective = Objective(scenario, 12.0)
    outcome = objective.drive(drive)
    omega1, omega2, error = oracle(scenario, drive, 12.0)
    assert outcome.omega1 == pytest.approx(omega1, rel=2e-6)
    assert outcome.omega2 == pytest.approx(omega2, rel=2e-5)
    times, history = objective.trajectory(drive)
    assert np.interp(np.linspace(0.0, 12.0, len(error)), times, history) == pytest.approx(error, abs=2e-5)
    assert outcome.rms == pytest.approx(math.sqrt(omega1 / 12.0), rel=1e-5)
    assert outcome.amplitude == outcome.omega2 == max(-outcome.lowest, outcome.highest)


def test_the_searching_step_keeps_omega1_to_a_ten_thousandth():
    for seed in range(6):
        scenario = ScenarioDistribution().draw(np.random.default_rng(seed))
        fine = Objective(scenario, 40.0, 0.005).still().omega1
        assert Objective(scenario, 40.0, coarse_step(scenario)).still().omega1 == pytest.approx(fine, rel=1e-4)


def test_a_still_drum_equals_a_drive_of_nothing():
    objective = Objective(Scenario.paper(), 20.0)
    nothing = objective.drive(SplineDrive.from_variables([0.0, 0.0, 0.0], 20.0))
    assert nothing == objective.still()


def test_a_record_that_is_too_short_is_refused():
    times = np.arange(0.0, 20.0, 0.5)
    motion = RecordedMotion(times=times, coordinates=np.zeros((len(times), 6)))
    with pytest.raises(InvalidValue, match=r"duration = 20 s: must be in \(0, 19.5\] s"):
        Objective(Scenario(motion=motion), 20.0)


@pytest.mark.parametrize("duration", [0.0, -1.0, math.nan, 1e5])
def test_bad_durations_are_refused(duration):
    with pytest.raises(InvalidValue, match="duration"):
        Objective(Scenario.paper(), duration)
