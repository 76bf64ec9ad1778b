import csv
import os
from types import SimpleNamespace

import pytest

from aframe_env import ScenarioDistribution
from train.learn import tune
from train.learn.registry import find_learner
from train.shared.job_store import JobStore

TINY = ("--timesteps", 256, "--scenarios", 3)


def command(monkeypatch, *arguments):
    monkeypatch.setattr("sys.argv", ["train.tune", *map(str, arguments)])
    return tune.main()


def trials(folder):
    with (folder / "trials.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(autouse=True)
def small(monkeypatch):
    spec = find_learner("ppo")
    smaller = tune.replace(spec, options=lambda: tune.replace(spec.options(), n_envs=32))
    monkeypatch.setattr(tune, "find_learner", {"ppo": smaller, "ppo-rsl": find_learner("ppo-rsl")}.get)


def test_a_search_goes_on_where_it_ended(tmp_path, monkeypatch):
    out = tmp_path / "study"
    assert command(monkeypatch, *TINY, "--trials", 1, "--out", out) == 0
    first = trials(out)
    assert command(monkeypatch, *TINY, "--trials", 2, "--out", out) == 0
    both = trials(out)
    assert both[:1] == first
    assert len(both) == 2
    defaults = find_learner("ppo").options()
    assert float(first[0]["learning_rate"]) == defaults.learning_rate
    assert float(both[1]["learning_rate"]) != defaults.learning_rate

    assert command(monkeypatch, *TINY, "--trials", 3, "--out", out) == 0
    assert trials(out)[2]["learning_rate"] not in [trial["learning_rate"] for trial in both]
    table = (out / "study.md").read_text().splitlines()
    assert f"{max(float(trial['median']) for trial in trials(out)):.2%}" in table[2]
    assert len(table) == 5


def test_another_search_in_the_same_folder_is_refused(tmp_path, monkeypatch, capsys):
    out = tmp_path / "study"
    assert command(monkeypatch, *TINY, "--trials", 1, "--out", out) == 0
    kept = (out / "jobs.sqlite").read_bytes()
    with pytest.raises(SystemExit):
        command(monkeypatch, "--timesteps", 512, "--scenarios", 3, "--trials", 1, "--out", out)
    assert "exists and is not empty; choose another, or pass --overwrite" in capsys.readouterr().err
    assert (out / "jobs.sqlite").read_bytes() == kept
    assert command(monkeypatch, "--timesteps", 512, "--scenarios", 3, "--trials", 1, "--out", out, "--overwrite") == 0
    assert len(trials(out)) == 1


class Killed(BaseException):
    """What a process that is killed never sees."""


def test_a_search_that_stops_behind_a_trial_ends_with_the_same_bytes(tmp_path, monkeypatch):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    few = (*TINY, "--trials", 2, "--out")
    assert command(monkeypatch, *few, whole) == 0
    write, written = JobStore.write, []

    def kept(store, key, result):
        write(store, key, result)
        written.append(key)
        if len(written) == 1:
            raise Killed

    monkeypatch.setattr(JobStore, "write", kept)
    with pytest.raises(Killed):
        command(monkeypatch, *few, parts)
    assert command(monkeypatch, *few, parts) == 0
    assert len(set(written)) == len(written) == 2
    for name in ("trials.csv", "study.md"):
        assert (parts / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="needs SIGKILL")
def test_a_killed_search_ends_with_the_same_bytes(tmp_path, kill_module, run_module):
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    few = ("train.tune", "--timesteps", 256, "--scenarios", 3, "--trials", 3, "--out")
    run_module(*few, whole)
    store = parts / "jobs.sqlite"
    assert kill_module(store, 0, *few, parts) == 0  # in the first trial
    assert 1 <= kill_module(store, 1, *few, parts) < 3
    run_module(*few, parts)
    assert len(trials(parts)) == 3
    for name in ("trials.csv", "study.md"):
        assert (parts / name).read_bytes() == (whole / name).read_bytes()


def test_a_trial_that_fails_is_told_of_and_kept(tmp_path, monkeypatch, capsys):
    spec = find_learner("ppo")
    learned = []

    def build(options):
        learner = spec.build(options)
        if options.seed == 1:
            for parameter in learner.model.policy.parameters():
                parameter.data.fill_(float("nan"))
        learned.append(options.seed)
        return learner

    def small():
        return tune.replace(spec.options(), n_envs=32)

    monkeypatch.setattr(tune, "find_learner", lambda name: tune.replace(spec, options=small, build=build))
    out = tmp_path / "study"
    for _ in range(2):
        assert command(monkeypatch, *TINY, "--trials", 3, "--out", out) == 0
        assert "trial 1: failed" in capsys.readouterr().out
        assert [trial["median"] == "" for trial in trials(out)] == [False, True, False]
        assert "| 1 | failed |" in (out / "study.md").read_text().splitlines()[-1]
    assert learned == [0, 1, 2]
    assert command(monkeypatch, *TINY, "--trials", 2, "--seed", 1, "--out", tmp_path / "other") == 0


def test_a_search_of_failures_alone_says_so(tmp_path, monkeypatch, capsys):
    spec = find_learner("ppo")

    class Refusing:
        def learn(self, timesteps):
            raise ValueError("no number")

    refused = tune.replace(spec, build=lambda options: SimpleNamespace(model=Refusing()))
    monkeypatch.setattr(tune, "find_learner", lambda name: refused)
    with pytest.raises(SystemExit):
        command(monkeypatch, *TINY, "--trials", 1, "--out", tmp_path / "study")
    assert "error: trials = 1: all have failed; the first: no number" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--trials", 0), "trials = 0: must be in [1, 1000000]"),
        (("--algorithm", "dqn"), "algorithm = 'dqn': must be one of"),
        (("--algorithm", "ppo-rsl"), "algorithm = 'ppo-rsl': has no search space"),
    ],
)
def test_bad_options_are_one_clear_line(arguments, words, tmp_path, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        command(monkeypatch, *arguments, "--out", tmp_path / "study")
    assert words in capsys.readouterr().err
    assert not (tmp_path / "study").exists()


def test_validation_scenarios_are_not_the_held_out_ones():
    from agents.rollout import held_out_scenarios

    held_out = held_out_scenarios(ScenarioDistribution(), 50)
    assert not {s.load_mass for s in held_out} & {
        s.load_mass for s in tune.validation_scenarios(ScenarioDistribution(), 50)
    }
