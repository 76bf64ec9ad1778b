import dataclasses
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from aframe_env import InvalidValue, Scenario, ScenarioDistribution, Sea, SeaMotion, Sensors, TargetPath
from aframe_env.config import TaskConfig
from agents import load
from agents.control.expected_waves import ExpectedWaves
from agents.control.predictive import PredictiveControl
from agents.imported import FunctionPolicy
from agents.learned.agent import CARD, WEIGHTS, AgentCard, card_text, digest, serialise
from agents.learned.features import STATE_FEATURES
from agents.learned.network import Actor
from agents.policy import Knowledge
from agents.registry import REGISTRY, BuildContext, choose, choose_all, slug
from agents.rollout import held_out_scenarios, run

MAP = str(Path(__file__).parents[2] / "results" / "drive-map")


def write_agent(folder, seed):
    torch.manual_seed(seed)
    weights = serialise(Actor(len(STATE_FEATURES), 4))
    card = AgentCard(
        algorithm="PPO",
        observation="state",
        sensors=None,
        waves=ExpectedWaves(frequency=(0.5, 1.0), variances=((0.1, 0.1),), build_up=10.0),
        action="residual",
        features=STATE_FEATURES,
        hidden=4,
        control_period=0.1,
        seed=seed,
        timesteps=1,
        versions={},
        sha256=digest(weights),
    )
    folder.mkdir(parents=True)
    (folder / WEIGHTS).write_bytes(weights)
    (folder / CARD).write_text(card_text(card))


def context(count=2):
    distribution = ScenarioDistribution()
    return BuildContext(
        scenarios=held_out_scenarios(distribution, count),
        config=TaskConfig(episode_duration=10.0),
    )


def test_a_folder_of_seeds_is_all_of_its_agents(tmp_path):
    for seed in (0, 2, 10):
        write_agent(tmp_path / "ppo" / f"seed-{seed}", seed)
    choices = choose_all([str(tmp_path / "ppo"), "drum-still"])
    assert [choice.name for choice in choices] == ["PPO, seed 0", "PPO, seed 2", "PPO, seed 10", "drum still"]
    built = [choice.build(context()) for choice in choices[:3]]
    assert [policy.card.seed for policy in built] == [0, 2, 10]
    assert load(tmp_path / "ppo").card.seed == 0


def test_agents_of_one_name_and_seed_are_told_apart_by_their_folders(tmp_path):
    folders = [tmp_path / name / "seed-1" for name in ("a", "b")]
    for folder in folders:
        write_agent(folder, 1)
    names = [choice.name for choice in choose_all([str(folder) for folder in folders])]
    assert names == [f"PPO, seed 1, {folder}" for folder in folders]


@pytest.mark.parametrize("name", REGISTRY)
def test_every_name_can_be_typed_and_chosen(name):
    typed = slug(name)
    assert typed.isascii()
    assert choose(typed).name == name


@pytest.mark.parametrize(
    ("name", "knows"),
    [
        ("feed-forward + feedback (state)", Knowledge.STATE),
        ("feed-forward + feedback", Knowledge.SENSORS),
        ("inverse dynamics", Knowledge.FUTURE),
        ("predictive control (state)", Knowledge.STATE),
        ("predictive control", Knowledge.SENSORS),
    ],
)
def test_the_laws_are_there_with_what_they_know(name, knows):
    policy = choose(name).build(context())
    assert (policy.name, policy.knows) == (name, knows)


@pytest.mark.parametrize("name", ["feed-forward + feedback", "predictive control", "predictive control (state)"])
def test_the_laws_expect_the_waves_of_the_task(name):
    config = TaskConfig(episode_duration=10.0, scenario=ScenarioDistribution(hs=(3.0, 4.0), ramp=0.0))
    task = dataclasses.replace(context(), config=config)
    law = choose(name).build(task)
    waves = law.config.waves if isinstance(law, PredictiveControl) else law.waves
    assert waves == ExpectedWaves.of(config.source) != ExpectedWaves.of(ScenarioDistribution())


@pytest.mark.parametrize(
    ("word", "name", "knows"),
    [
        ("", "drive map in real time", Knowledge.SENSORS),
        (":state", "drive map in real time (state)", Knowledge.STATE),
        (":clock", "drive map by the clock", Knowledge.CLOCK),
    ],
)
def test_a_folder_with_a_drive_map_is_the_map_in_real_time_or_what_stands_behind_it(word, name, knows):
    spec = choose(MAP + word)
    policy = spec.build(context())
    assert (spec.name, policy.name, policy.knows) == (name, name, knows)


def test_a_drive_map_is_built_for_the_task():
    late = Sensors(delay=0.3)
    config = TaskConfig(episode_duration=90.0, scenario=ScenarioDistribution(sensors=late))
    task = dataclasses.replace(context(), config=config)
    assert choose(MAP).build(task).sensors == late
    assert choose(f"{MAP}:clock").build(task).duration == 90.0


def test_a_word_that_means_nothing_behind_a_folder_is_refused():
    with pytest.raises(InvalidValue, match="behind this folder may stand ':state' or ':clock'"):
        choose(f"{MAP}:absent")


