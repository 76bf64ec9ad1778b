"""The shipped agents still do what the committed comparison says of them."""

import json
from pathlib import Path

import numpy as np
import pytest
from pyarrow.parquet import read_table

from aframe_env import ScenarioDistribution
from agents import load
from agents.rollout import held_out_scenarios, run
from train.shared.run_folder import versions

RESULTS = Path(__file__).parents[3] / "results"
SCENARIOS = 4
ELSEWHERE = 0.02
"""Relative: another processor or library rounds otherwise, and a closed loop forgets that but for its noise."""


def committed(policy):
    chosen = [("policy", "==", policy), ("scenario", "<", SCENARIOS)]
    columns = ("rms", "omega1", "omega2")
    table = read_table(RESULTS / "comparison" / "episodes.parquet", columns=[*columns, "scenario"], filters=chosen)
    table = table.sort_by("scenario")
    return {name: table[name].to_numpy() for name in columns}


@pytest.mark.parametrize(
    ("folder", "policy"),
    [
        ("ppo", "PPO, seed 0"),
        ("sac", "SAC, seed 0"),
        ("ppo-sensors", "PPO on sensors, seed 0"),
        ("sac-sensors", "SAC on sensors, seed 0"),
    ],
)
def test_a_shipped_agent_meets_the_committed_figures(folder, policy):
    agent = load(RESULTS / "agents" / folder)
    found = run(agent, held_out_scenarios(ScenarioDistribution(), SCENARIOS), observation=agent.card.observation)
    want = committed(policy)
    here = json.loads((RESULTS / "comparison" / "run.json").read_text(encoding="utf-8"))["versions"] == versions()
    for name, values in (("rms", found.rms), ("omega1", found.omega1), ("omega2", found.omega2)):
        assert len(want[name]) == SCENARIOS
        np.testing.assert_allclose(values, want[name], rtol=0.0 if here else ELSEWHERE)
