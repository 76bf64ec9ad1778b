import json

import pytest
import torch

from aframe_env import InvalidValue
from agents.learned.recurrent import WEIGHTS, load
from agents.policy import Knowledge
from train.apg import __main__ as apg
from train.apg import stages
from train.apg.learning import shortfall
from train.apg.options import ApgOptions
from train.apg.stages import FOLDER, Training
from train.shared.console import PlainConsole
from train.shared.run_folder import release

TINY = {
    "episodes": 48,
    "memory": 16,
    "hidden": 32,
    "forecaster_steps": 6,
    "forecaster_batch": 16,
    "forecaster_rate": 1e-3,
    "rounds": 1,
    "labels": 20_000,
    "imitation_steps": 500,
    "imitation_batch": 1024,
    "imitation_rate": 3e-3,
    "updates": 4,
    "batch": 16,
    "look_every": 2,
    "validation": 12,
}
NOTHING_LEARNED = {"episodes": 2, "forecaster_steps": 0, "rounds": 0, "updates": 0}


def train(folder, **changes):
    console = PlainConsole()
    console.quiet = True
    try:
        apg.train(ApgOptions(**{**TINY, **changes, "out": folder}), console)
    finally:
        release(folder)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("apg") / "run"
    train(folder)
    return folder


def looks(folder):
    return json.loads((folder / apg.METRICS).read_text())["looks"]


def test_a_tiny_training_improves_on_its_start(trained, tmp_path):
    train(tmp_path / "start", **NOTHING_LEARNED)
    (start,) = looks(tmp_path / "start")
    assert [each["updates"] for each in looks(trained)] == [0, 2, 4]
    best = min(looks(trained), key=lambda look: look["shortfall"])
    assert best["shortfall"] < start["shortfall"] - 0.05
    assert best["worst"] > start["worst"]
    assert load(tmp_path / "start").card.algorithm == "recurrent regulator"


def test_what_is_written_is_an_agent_and_no_stage_is_left(trained):
    policy = load(trained)
    assert policy.knows is Knowledge.SENSORS
    assert (policy.card.algorithm, policy.card.task) == ("recurrent APG", "AFrameHeave-Storm-v0")
    assert (policy.card.memory, policy.card.hidden, policy.card.seed) == (16, 32, 0)
    assert not (trained / FOLDER).exists()
    with pytest.raises(InvalidValue, match="this training is finished"):
        train(trained)


class Killed(Exception):
    pass


def test_a_training_that_is_killed_after_its_stages_ends_with_the_same_bytes(trained, tmp_path, monkeypatch):
    write = Training._write
    folder = tmp_path / "run"
    for after in ("recordings-0", "forecaster", "labels-0", "climb"):

        def killed(self, name, arrays, after=after):
            write(self, name, arrays)
            if name == after:
                raise Killed

        monkeypatch.setattr(Training, "_write", killed)
        with pytest.raises(Killed):
            train(folder)
        assert (folder / FOLDER / f"{after}.safetensors").exists()
        assert not (folder / WEIGHTS).exists()
        monkeypatch.setattr(stages, "record", None)  # what is kept is not recorded again
    monkeypatch.setattr(Training, "_write", write)
    train(folder)
    assert (folder / WEIGHTS).read_bytes() == (trained / WEIGHTS).read_bytes()
    assert looks(folder) == looks(trained)


def test_the_worst_cases_weigh_more_in_the_loss():
    options = ApgOptions(tail=0.25, tail_weight=0.5)
    shares = torch.tensor([0.9, 1.0, 0.6, -3.0], requires_grad=True)
    loss = shortfall(shares, options)
    # A lost episode counts as 1.5, and is the worst quarter.
    assert float(loss.detach()) == pytest.approx((0.1 + 0.0 + 0.4 + 1.5) / 4 + 0.5 * 1.5)
    better = torch.tensor([0.9, 1.0, 0.6, 0.2], requires_grad=True)
    shortfall(better, options).backward()
    assert better.grad.tolist() == pytest.approx([-0.25, -0.25, -0.25, -0.75])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"task": "Calm"}, "task = 'Calm'"),
        ({"episodes": 1}, "episodes = 1"),
        ({"tail": 0.0}, "tail = 0"),
        ({"rate": -1.0}, "rate = -1"),
        ({"observation": "sonar"}, "observation = 'sonar'"),
    ],
)
def test_bad_options_are_refused(changes, words):
    with pytest.raises(InvalidValue, match=words):
        ApgOptions(**changes)


@pytest.mark.parametrize(
    ("task", "words"), [("Splash", "^target_path, height of the load: must"), ("Landing", "^target_path, seabed: must")]
)
def test_a_task_that_the_twin_does_not_know_is_refused_before_anything_is_written(tmp_path, task, words):
    with pytest.raises(InvalidValue, match=words):
        train(tmp_path / "run", task=task)
    assert not (tmp_path / "run").exists()


def test_on_unknown_it_reckons_how_late_everything_is(tmp_path):
    train(tmp_path / "run", task="Unknown", **NOTHING_LEARNED)
    policy = load(tmp_path / "run")
    assert policy.card.adapts
    # A regulator that nobody has taught: what is hand-written of it does the better part.
    (start,) = looks(tmp_path / "run")
    assert start["share"] > 0.7
