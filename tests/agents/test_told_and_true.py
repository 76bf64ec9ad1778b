"""Policies get what the operator was told; only privileged ones get what is."""

from dataclasses import replace

import numpy as np
import pytest

from aframe_env import Crane, HarmonicMotion, Rope, Scenario, ScenarioDistribution, Sensors, TaskConfig, Told, Winch
from aframe_env.env import AFrameHeaveEnv
from aframe_env.simulation import Simulation
from aframe_env.task import SENSED, STATE
from aframe_env.vector_env import AFrameHeaveVectorEnv
from agents.control.feedback import Feedback
from agents.learned.wrappers import AgentInterface, AgentVectorInterface
from agents.policy import Knowledge
from agents.registry import BuildContext, choose
from agents.rollout import held_out_scenarios, run
from train.dataset import begun, record
from train.evaluate.run import observation_of
from train.shared.episode import Episode

WRONG = Told(load_mass=8e4, axial_stiffness=1.4e8, lag=0.3, max_rope_speed=2.0, max_rope_acceleration=1.0)
TRUE = replace(ScenarioDistribution().nominal(), load_mass=6e4, told=WRONG)
MASSES = {6e4}


class Spy:
    """Looks for the truth wherever a policy is let, and moves the drum a little."""

    name = "spy"

    def __init__(self, knows=Knowledge.SENSORS):
        self.knows = knows
        self.handed, self.seen = [], []

    def reset(self, scenarios, control_period):
        self.handed += list(scenarios)

    def act(self, observation, time):
        self.seen.append(observation.copy())
        return np.full(len(observation), 0.1)

    def masses(self):
        """Every mass that it came by."""
        names = [q.name for q in (STATE if self.seen[0].shape[1] == len(STATE) else SENSED)]
        column = names.index("load_mass")
        return {s.load_mass for s in self.handed}, {float(o) for each in self.seen for o in each[:, column]}


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_a_spy_finds_what_was_told(observation):
    spy = Spy()
    run(spy, [TRUE] * 3, observation=observation, episode_duration=1.0)
    assert spy.masses() == ({8e4}, {8e4})
    assert all(s.told is None and s.crane == TRUE.as_told.crane for s in spy.handed)
    assert all(s.crane.winch.lag == 0.3 for s in spy.handed)


def test_a_privileged_policy_is_handed_what_is():
    spy = Spy(Knowledge.FUTURE)
    run(spy, [TRUE], episode_duration=1.0)
    assert spy.handed == [TRUE]


def test_every_other_runner_keeps_the_truth_from_a_spy():
    watched, recorded = Spy(), Spy()
    config = TaskConfig(scenario=TRUE, observation="sensors", episode_duration=1.0)
    Episode(watched, config, TRUE, 0).step()
    simulation = begun(config, [1, 2])
    record(simulation, recorded, [1, 2], np.zeros((config.steps, 2)))
    assert watched.masses() == recorded.masses() == ({8e4}, {8e4})


@pytest.mark.parametrize("model", ["simplified", "rfem"])
@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_environments_observe_the_mass_that_was_told(model, observation):
    arguments = {
        "scenario": TRUE,
        "observation": observation,
        "model": model,
        "rfem_modes": 5 if model == "rfem" else None,
    }
    env, rows = AFrameHeaveEnv(**arguments), AFrameHeaveVectorEnv(2, **arguments)
    column = [q.name for q in (STATE if observation == "state" else SENSED)].index("load_mass")
    first, info = env.reset(seed=0)
    then, *_, later = env.step(np.zeros(1, dtype=np.float32))
    together, _ = rows.reset(seed=0)
    assert first[column] == then[column] == 8e4
    assert (together[:, column] == 8e4).all()
    assert 6e4 not in [value for told in (info, later) for each in told.values() for value in np.ravel(each)]
    state = env.get_state()
    env.reset(options={"scenario": replace(TRUE, told=None)})
    env.set_state(state)
    assert env.step(np.zeros(1, dtype=np.float32))[0][column] == 8e4


def test_what_is_told_moves_nothing():
    arguments = {"episode_duration": 5.0, "observation": "sensors"}
    told, untold = (run(Spy(), [each], **arguments) for each in (TRUE, replace(TRUE, told=None)))
    assert np.array_equal(told.error, untold.error)


