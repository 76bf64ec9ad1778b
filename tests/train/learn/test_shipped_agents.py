"""What is shipped still does what the committed comparison says of it: agents of all seeds, laws, map and optimum."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pyarrow.parquet import read_table

from aframe_env import ScenarioDistribution, TaskConfig
from agents.registry import BuildContext, choose_all
from agents.rollout import held_out_scenarios, run
from train.evaluate.run import observation_of
from train.shared.run_folder import versions

RESULTS = Path(__file__).parents[3] / "results"
SCENARIOS = 4
ELSEWHERE = 0.02
"""Relative: another processor or library rounds otherwise, and a closed loop forgets that but for its noise."""
EXACT = {"drive map in real time": 1e-10}
"""Relative, where all else is exact: the magnitude of a complex number rounds by its place in an array."""
POLICIES = choose_all(
    [
        *(str(folder) for folder in sorted((RESULTS / "agents").iterdir())),
        str(RESULTS / "drive-map"),
        "feed-forward + feedback (state)",
        "feed-forward + feedback",
        "predictive control (state)",
        "predictive control",
        "inverse dynamics",
        "output zero",
        "output zero on sensors",
        "winch-limited optimum",
    ]
)


@cache
def committed():
    columns = ["policy", "scenario", "rms", "omega1", "omega2"]
    chosen = [("scenario", "<", SCENARIOS)]
    table = read_table(RESULTS / "comparison" / "episodes.parquet", columns=columns, filters=chosen)
    rows = table.sort_by("scenario").to_pylist()
    return {name: [row for row in rows if row["policy"] == name] for name in {row["policy"] for row in rows}}


def test_all_seeds_are_there():
    assert len(POLICIES) == 8 * 5 + 9
    assert {spec.name for spec in POLICIES} <= set(committed())


@pytest.mark.parametrize("spec", POLICIES, ids=lambda spec: spec.name)
def test_a_policy_meets_the_committed_figures(spec):
    config, scenarios = TaskConfig(), held_out_scenarios(ScenarioDistribution(), SCENARIOS)
    policy = spec.build(BuildContext(scenarios=scenarios, config=config))
    found = run(policy, scenarios, config.replaced(observation=observation_of(policy, config)))
    want = committed()[spec.name]
    assert len(want) == SCENARIOS
    here = json.loads((RESULTS / "comparison" / "run.json").read_text(encoding="utf-8"))["versions"] == versions()
    for name, values in (("rms", found.rms), ("omega1", found.omega1), ("omega2", found.omega2)):
        rtol, atol = (EXACT.get(spec.name, 0.0), 0.0) if here else (ELSEWHERE, 1e-9)
        np.testing.assert_allclose(values, [row[name] for row in want], rtol=rtol, atol=atol)
