from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch

from aframe_env import InvalidValue, Scenario, ScenarioDistribution, TaskConfig, task
from aframe_env.scenario import TargetPath
from aframe_env.scenario.series import drawn_scenarios
from aframe_env.simulation import Simulation
from aframe_env.suite import find_task
from agents.control.optimum import optimise
from agents.control.winch import WinchModel
from agents.learned.recurrent_inputs import Lookout, LookoutConfig
from agents.learned.recurrent_network import RecurrentNetwork
from agents.policy import DrumStill
from agents.registry import BuildContext, choose
from agents.rollout import run
from train.apg.data import lengthening, record
from train.apg.options import ApgOptions
from train.apg.stages import to_policy
from train.apg.teacher import Teacher
from train.apg.twin import Twin, Winches, roll_out

CONFIG = TaskConfig(**{**find_task("Storm").arguments, "episode_duration": 30.0})


def twin_of(recordings):
    r = {name: each.double() for name, each in recordings.tensors().items()}
    return Twin.of(recordings, r), r["path"].diff(dim=1)


LIMITS = {"Storm": 1e-6, "Unknown": 1e-6, "DeepRope": 1e-3, "MRU": 1e-6}
"""Error of the drum's speed, m/s: on a heavy rope winches are as much faster as the reading of its tension says."""


def wandering(count, steps):
    """Shares at random, often at the limits."""
    wander = np.cumsum(np.random.default_rng(1).normal(size=(count, steps)), axis=1)
    return np.clip(1.5 * np.sin(0.3 * wander), -1.3, 1.3)


@cache
def drawn(name):
    """A dozen lifts of a task, half a minute long, and their recordings."""
    suite_task = find_task(name)
    config = TaskConfig(**{**suite_task.arguments, "episode_duration": 30.0})
    scenarios = drawn_scenarios(suite_task.distribution, 5, 12)
    return scenarios, config, record(scenarios, config, 0)


@pytest.mark.parametrize("name", ["Storm", "Unknown", "DeepRope", "MRU"])
def test_the_twin_goes_where_the_engine_goes(name):
    """Speeds at random: depth errors of ten metres, of which the twin misses 2 % at the most."""
    scenarios, config, recordings = drawn(name)
    assert len(recordings.still) == len(scenarios)
    shares = wandering(len(scenarios), config.steps)
    twin, rise = twin_of(recordings)
    state, speed = twin.start()
    simulation = Simulation(len(scenarios), config.replaced(scenario=scenarios[0], observation=config.sensors))
    simulation.reset_rows(np.arange(len(scenarios)), [(scenario, 0) for scenario in scenarios])
    radius = lengthening(scenarios) * [scenario.crane.winch.drum_radius for scenario in scenarios]
    lookout = Lookout(len(scenarios), recordings.made_for)
    lookout.start(simulation.observe(), [scenario.as_told for scenario in scenarios])
    true, reckoned, saturated = [], [], 0
    for step in range(config.steps):
        state, speed, _ = twin.advance(state, speed, torch.from_numpy(shares[:, step]), rise[:, step])
        # The commands are those of the agent in the engine, who goes by what was told.
        simulation.advance(lookout.command(shares[:, step]))
        saturated += int((abs(speed[0]) > 0.999 * twin.winches.most_speed[0]).sum())
        assert radius * simulation.state[:, task.DRUM_SPEED] == pytest.approx(speed[0].numpy(), abs=LIMITS[name])
        true.append(simulation.state[:, task.DEPTH_ERROR].copy())
        reckoned.append(state[:, 0].numpy())
    true, reckoned = np.array(true), np.array(reckoned)
    size = np.sqrt(np.mean(true**2, axis=0))
    error = np.sqrt(np.mean((reckoned - true) ** 2, axis=0)) / size
    assert len(speed) == (2 if name == "Unknown" else 1)  # whether the drum is other than reckoned
    assert saturated > 100
    assert size.min() > (1.5 if name == "DeepRope" else 5.0)
    assert np.median(error) < 0.005
    assert error.max() < 0.02


def regulated(name):
    """Recordings of two dozen lifts, and depth errors with an untrained network, on the twin and in the engine."""
    suite_task = find_task(name)
    config = TaskConfig(**{**suite_task.arguments, "episode_duration": 30.0})
    scenarios = drawn_scenarios(suite_task.distribution, 77, 24)
    recordings = record(scenarios, config, 0)
    assert len(recordings.still) == len(scenarios)
    options = ApgOptions(task=name, memory=8, hidden=8)
    torch.manual_seed(0)
    network = RecurrentNetwork(len(recordings.made_for.readings), 8, 8)
    with torch.no_grad():
        on_twin = roll_out(network, recordings).rms
    in_engine = run(to_policy(network, options)[0], scenarios, config).rms
    return recordings, on_twin, torch.from_numpy(in_engine)