def push(observation):
    return 0.5 * observation[:, 0]


def late_push(observation, time):
    return np.full(len(observation), time)


def test_anybodys_function_is_a_policy():
    policy = choose(f"{__name__}:push").build(context())
    policy.reset(context().scenarios, 0.1)
    np.testing.assert_array_equal(policy.act(np.ones((2, 14), dtype=np.float32), 0.0), [0.5, 0.5])
    policy = choose(f"{__name__}:late_push").build(context())
    policy.reset(context().scenarios, 0.1)
    np.testing.assert_array_equal(policy.act(np.ones((2, 14), dtype=np.float32), 3.0), [3.0, 3.0])


class NoPolicy:
    name, knows = 3, "much"

    def reset(self, scenarios, control_period): ...

    def act(self, observation, time): ...


class Unwilling:
    def __init__(self):
        raise RuntimeError("no weights")


class Nameless:
    knows = Knowledge.STATE

    @property
    def name(self):
        raise RuntimeError("no name")


nameless = Nameless()


class Broken:
    name, knows = "broken", Knowledge.STATE

    def reset(self, scenarios, control_period): ...

    def act(self, observation, time):
        return observation[:, 1 / 0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("absent", "must be one of"),
        ("json:absent", "cannot be imported: AttributeError: .* has no attribute 'absent'$"),
        ("no_such_module:policy", "cannot be imported: ModuleNotFoundError: No module named 'no_such_module'$"),
        (f"{__name__}:REGISTRY", "is a dict, must be a policy or callable"),
        (f"{__name__}:NoPolicy", "made a NoPolicy, must be a policy with name, knows, reset and act"),
        ("unittest.mock:MagicMock", "made a MagicMock, must be a policy"),
        (f"{__name__}:Unwilling", r"cannot be made: RuntimeError: no weights \(.*test_registry.py, line \d+\)$"),
        (f"{__name__}:Nameless", r"cannot be made: RuntimeError: no name \(.*test_registry.py, line \d+\)$"),
        (f"{__name__}:nameless", r"cannot be looked at: RuntimeError: no name \(.*test_registry.py, line \d+\)$"),
        ("sys:exit", "cannot be made: SystemExit"),
    ],
)
def test_what_is_no_policy_is_refused(text, words):
    with pytest.raises(InvalidValue, match=f"policy = {text!r}: .*{words}"):
        choose(text)


def test_a_policy_that_raises_is_named_with_the_line():
    policy = choose(f"{__name__}:Broken").build(context())
    policy.reset(context().scenarios, 0.1)
    with pytest.raises(InvalidValue, match=r"^broken: ZeroDivisionError: division by zero \(.*test_registry.py, line"):
        policy.act(np.ones((2, 14), dtype=np.float32), 0.0)


@pytest.mark.parametrize("said", ["fast", [10**400, 0.0], [[1.0], [2.0], [3.0]], None])
def test_a_function_that_gives_no_speeds_is_refused(said):
    policy = FunctionPolicy("odd", lambda observation: said, Knowledge.STATE, takes_time=False)
    policy.reset(context().scenarios, 0.1)
    with pytest.raises(InvalidValue, match=r"odd.*must be .*\(2,\)"):
        policy.act(np.ones((2, 14), dtype=np.float32), 0.0)


def test_a_folder_without_an_agent_is_refused(tmp_path):
    (tmp_path / "note.json").write_text(json.dumps({}))
    with pytest.raises(InvalidValue, match="no agent in this folder"):
        choose(str(tmp_path))


def test_policies_follow_a_target_that_moves() -> None:
    path = TargetPath.lowering(-20.0, 0.8, start=5.0)
    sea = SeaMotion(sea=Sea(hs=1.5, tp=9.0))
    moving = Scenario(motion=sea, load_mass=5e4, target_level=-200.0, ramp=5.0, target_path=path)
    holding = replace(moving, target_path=None)
    errors = {}
    for name in ("drum still", "feed-forward + feedback", "predictive control (state)"):
        for scenario in (moving, holding):
            config = TaskConfig(scenario=scenario, observation="sensors")
            policy = choose(name).policy(BuildContext(scenarios=[scenario], config=config))
            seen = "state" if policy.knows is Knowledge.STATE else "sensors"
            errors[name, scenario is moving] = run(policy, [scenario], config.replaced(observation=seen)).rms[0]
        # On its way the load is held as it is at one level, up to what the corners leave.
        assert errors[name, True] < 1.2 * errors[name, False] + 0.05


@pytest.mark.parametrize("find", [choose, lambda text: choose_all([text])])
def test_nothing_behind_the_colon_of_an_agent_is_refused(find):
    with pytest.raises(InvalidValue, match="policy = 'apg-storm:': must be one of"):
        find("apg-storm:")


def test_shipped_agents_of_one_name_are_told_apart_by_what_was_asked_for():
    names = [spec.name for spec in choose_all(["apg-storm:forecasts", "apg-mru:forecasts"])]
    assert [name.rpartition(", ")[2] for name in names] == ["apg-storm:forecasts", "apg-mru:forecasts"]
