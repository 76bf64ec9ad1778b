import numpy as np
import pytest

from aframe_env import InvalidValue, ScenarioDistribution
from aframe_env.env import AFrameHeaveEnv
from agents.drives.functions import SplineDrive
from agents.drives.objectives import Objective
from agents.drives.optimisation import OptimisedDrive, optimise
from agents.drives.policy import DrivePolicy
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run


def wrapped(drive):
    return OptimisedDrive(
        drive=drive,
        family="spline",
        objective="omega1",
        omega1=0.0,
        omega2=0.0,
        rms=0.0,
        amplitude=0.0,
        evaluations=0,
        seconds=0.0,
    )


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_the_drum_is_on_the_drive_at_every_step(observation):
    """A drive within the winch's limits is soon caught up with, and then met at the end of each control step."""
    drive = SplineDrive.from_variables(1.5 * np.sin(np.arange(1, 13) * 0.9), 30.0)
    env = AFrameHeaveEnv(observation=observation, episode_duration=30.0)
    policy = DrivePolicy(name="S", drives=[wrapped(drive)])
    observed, info = env.reset(seed=3)
    policy.reset([env.scenario], env.control_period)
    worst = 0.0
    for _ in range(300):
        action = policy.act(observed[None], info["time"])
        observed, _, _, _, info = env.step(action.astype(np.float32))
        truth = env.simulation.state[0, 9]
        if info["time"] > 1.5:  # the drum starts from rest, the drive does not
            worst = max(worst, abs(truth - float(drive.angle(info["time"]))))
    assert worst < 1e-5  # commands are float32


def test_an_optimised_drive_holds_the_load_in_the_environment_as_in_its_objective():
    scenario = ScenarioDistribution().draw(np.random.default_rng(1))
    drive = optimise("spline", scenario, duration=60.0)
    policy = DrivePolicy(name="S", drives=[drive])
    episodes = run(policy, [scenario], episode_duration=60.0)
    still = run(DrumStill(), [scenario], episode_duration=60.0)
    assert still.omega1[0] == pytest.approx(Objective(scenario, 60.0).still().omega1, rel=1e-5)
    assert episodes.rms[0] == pytest.approx(drive.rms, abs=0.1 * still.rms[0])
    assert episodes.rms[0] < 0.1 * still.rms[0]


def test_rows_have_their_own_drives():
    scenarios = held_out_scenarios(ScenarioDistribution(), 2)
    drives = [wrapped(SplineDrive.from_variables([v, 2 * v, 3 * v], 60.0)) for v in (0.5, -0.5)]
    episodes = run(DrivePolicy(name="S", drives=drives), scenarios, episode_duration=60.0)
    still = run(DrumStill(), scenarios, episode_duration=60.0)
    lowered = still.error[:, -1] - episodes.error[:, -1]
    assert lowered == pytest.approx([0.75 * 1.5, -0.75 * 1.5], rel=0.2)  # metres of rope, give or take the motion


def test_a_wrong_number_of_drives_is_refused():
    policy = DrivePolicy(name="S", drives=[])
    with pytest.raises(InvalidValue, match="0 drives for 1 scenarios"):
        policy.reset(held_out_scenarios(ScenarioDistribution(), 1), 0.1)
