import json

import pytest

from benchmarks import learner


@pytest.mark.parametrize(("target", "reached"), [(-1e9, True), (1.1, False)])
def test_both_set_ups_learn_until_the_target_or_the_limit(target, reached, tmp_path, monkeypatch):
    monkeypatch.setattr(learner, "LOOKS_EVERY", 1)
    out = tmp_path / "learner.json"
    tiny = ("--rounds", 1, "--scenarios", 2, "--limit", 1e-3, f"--target={target}", "--out", out)
    monkeypatch.setattr("sys.argv", ["benchmarks.learner", *map(str, tiny)])
    assert learner.main() == 0
    found = json.loads(out.read_text())
    assert [o["setup"] for o in found["outcomes"]] == ["this package", "plain"]
    assert all(o["reached"] is reached and len(o["reductions"]) == 1 for o in found["outcomes"])
    assert found["ratio_is_a_lower_bound"] is not reached
