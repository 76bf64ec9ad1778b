"""The winch-limited optimum: a floor that no other start, perturbation or policy gets below."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from aframe_env import TASKS, Crane, InvalidValue, RecordedMotion, Scenario, ScenarioDistribution, TaskConfig, Winch
from agents.control.feedback import Feedback
from agents.control.inverse_dynamics import InverseDynamics
from agents.control.optimum import CommandSequence, optimise, required_commands, saturating
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.policy import DrumStill
from agents.rollout import drawn_scenarios, held_out_scenarios, run

WEAK = Crane(winch=Winch(max_rope_speed=1.2, max_rope_acceleration=0.8))
CONFIG = TaskConfig(episode_duration=30.0)


@pytest.fixture(scope="module")
def scenarios() -> list[Scenario]:
    """Half of them in seas that ask more of the winch than it has."""
    easy = held_out_scenarios(ScenarioDistribution(), 6)
    hard = held_out_scenarios(ScenarioDistribution(hs=4.0, tp=(8.0, 12.0), crane=WEAK, ramp=2.0), 6)
    return [*easy, *hard]


@pytest.fixture(scope="module")
def still(scenarios: list[Scenario]) -> npt.NDArray[np.float64]:
    return run(DrumStill(), scenarios, CONFIG).omega1


def test_it_is_the_floor(scenarios, still):
    best = optimise(scenarios, CONFIG)
    left = np.sqrt(best.omega1 / still)
    hard = saturating(scenarios, CONFIG)
    assert hard[6:].sum() >= 4
    assert not hard[:6].all()
    assert np.all(left[~hard] < 1e-4)
    assert np.all(left[hard] > 1e-3)

    # Played in the environment the commands do what was found.
    played = run(CommandSequence("optimum", best.commands), scenarios, CONFIG)
    np.testing.assert_allclose(played.omega1, best.omega1, rtol=1e-12)
    limits = [(s.crane.winch.max_speed, s.crane.winch.max_acceleration) for s in scenarios]
    speed, acceleration = np.array(limits).T[:, :, None]
    assert np.all(abs(played.drum_speed) <= speed * (1.0 + 1e-6))
    assert np.all(abs(np.diff(played.drum_speed, axis=1)) <= 0.1 * acceleration * (1.0 + 1e-4))

    # No policy is better, not even those that know the future.
    for policy in (InverseDynamics(), Feedback(None)):
        assert np.all(run(policy, scenarios, CONFIG).omega1 >= best.omega1 * (1.0 - 1e-9))

    # Other starts end in the same place.
    for start in (np.zeros_like(best.commands), 0.5 * required_commands(scenarios, CONFIG)):
        other = optimise(scenarios, CONFIG, start=start)
        assert np.abs(np.sqrt(other.omega1 / still) - left).max() < 1e-4

    # Nor does anything near by do better.
    rng = np.random.default_rng(0)
    for size in (1e-1, 1e-2, 1e-3):
        for smooth in (1, 5, 25):
            noise = rng.normal(0.0, size, best.commands.shape)
            kernel = np.ones(smooth) / smooth
            noise = np.apply_along_axis(np.convolve, 1, noise, kernel, mode="same")
            near = run(CommandSequence("near", best.commands + noise), scenarios, CONFIG)
            assert np.all(np.sqrt(near.omega1 / still) > left - 1e-5)


def test_no_policy_beats_the_best_of_its_starts_on_heavy_ropes():
    task = TASKS["DeepRope"]
    config = TaskConfig(
        **task.arguments,
    ).replaced(observation="state", episode_duration=30.0)
    scenarios = task.scenarios("train", 4)
    still = run(DrumStill(), scenarios, config).omega1
    best = optimise(scenarios, config)
    left = np.sqrt(best.omega1 / still)
    assert saturating(scenarios, config).all()
    for policy in (InverseDynamics(), Feedback(None), PredictiveControl(PlanningConfig(sensors=None))):
        assert np.all(np.sqrt(run(policy, scenarios, config).omega1 / still) > left)
    # What is near it and what a third start ends in does not get below it by more than a hundredth.
    other = optimise(scenarios, config, start=0.5 * required_commands(scenarios, config))
    assert np.all(np.sqrt(other.omega1 / still) > left - 0.01)
    rng = np.random.default_rng(0)
    for size in (0.1, 0.01):
        noise = rng.normal(0.0, size, best.commands.shape)
        near = run(CommandSequence("near", best.commands + noise), scenarios, config)
        assert np.all(np.sqrt(near.omega1 / still) > left - 0.003)


def test_a_chase_at_bounded_acceleration():
    """A pulley that rises with constant acceleration: the drum follows, or can but run at its limit."""
    times = np.arange(0.0, 3.01, 0.05)
    coordinates = np.zeros((len(times), 6))
    coordinates[:, 2] = 0.25 * times**2
    winch = Winch(max_rope_acceleration=0.6)
    scenario = Scenario(
        crane=Crane(winch=winch),
        motion=RecordedMotion(times=times, coordinates=coordinates),
        load_mass=2e4,
        target_level=-60.0,
        rope_damping=1e5,
    )
    config = TaskConfig(episode_duration=3.0)
    assert optimise([scenario], config).omega1[0] < 1e-6
    # With half of what it takes the drum pays out t²/8 of the t²/4 that it should.
    weak = replace(scenario, crane=Crane(winch=replace(winch, max_rope_acceleration=0.25)))
    left = (0.25 - 0.125) ** 2 * 3.0**5 / 5.0
    assert optimise([weak], config).omega1[0] == pytest.approx(left, rel=0.01)


def test_a_rope_that_parts_with_the_drum_still_is_kept_where_it_can_be():
    """The load bobs in resonance with the sea until the rope snaps, if nobody does anything about it."""
    kept, hopeless = (
        TASKS["Storm"].scenarios("test", 882)[881],
        drawn_scenarios(TASKS["Storm"].distribution, 221_000_002, 6)[5],
    )
    assert run(DrumStill(), [kept, hopeless]).parted.all()
    best = optimise([kept, hopeless])
    assert best.omega1[0] < 0.9 * run(PredictiveControl(PlanningConfig(sensors=None)), [kept]).omega1[0]
    assert not run(CommandSequence("optimum", best.commands[:1]), [kept]).parted.any()
    assert best.omega1[1] == np.inf


def test_bad_starts(scenarios):
    with pytest.raises(InvalidValue, match=r"start of shape \(2, 5\): must be \(2, 300\), rad/s"):
        optimise(scenarios[:2], CONFIG, start=np.zeros((2, 5)))
    with pytest.raises(InvalidValue, match="optimum: 3 scenarios, commands for 2"):
        CommandSequence("optimum", np.zeros((2, 5))).reset(scenarios[:3], 0.1)
