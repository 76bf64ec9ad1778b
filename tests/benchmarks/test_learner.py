import json
from dataclasses import replace

import pytest

from benchmarks import learner
from train.learn import ppo


def test_a_target_below_output_zero_is_met_before_anything_is_learned(tmp_path, monkeypatch):
    out = tmp_path / "learner.json"
    tiny = ("--rounds", 1, "--scenarios", 2, "--half-way=-1e9", "--trials", 1, "--out", out)
    monkeypatch.setattr("sys.argv", ["benchmarks.learner", *map(str, tiny)])
    assert learner.main() == 0
    found = json.loads(out.read_text())
    assert [(o["setup"], o["reached"]) for o in found["outcomes"]] == [("this package", True), ("plain", True)]
    assert all(o["timesteps"] == 64 and len(o["reductions"]) == 1 for o in found["outcomes"])
    assert not found["ratio_is_a_lower_bound"]
    assert found["output_zero"] < found["shipped"]


@pytest.mark.parametrize("setup", learner.SETUPS)
def test_a_learner_is_looked_at_from_the_start_and_given_up_at_the_limit(setup):
    few = replace(ppo.Options(observation="sensors"), n_envs=2, n_steps=8, batch_size=16, n_epochs=1)
    outcome = learner.learn(setup, few, learner.Course("sensors", 2), target=1.1, limit=1e-3)
    assert not outcome.reached
    assert outcome.seconds > 1e-3
    # A step of both rows after the first rollout, or in it already where a millisecond is gone by then.
    assert outcome.timesteps in (2, 18)
    assert len(outcome.reductions) == 1
    assert 0.0 < outcome.environment < 1.0