def test_a_network_scores_in_the_engine_what_it_does_on_the_twin_where_nothing_is_as_told():
    """With what a regulator sees of the lifts, one that starts to swing among them."""
    _, on_twin, in_engine = regulated("Unknown")
    error = abs(on_twin / in_engine - 1.0).numpy()
    assert np.median(error) < 0.02
    assert np.quantile(error, 0.9) < 0.1


def test_a_network_scores_in_the_engine_what_it_does_on_the_twin_on_heavy_ropes():
    """Where the load is lost the sensors' noise decides, and that is another one in the engine."""
    recordings, on_twin, in_engine = regulated("DeepRope")
    error = abs(recordings.shares(on_twin) - recordings.shares(in_engine)).numpy()
    assert np.median(error) < 0.01
    assert np.quantile(error, 0.9) < 0.03


@pytest.mark.parametrize("commands", ["still", "regulator"])
def test_on_heavy_ropes_what_is_seen_hardly_depends_on_what_the_drum_does(commands):
    """Errors of what is seen: they come from waves and noise, and are centimetres where the load moves by a metre."""
    scenarios, config, recordings = drawn("DeepRope")
    other = {
        "still": DrumStill(),
        "regulator": choose("feed-forward + feedback").build(BuildContext(scenarios=scenarios, config=config)),
    }[commands]
    lookout = Lookout(len(scenarios), recordings.made_for)
    simulation = Simulation(len(scenarios), config.replaced(scenario=scenarios[0], observation=config.sensors))
    noise = np.random.default_rng(0).integers(2**63, size=len(scenarios)).tolist()
    simulation.reset_rows(np.arange(len(scenarios)), list(zip(scenarios, noise, strict=True)))
    other.reset([scenario.as_told for scenario in scenarios], config.control_period)
    error, moved = [], []
    for step in range(config.steps):
        seen = simulation.observe()
        outlook = lookout.advance(seen) if step else lookout.start(seen, scenarios)
        moved.append(simulation.state[:, task.DEPTH_ERROR].copy())
        velocity = simulation.state[:, task.LOAD_VELOCITY_Z]
        error.append(np.stack([outlook.z[:, 0] - moved[-1], outlook.z[:, 1] - velocity], axis=1))
        simulation.advance(lookout.follow(other.act(seen, step * config.control_period)))
    depends = np.array(error).transpose(1, 0, 2) - recordings.error[:, :, :2]
    size = np.sqrt(np.mean(np.square(moved), axis=0))
    assert np.median(np.sqrt(np.mean(depends[:, :, 0] ** 2, axis=1)) / size) < 0.05
    assert np.sqrt(np.mean(depends**2)) < 0.05


def test_drums_follow_their_commands_as_the_winch_model_has_it():
    rng = np.random.default_rng(3)
    speed, command, lag = rng.uniform(-2.5, 2.5, 300), rng.uniform(-4.0, 4.0, 300), rng.uniform(0.0, 0.4, 300)
    command[:100] = speed[:100] + rng.uniform(-0.3, 0.3, 100)  # near enough for all that a step may be
    lag[::5] = 0.0
    model = WinchModel(300, 0.1)
    model.max_speed[:], model.max_acceleration[:], model.lag[:], model.speed[:] = 3.0, 2.0, lag, speed
    turned = model.turn(command)
    most = torch.full((300,), 0.2, dtype=torch.float64)
    winches = Winches(most, 15.0 * most, torch.from_numpy(lag / 0.1))
    mean, reached = winches.follow(torch.from_numpy(speed), torch.from_numpy(command))
    assert 0.1 * mean.numpy() == pytest.approx(turned, abs=1e-12)
    assert reached.numpy() == pytest.approx(model.speed, abs=1e-12)


@pytest.mark.parametrize("name", ["Storm", "DeepRope"])
def test_the_optimum_scores_on_the_twin_what_it_does_in_the_engine(name):
    """And where the error is small: what is left of the heave is a hundredth of it, the score is the same to 0.5 %."""
    scenarios, config, recordings = drawn(name)
    radius = lengthening(scenarios) * [each.crane.winch.drum_radius for each in scenarios]
    speed = optimise(scenarios, config, rounds=8).commands * radius[:, None]
    shares = torch.from_numpy(np.diff(speed, axis=1, prepend=0.0) / recordings.most_change[:, None])
    twin, rise = twin_of(recordings)
    state, reached = twin.start()
    square = torch.zeros(len(scenarios)).double()
    for step in range(config.steps):
        before = state[:, 0]
        state, reached, _ = twin.advance(state, reached, shares[:, step], rise[:, step])
        square += 0.5 * (before**2 + state[:, 0] ** 2)
    score = recordings.shares(torch.sqrt(square / config.steps)).numpy()
    assert score == pytest.approx(1.0, abs=0.005)


