"""A training gives the best agent that it was looked at with."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from rich.console import Console

from agents.learned.agent import load
from agents.learned.feature_sets import feature_names
from agents.policy import DrumStill
from agents.rollout import run
from train.learn import ppo, ppo_predictive
from train.learn.practice import half_saturating
from train.learn.run import METRICS, train
from train.learn.selection import VALIDATION_SEED
from train.learn.trained import to_policy

OPTIONS = ppo.Options(
    n_envs=3,
    n_steps=8,
    batch_size=12,
    n_epochs=2,
    timesteps=240,
    eval_scenarios=0,
    log=(),
    selected_by=3,
)
QUIET = Console(quiet=True)


def left(policy, options):
    """Mean share of the heave that a policy leaves in the scenarios that agents are looked at on."""
    scenarios = half_saturating(options.config, VALIDATION_SEED, options.selected_by)
    still = run(DrumStill(), scenarios, options.config).rms
    return np.mean(run(policy, scenarios, options.config).rms / still)


def test_a_training_that_makes_worse_gives_the_agent_that_it_began_with(tmp_path):
    options = replace(OPTIONS, learning_rate=0.3, out=tmp_path / "run")
    assert train(ppo.SPEC, options, QUIET) == 0
    agent = load(tmp_path / "run")
    assert agent.card.timesteps == 0
    untrained = to_policy(ppo.build(options), options)[0]
    assert left(agent, options) == left(untrained, options)


def test_what_is_said_of_the_best_agent_is_true_of_the_one_that_is_given(tmp_path):
    options = replace(OPTIONS, out=tmp_path / "run")
    assert train(ppo.SPEC, options, QUIET) == 0
    agent = load(tmp_path / "run")
    said = json.loads((tmp_path / "run" / METRICS).read_text())
    assert said["best_after"] == agent.card.timesteps
    assert said["heave_left"] == pytest.approx(left(agent, options), rel=1e-12)
    assert said["heave_left"] <= left(to_policy(ppo.build(options), options)[0], options)


def test_an_agent_that_corrects_predictive_control_begins_with_predictive_control():
    options = ppo_predictive.Options(n_envs=2, batch_size=2, practice=0)
    untrained = to_policy(ppo.build(options), options)[0].actor
    features = torch.randn(50, len(feature_names(options.features)), generator=torch.Generator().manual_seed(1))
    assert not untrained(features).any()