@pytest.mark.parametrize("sensors", [None, Sensors()])
def test_a_law_that_was_told_wrongly_acts_like_one_for_what_it_was_told(sensors):
    scenarios = [replace(s, told=WRONG) for s in held_out_scenarios(ScenarioDistribution(), 3)]
    config = TaskConfig(observation=sensors or "state", scenario=scenarios[0])
    simulation = Simulation(3, config)
    simulation.reset_rows(np.arange(3), [(s, 7) for s in scenarios])
    informed, misinformed, law = (Feedback(sensors) for _ in range(3))
    # The crane as it was told, built by hand.
    crane = Crane(rope=Rope(axial_stiffness=1.4e8), winch=Winch(lag=0.3, max_rope_speed=2.0, max_rope_acceleration=1.0))
    law.reset([replace(s, crane=crane, told=None, load_mass=8e4) for s in scenarios], 0.1)
    misinformed.reset([s.as_told for s in scenarios], 0.1)
    informed.reset(scenarios, 0.1)
    for step in range(20):
        observation = simulation.observe()
        command = misinformed.act(observation, 0.1 * step)
        assert np.array_equal(command, law.act(observation, 0.1 * step))
        right = informed.act(observation, 0.1 * step)
        simulation.advance(command)
    assert (command != right).all()


def test_an_agent_learns_on_what_was_told_and_its_critic_on_what_is():
    env = AgentInterface(AFrameHeaveEnv(scenario=TRUE, observation="sensors"), privileged=True)
    told = AgentInterface(AFrameHeaveEnv(scenario=TRUE.as_told, observation="sensors"), privileged=True)
    rate, true_rate = (env.feature_names.index(name) for name in ("bobbing_rate", "true_bobbing_rate"))
    features = env.reset(seed=0)[0]
    stiffness = TRUE.as_told.crane.rope.axial_stiffness / TRUE.crane.rope.axial_stiffness
    # Both weigh the load with the same pin but for its noise; the rates go with the root of the stiffness.
    ratio = (features[rate] + 1.0) / (features[true_rate] + 1.0)
    assert ratio == pytest.approx(np.sqrt(stiffness), rel=0.02)
    assert told.reset(seed=0)[0].shape == features.shape
    rows = AgentVectorInterface(AFrameHeaveVectorEnv(2, scenario=TRUE, observation="sensors"), privileged=True)
    assert np.array_equal(rows.reset(seed=0)[0][0], features)


def test_what_is_built_for_all_is_built_for_what_was_told():
    context = BuildContext(scenarios=[TRUE], config=TaskConfig(scenario=TRUE))
    assert context.nominal == TRUE.as_told


def errors_under(scenario, name):
    config = TaskConfig(scenario=scenario, episode_duration=4.0)
    policy = choose(name).policy(BuildContext(scenarios=[scenario], config=config))
    return run(policy, [scenario], config.replaced(observation=observation_of(policy, config))).error


@pytest.mark.parametrize(
    ("name", "privileged"),
    [
        ("inverse dynamics", True),
        ("winch-limited optimum", True),
        ("S-Ω1 for each scenario", True),
        ("S-Ω1", False),
        ("predictive control", False),
        ("output zero on sensors", False),
        ("drive-map:clock", False),
    ],
)
def test_only_privileged_policies_go_by_what_is(name, privileged):
    """Those are built for, and reckon with, the truth, whatever was told; the others with what was told."""
    motion = HarmonicMotion.paper()
    told = Told(axial_stiffness=1.2e8, lag=0.6, max_rope_acceleration=0.8, load_mass=4e4)
    true = Scenario(motion=motion, load_mass=6e4, ramp=2.0)
    same = np.array_equal(errors_under(replace(true, told=told), name), errors_under(true, name))
    assert same == privileged


def test_a_law_is_designed_for_the_delay_that_was_told():
    late = replace(TRUE, sensor_delay=0.4, told=Told(sensor_delay=0.2))
    context = BuildContext(scenarios=[late], config=TaskConfig(scenario=late, observation="sensors"))
    assert context.sensors == Sensors(delay=0.2)
    assert choose("feed-forward + feedback").policy(context).sensors == Sensors(delay=0.2)
