"""Learners of sb3-contrib learn a task of the suite, and what they learned plays like any other policy."""

from __future__ import annotations

import importlib
import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import torch
from gymnasium.error import DependencyNotInstalled

from aframe_env import Scenario, TaskConfig, find_task
from aframe_env.simulation import Simulation
from aframe_env.validation import InvalidValue
from agents.policy import Policy, begin
from agents.registry import BuildContext, choose

pytest.importorskip("sb3_contrib", reason="needs the extra contrib: sb3-contrib")
from examples import learn_sb3_contrib as example

SCENARIOS = find_task("Storm").scenarios("train", 4)
CONFIG = TaskConfig(**find_task("Storm").arguments)
ALIKE = 1e-5
"""rad/s."""
Floats = npt.NDArray[Any]


@pytest.fixture(scope="module", params=["tqc", "recurrent-ppo"])
def trained(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The module that a short training on Storm has written, imported as the benchmark does."""
    name = request.param.replace("-", "_")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("desk"))
        example.learn(request.param, Path("runs", name), timesteps=2048, rows=16, scenarios=2)
        spec = choose(f"runs.{name}.policy:policy")
    module = importlib.import_module(f"runs.{name}.policy")
    assert spec.name == module.policy.name == f"{example.NAMES[request.param]} on sensors (sb3-contrib)"
    return module


@pytest.fixture(scope="module")
def readings() -> Floats:
    """Readings (T, N, K) of the scenarios while the drum stands still."""
    simulation = Simulation(len(SCENARIOS), CONFIG)
    simulation.reset_rows(np.arange(len(SCENARIOS)), [(scenario, 0) for scenario in SCENARIOS])
    taken = []
    for _ in range(80):
        taken.append(simulation.observe().copy())
        simulation.advance(np.zeros(len(SCENARIOS)))
    return np.array(taken)


def commands(policy: Policy, scenarios: list[Scenario], readings: Floats) -> Floats:
    """Commands (T, N) rad/s from the start of N episodes on."""
    begin(policy, scenarios, CONFIG.control_period)
    return np.array([policy.act(each, 0.1 * i) for i, each in enumerate(readings)])


def test_a_lift_s_commands_do_not_depend_on_its_place_nor_on_the_others(trained: ModuleType, readings: Floats) -> None:
    together = commands(trained.policy, SCENARIOS, readings)
    base = choose("output zero on sensors").policy(BuildContext(scenarios=SCENARIOS, config=CONFIG))
    assert np.abs(together - commands(base, SCENARIOS, readings)).max() > 100.0 * ALIKE  # it has learned something
    order = [2, 0, 3, 1]
    shuffled = commands(trained.policy, [SCENARIOS[i] for i in order], readings[:, order])
    np.testing.assert_allclose(shuffled, together[:, order], atol=ALIKE)
    for i, scenario in enumerate(SCENARIOS):
        alone = commands(trained.policy, [scenario], readings[:, [i]])
        np.testing.assert_allclose(alone, together[:, [i]], atol=ALIKE)


def test_what_was_saved_plays_as_what_was_trained_and_forgets_at_a_reset(trained: ModuleType, readings: Floats) -> None:
    first = commands(trained.policy, SCENARIOS, readings)
    np.testing.assert_array_equal(commands(trained.policy, SCENARIOS, readings), first)
    text = Path(trained.__file__ or "").read_text("utf-8")
    with pytest.raises(InvalidValue, match="must have 0000"):
        exec(text.replace(text.partition('sha256="')[2][:64], "0" * 64), {"__file__": trained.__file__})


@pytest.mark.parametrize("trained", ["recurrent-ppo"], indirect=True)
def test_the_memory_is_that_of_the_whole_episode(
    trained: ModuleType, readings: Floats, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The LSTM over all features at once gives the outputs that it gave step by step; a step alone gives others."""
    model = trained.policy._model
    seen, given, predict = [], [], model.predict

    def spy(features: Floats, **more: Any) -> Any:
        output, memory = predict(features, **more)
        seen.append(features.copy())
        given.append(output)
        return output, memory

    monkeypatch.setattr(model, "predict", spy)
    commands(trained.policy, SCENARIOS, readings)

    def outputs(sequence: torch.Tensor) -> Floats:
        with torch.no_grad():
            latent, _ = model.policy.lstm_actor(sequence)
            return model.policy.action_net(model.policy.mlp_extractor.forward_actor(latent)).clamp(-1.0, 1.0).numpy()

    features = torch.from_numpy(np.array(seen))
    np.testing.assert_allclose(given, outputs(features), atol=1e-5)
    alone = outputs(features.reshape(1, -1, features.shape[-1])).reshape(np.shape(given))
    assert np.abs(given - alone).max() > 1e-3


def test_winches_are_told_where_they_differ() -> None:
    assert example.settings("tqc", "Storm", "sensors").winch
    assert not example.settings("tqc", "Unknown", "sensors").winch


@pytest.mark.parametrize("out", ["my-run", "/tmp/run", "../run"])
def test_a_folder_that_nothing_can_be_imported_from_is_refused(out: str) -> None:
    with pytest.raises(InvalidValue, match="named in letters, digits and _"):
        example.learn("tqc", Path(out))


def test_an_interrupted_training_leaves_the_folder_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(example.ShowReduction, "_on_rollout_end", interrupt)
    earlier = Path("runs/earlier/policy.py")
    earlier.parent.mkdir(parents=True)
    earlier.write_text("mine", "utf-8")
    with pytest.raises(InvalidValue, match="exists and is not empty"):
        example.learn("tqc", earlier.parent)
    with pytest.raises(KeyboardInterrupt):
        example.learn("tqc", earlier.parent, rows=4, overwrite=True)
    assert list(earlier.parent.iterdir()) == [earlier]
    assert earlier.read_text("utf-8") == "mine"


def test_without_the_library_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(DependencyNotInstalled, match=r"sb3_contrib is not installed: pip install .*\[contrib\]"):
        runpy.run_path(str(example.__file__), run_name="imported")
