"""PPO and SAC that learn on from a recurrent agent."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from rich.console import Console

from aframe_env import ScenarioDistribution
from aframe_env.config import TaskConfig
from aframe_env.validation import InvalidValue
from agents.learned import recurrent
from agents.learned.agent import digest
from agents.learned.recurrent import RecurrentCard, RecurrentPolicy
from agents.learned.recurrent_inputs import LookoutConfig
from agents.registry import choose_all
from agents.rollout import held_out_scenarios, run
from train.learn import ppo, ppo_recurrent, sac, sac_recurrent
from train.learn.run import train
from train.learn.trained import to_policy
from train.shared.run_folder import write_agent

STORM = Path(__file__).parents[3] / "results/agents/apg-storm"
QUIET = Console(quiet=True)
FEW = {"n_envs": 3, "practice": 4, "selected_by": 0, "eval_scenarios": 0, "log": (), "timesteps": 96, "horizon": 4.0}
PPO = {**FEW, "n_steps": 8, "batch_size": 12, "n_epochs": 2, "critic_first": 1}
SAC = {**FEW, "replay": 90, "batch_size": 8, "critic_first": 30}
LEARNERS = {"PPO": (ppo_recurrent, PPO), "SAC": (sac_recurrent, SAC)}


def taught(folder, observation="sensors"):
    """A recurrent agent that asks for more than there is now and then, in a folder."""
    made_for = LookoutConfig.of(TaskConfig(observation=observation))
    card = RecurrentCard(
        algorithm="recurrent imitation",
        observation=observation,
        sensors=made_for.sensors,
        waves=made_for.waves,
        memory=8,
        hidden=16,
        control_period=0.1,
        task="",
        seed=0,
        versions={},
        sha256="",
    )
    torch.manual_seed(1)
    network = card.network()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.1 * torch.randn_like(parameter))
        network.last.weight.mul_(10.0)
    weights = recurrent.serialise(network)
    policy = RecurrentPolicy(network, replace(card, sha256=digest(weights)))
    write_agent(folder / recurrent.WEIGHTS, weights, folder / recurrent.CARD, recurrent.card_text(policy.card))
    return policy


@pytest.mark.parametrize("observation", ["state", "sensors"])
@pytest.mark.parametrize("name", LEARNERS)
def test_before_learning_the_actor_does_what_the_agent_does_that_it_starts_from(name, observation, tmp_path):
    start, (module, few) = taught(tmp_path, observation), LEARNERS[name]
    learner = module.SPEC.build(module.Options(**few, observation=observation, start_from=tmp_path))
    rows, observed, largest = learner.rows, learner.rows.reset(), 0.0
    scenarios = list(rows._simulation.scenarios)
    start.reset([scenario.as_told for scenario in scenarios], 0.1)
    for step in range(35):
        command = start.act(rows._simulation.observe(), 0.1 * step)
        action, _ = learner.model.predict(observed, deterministic=True)
        largest = max(largest, abs(action).max())
        observed, _, finished, _ = rows.step(action)
        # Rounding to float32 in batches of other sizes adds up, as both reckon with commands of their own.
        np.testing.assert_allclose(rows._commands, command, rtol=0.0, atol=5e-5)
        if finished.any():
            break
    assert step > 2
    assert largest > 1.0
    untrained = to_policy(learner, module.Options(**few, observation=observation, start_from=tmp_path))[0]
    scenarios = held_out_scenarios(ScenarioDistribution(), 2)
    plays = [run(each, scenarios, episode_duration=3.0, observation=observation) for each in (untrained, start)]
    assert np.array_equal(plays[0].drum_speed, plays[1].drum_speed)


@pytest.mark.parametrize("name", LEARNERS)
def test_what_was_learned_on_is_a_recurrent_agent_whose_memory_is_as_it_was(name, tmp_path):
    start, (module, few) = taught(tmp_path / "start"), LEARNERS[name]
    options = module.Options(**few, start_from=tmp_path / "start", out=tmp_path / "run")
    assert train(module.SPEC, options, QUIET) == 0
    agent = recurrent.load(tmp_path / "run")
    assert agent.name == f"recurrent {name} from imitation on sensors"
    assert agent.card.started_from == f"recurrent imitation, {start.card.sha256}"
    assert agent.card.timesteps == json.loads((tmp_path / "run" / "metrics.json").read_text())["timesteps"]
    before, after = start.network.state_dict(), agent.network.state_dict()
    changed = {key.split(".")[0] for key in before if not torch.equal(before[key], after[key])}
    assert changed == {"of_context", "of_load", "second", "last"}
    (spec,) = choose_all([str(tmp_path / "run")])
    assert spec.name == agent.name
    played = run(agent, held_out_scenarios(ScenarioDistribution(), 2), episode_duration=3.0, observation="sensors")
    assert np.isfinite(played.rms).all()


@pytest.mark.parametrize("name", LEARNERS)
def test_the_critics_learn_first(name, tmp_path):
    start, (module, few) = taught(tmp_path), LEARNERS[name]

    def learned(timesteps):
        learner = module.SPEC.build(module.Options(**few, start_from=tmp_path))
        critics = [p for key, p in learner.model.policy.named_parameters() if "critic" in key or "value" in key]
        before = [p.clone() for p in critics]
        weight = getattr(learner.model, "log_ent_coef", None)
        weighed = None if weight is None else weight.item()
        learner.model.learn(timesteps)
        assert not any(torch.equal(a, b) for a, b in zip(before, critics, strict=True) if a.numel() > 1)
        pairs = zip(start.network.parameters(), learner.to_actor().parameters(), strict=True)
        kept = all(torch.equal(a, b) for a, b in pairs)
        assert weight is None or (weight.item() == weighed) == kept
        return kept

    assert learned(24)
    assert not learned(48)


def test_an_agent_to_start_from_goes_by_its_name_or_its_folder():
    by_name, by_folder, by_seed = (
        ppo_recurrent.Options(task="Storm", start_from=Path(place)).start
        for place in ("apg-storm", STORM, STORM / "seed-0")
    )
    assert by_name.card == by_folder.card == by_seed.card
    assert by_name.card.algorithm == "recurrent APG"


def test_start_from_leads_to_options_of_their_own(tmp_path):
    taught(tmp_path)
    assert ppo.SPEC.successor(ppo.Options(start_from=tmp_path)) == "ppo-recurrent"
    assert sac.SPEC.successor(sac.Options(start_from=tmp_path)) == "sac-recurrent"
    assert ppo.SPEC.successor(ppo.Options()) is sac.SPEC.successor(sac.Options()) is None


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"observation": "state"}, "its agent observes 'sensors', trained on .*: must be with the very sensors"),
        ({"winch": True}, "winch = True: must be left out"),
        ({"control_period": 0.2}, "control_period = 0.2 s: must be 0.1 s"),
        ({"task": "MRU"}, "must be with the very sensors .* task = 'MRU'"),
        ({"task": "Landing"}, "must not be given where target or frame move"),
    ],
)
def test_what_does_not_go_with_the_agent_is_refused(changes, words, tmp_path):
    taught(tmp_path)
    with pytest.raises(InvalidValue, match=words):
        sac_recurrent.Options(**changes, start_from=tmp_path)
