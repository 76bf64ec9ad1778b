"""Pictures of one scenario of a task."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from aframe_env import TASKS, InvalidValue, TaskConfig
from agents import shipped
from agents.control.optimum import optimise
from train.benchmark.__main__ import Options, chosen_for
from train.benchmark.specialists import specialists
from train.scenes import Options as SceneOptions
from train.scenes import draw, find_scene


def test_a_scene_is_a_hard_scenario_and_no_freak(tmp_path):
    storm = TASKS["Storm"]
    scene = find_scene(storm, 4)
    scenarios, config = storm.scenarios("validation", 4), TaskConfig(**storm.arguments)
    assert scene.scenario == scenarios[scene.number]
    best = np.sqrt(optimise(scenarios, config).omega1 / 60.0)
    names = list(scene.runs)
    assert (names[0], names[-1]) == ("drum still", "winch-limited optimum")
    assert scene.runs[names[-1]].rms[0] == pytest.approx(best[scene.number])
    assert scene.share(names[0]) == 0.0
    assert scene.share(names[-1]) == 1.0
    assert all(0.0 < scene.share(name) < 1.0 for name in names[1:-1])
    draw(tmp_path / "scene.png", scene)
    with Image.open(tmp_path / "scene.png") as picture:
        assert min(picture.size) > 600


def test_an_agent_is_the_specialist_of_the_task_that_it_was_trained_on():
    found = {name: set(specialists(task)) for name, task in TASKS.items()}
    every = set().union(*found.values())
    assert set(shipped.RECURRENT) <= every
    assert sum(map(len, found.values())) == len(every)
    assert {"apg-storm", "apg-state-storm"} <= found["Storm"]
    assert not every & {"ppo", "ppo-sensors", "predictive-ppo-sensors", "sac-sensors"}
    assert specialists(TASKS["Storm"], "state") == ["apg-state-storm"]
    ours = [spec.text for spec in chosen_for(TASKS["Storm"], Options())]
    assert {"apg-storm", "apg-state-storm", "ppo-sensors", "predictive control"} <= {Path(text).name for text in ours}
    assert "apg-unknown" not in ours
    assert [spec.text for spec in chosen_for(TASKS["Storm"], Options(policies=("inverse dynamics",)))] == [
        "inverse dynamics"
    ]


def test_an_agent_on_features_is_the_specialist_of_the_task_on_its_card(tmp_path, monkeypatch):
    cards = {"ppo-storm": "AFrameHeave-Storm-v0", "ppo-mru": "AFrameHeave-MRU-v0", "ppo": "", "older": None}
    for name, task in cards.items():
        (tmp_path / name / "seed-0").mkdir(parents=True)
        card = {"observation": "sensors"} | ({} if task is None else {"task": task})
        (tmp_path / name / "seed-0" / "agent.json").write_text(json.dumps(card), encoding="utf-8")
    monkeypatch.setattr(shipped, "AGENTS", {name: tmp_path / name for name in cards})
    before = set(shipped.RECURRENT)
    assert set(specialists(TASKS["Storm"])) - before == {"ppo-storm"}
    assert set(specialists(TASKS["MRU"], "sensors")) - before == {"ppo-mru"}
    assert set(specialists(TASKS["MRU"], "state")) - before == set()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"tasks": ()}, r"tasks = \(\): must be one"),
        ({"tasks": ("Calm",)}, "'Calm'"),
        ({"scenarios": 0}, "scenarios = 0"),
    ],
)
def test_scenes_of_nothing_are_refused(options, says):
    with pytest.raises(InvalidValue, match=says):
        SceneOptions(**options)
