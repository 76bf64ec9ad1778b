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
ELSEWHERE = {"rms": 0.01, "omega2": 0.05}
"""Shares of the still drum's: where the winch saturates, the turn of a drum hardly depends on its command, and its
inverse makes a rounding of 1e-8 by another processor or library one of 1e-4, which the next steps carry on. Commands
that err by 3e-8 of themselves move the rms by up to 0.0065 and the amplitude by up to 0.027."""
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
        figures = np.array([row[name] for row in want])
        if here:
            np.testing.assert_allclose(values, figures, rtol=EXACT.get(spec.name, 0.0), atol=0.0)
        elif name in ELSEWHERE:
            still = np.array([row[name] for row in committed()["drum still"]])
            np.testing.assert_allclose(values / still, figures / still, rtol=0.0, atol=ELSEWHERE[name])
