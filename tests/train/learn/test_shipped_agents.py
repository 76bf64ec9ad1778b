"""What is shipped still does what the committed tables say of it: agents of all seeds, laws, map and optimum."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from pyarrow.parquet import read_table

from aframe_env import ScenarioDistribution, TaskConfig
from aframe_env.suite import TASKS, find_task
from agents.registry import BuildContext, choose_all
from agents.rollout import held_out_scenarios, run
from train.benchmark import ceiling, leaderboard
from train.evaluate.run import observation_of
from train.evaluate.statistics import family
from train.shared.run_folder import versions

RESULTS = Path(__file__).parents[3] / "results"
SCENARIOS = 4
ELSEWHERE = {"rms": 0.01, "omega2": 0.05}
"""Shares of the still drum's: where the winch saturates, the turn of a drum hardly depends on its command, and its
inverse makes a rounding of 1e-8 by another processor or library one of 1e-4, which the next steps carry on. Commands
that err by 3e-8 of themselves move the rms by up to 0.0065 and the amplitude by up to 0.027."""
EXACT = {"drive map in real time": 1e-10}
"""Relative, where all else is exact: the magnitude of a complex number rounds by its place in an array."""
AGENTS = [str(folder) for folder in sorted((RESULTS / "agents").iterdir())]
SPECIALISTS = [agents for agents in AGENTS if agents.endswith(tuple(f"-{task.lower()}" for task in TASKS))]
"""Agents that learned a task of the suite: their figures are in the leaderboard."""
POLICIES = choose_all(
    [
        *(agents for agents in AGENTS if agents not in SPECIALISTS),
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


@pytest.mark.parametrize(
    "folder",
    [pytest.param(each, marks=() if each.endswith("apg-storm") else pytest.mark.slow) for each in SPECIALISTS],
    ids=lambda folder: Path(folder).name,
)
def test_an_agent_of_a_task_meets_its_row_of_the_leaderboard(folder):
    task, specs = find_task(Path(folder).name.rpartition("-")[2]), choose_all([folder])
    config, scenarios = TaskConfig(**task.arguments), task.scenarios("test", 100)
    digests = tuple(spec.digest for spec in specs)
    rows = leaderboard.read(RESULTS / "tasks" / leaderboard.NAME)
    known = (task.id, family(specs[0].name), digests, 100)
    (row,) = [row for row in rows if (row.task, row.policy, row.sha256, row.scenarios) == known]
    stored = ceiling.read(RESULTS / "tasks" / task.name.lower() / ceiling.file_name("test"))
    assert row.seeds == len(specs)
    shares = []
    for spec in specs:
        policy = spec.policy(BuildContext(scenarios=scenarios, config=config))
        ran = config.replaced(observation=observation_of(policy, config))
        left = run(policy, scenarios, ran, noise_seed=task.seed("test")).rms
        shares.append((1.0 - left / np.array(stored.still)) / stored.reductions)
    assert np.mean(shares) == pytest.approx(row.share.value, abs=1e-3)
    assert np.mean([np.sort(each)[:5].mean() for each in shares]) == pytest.approx(row.share_worst.value, abs=1e-2)
