"""Pictures of one scenario of a task."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from aframe_env import TASKS, TaskConfig
from agents import shipped
from agents.control.optimum import optimise
from agents.registry import choose_all
from train.benchmark.scenes import SHOWN, draw, find_scene


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


def test_every_task_has_a_law_and_the_agents_that_were_trained_on_it():
    assert set(SHOWN) == set(TASKS)
    trained = {name: text for texts in SHOWN.values() for text in texts for name in [text] if text in shipped.RECURRENT}
    assert set(trained) == {name for name in shipped.RECURRENT if "state" not in name}
    for texts in SHOWN.values():
        assert choose_all(texts)