def test_gradients_are_those_of_finite_differences():
    """In double precision, in a calm sea that leaves the winch room: nothing is clipped."""
    calm = ScenarioDistribution(hs=(0.5, 1.0), tp=(8.0, 12.0))
    config = TaskConfig(scenario=calm, observation="sensors", episode_duration=10.0)
    recordings = record(drawn_scenarios(calm, 3, 2), config, 0)
    recordings = replace(recordings, series=recordings.series.astype(np.float64))
    torch.manual_seed(0)
    network = RecurrentNetwork(len(LookoutConfig(sensors=config.sensors).readings), 8, 8).double()
    parameters = list(network.parameters())
    roll_out(network, recordings).rms.sum().backward()
    directions = [torch.randn_like(each) for each in parameters]
    slope = sum(float((each.grad * way).sum()) for each, way in zip(parameters, directions, strict=True))

    def moved(by):
        with torch.no_grad():
            for each, way in zip(parameters, directions, strict=True):
                each.add_(by * way)
            rms = float(roll_out(network, recordings).rms.sum())
            for each, way in zip(parameters, directions, strict=True):
                each.sub_(by * way)
        return rms

    assert abs(slope) > 1e-4
    assert slope == pytest.approx((moved(1e-6) - moved(-1e-6)) / 2e-6, rel=1e-5)


def test_at_the_winchs_limits_the_gradient_leads_back():
    one = torch.ones(1).double()
    winches = Winches(0.2 * one[None], 2.0 * one[None], 0.0 * one[None])
    twin = Twin(torch.eye(3, 4).double()[None], winches, 0.2 * one, 2.0 * one, torch.zeros(1, 3).double(), 0.1)
    for start, share, pull in ((0.0, 1.7, 1.0), (0.0, -1.7, -1.0), (1.95, 0.9, 1.0)):
        asked = torch.tensor([share]).double().requires_grad_()
        for sign, seen in ((pull, True), (-pull, False)):
            _, speed, _ = twin.advance(torch.zeros(1, 3).double(), start * one[None], asked, 0.0 * one)
            (gradient,) = torch.autograd.grad((sign * speed).sum(), asked)
            assert (gradient.item() != 0.0) is seen


@pytest.mark.parametrize(("name", "least"), [("Storm", 0.94), ("Unknown", 0.94), ("DeepRope", 0.88), ("MRU", 0.94)])
def test_whoever_does_as_the_teacher_says_all_along_comes_near_the_ceiling(name, least):
    """As near as predictive control with eight seconds of perfect preview, which has 98.5 % on Storm, worst 94 %."""
    recordings = drawn(name)[2]
    twin, rise = twin_of(recordings)
    teacher, count = Teacher(recordings), len(recordings.still)
    state, speed = twin.start()
    square = np.zeros(count)
    for step in range(CONFIG.steps):
        z = np.column_stack([state[:, :3].numpy(), recordings.path_speed[:, step] - speed[0].numpy()])
        drums = speed[0].numpy(), speed[-1].numpy()
        share = teacher.share(np.arange(count), np.full(count, step), z, *drums)
        before = state[:, 0].numpy()
        state, speed, _ = twin.advance(state, speed, torch.from_numpy(share), rise[:, step])
        square += 0.5 * (before**2 + state[:, 0].numpy() ** 2)
    shares = recordings.shares(torch.from_numpy(np.sqrt(square / CONFIG.steps))).numpy()
    assert shares.mean() > 0.975
    assert shares.min() > least
    assert shares.max() < 1.005


def test_an_untrained_network_is_a_regulator():
    recordings = drawn("Storm")[2]
    torch.manual_seed(0)
    with torch.no_grad():
        shares = recordings.shares(roll_out(RecurrentNetwork(4, 8, 8), recordings).rms)
    assert shares.mean() > 0.5


def test_what_the_twin_does_not_know_is_refused():
    lowered = Scenario(target_path=TargetPath(corners=((5.0, 0.0), (60.0, -20.0))))
    with pytest.raises(InvalidValue, match=r"^target_path: must not be there, for the twin of train\.apg"):
        record([lowered], CONFIG, 0)
    with pytest.raises(InvalidValue, match=r"sensor_delay = 0\.7 s: must be at most 0\.6 s"):
        record([Scenario(sensor_delay=0.7)], CONFIG, 0)
