"""Refusals of what does not fit into memory, and their figures against what is really allocated."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aframe_env import RecordedMotion, Scenario, Sensors, memory
from aframe_env.config import TaskConfig
from aframe_env.engine import Engine
from aframe_env.flexible_engine import FlexibleEngine, Mesh
from aframe_env.memory import GIB, group_limits, machine_memory, require_memory
from aframe_env.rfem.structure import Division
from aframe_env.scenario.sensors import SensorBank
from aframe_env.validation import InvalidValue
from aframe_env.vector_env import AFrameHeaveVectorEnv
from agents.policy import DrumStill
from agents.rollout import run


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What is asked for, bytes, from now on."""
    sizes: list[float] = []

    def listen(what: str, size: float) -> None:
        sizes.append(size)

    for module in ("engine", "scenario.sensors", "scenario.recorded_motion"):
        monkeypatch.setattr(f"aframe_env.{module}.require_memory", listen)
    monkeypatch.setattr("agents.rollout.require_memory", listen)
    return sizes


def peak(build: Callable[[], Any]) -> tuple[Any, int]:
    """What ``build`` returns, and the most memory that it held on the way, bytes."""
    tracemalloc.start()
    try:
        built = build()
        return built, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_the_machine_has_no_more_than_it_is_built_with() -> None:
    psutil = pytest.importorskip("psutil")
    there = machine_memory()
    assert there is not None
    assert 0 < there <= psutil.virtual_memory().total


@pytest.mark.parametrize(
    ("group", "files", "limits"),
    [
        ("0::/user/me", {"user/memory.max": "3000000", "user/me/memory.max": "max"}, [3_000_000]),
        ("0::/on/the/host", {"memory.max": "4000000"}, [4_000_000]),
        (
            "9:name=systemd:/\n4:cpu,memory:/job",
            {"memory/job/memory.limit_in_bytes": "5000000", "memory/memory.limit_in_bytes": "9223372036854771712"},
            [5_000_000, 9223372036854771712],
        ),
        ("3:cpuset:/", {"memory/memory.limit_in_bytes": "6000000"}, []),
    ],
    ids=["version 2", "in a container", "version 1", "no group of memory"],
)
def test_limits_of_control_groups(tmp_path: Path, group: str, files: dict[str, str], limits: list[int]) -> None:
    own = tmp_path / "own"
    own.write_text(group + "\n", encoding="utf-8")
    for name, text in files.items():
        (tmp_path / "groups" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "groups" / name).write_text(text + "\n", encoding="utf-8")
    assert group_limits(tmp_path / "groups", own) == limits


def test_without_control_groups_there_are_no_limits(tmp_path: Path) -> None:
    assert group_limits(tmp_path, tmp_path / "own") == []


def test_a_refusal_names_both_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "machine_memory", lambda: 23.4 * GIB)
    require_memory("num_envs = 7", 23.4 * GIB)
    with pytest.raises(InvalidValue, match=r"^num_envs = 7: needs 23.5 GiB of memory: the machine has 23.4 GiB$"):
        require_memory("num_envs = 7", 23.5 * GIB)


@pytest.mark.parametrize("arguments", [{}, {"model": "rfem"}])
def test_too_many_rows_are_refused(monkeypatch: pytest.MonkeyPatch, arguments: dict[str, Any]) -> None:
    monkeypatch.setattr(memory, "machine_memory", lambda: 16 * GIB)
    with pytest.raises(
        InvalidValue, match=r"^num_envs = 16777216: needs [\d.]+ GiB of memory: the machine has 16 GiB$"
    ):
        AFrameHeaveVectorEnv(2**24, **arguments)


@pytest.mark.parametrize(
    "build",
    [lambda: Engine(20_000, 0.1), lambda: FlexibleEngine(1000, 0.1, Mesh(Division(leg=2, beam=2)))],
    ids=["simplified", "full model"],
)
def test_rows_take_what_was_asked_for(asked: list[float], build: Callable[[], Engine]) -> None:
    engine = build()
    frames = engine.frames.nbytes if isinstance(engine, FlexibleEngine) else 0
    assert asked == [engine.blocks.nbytes + frames]


def test_wider_rows_take_what_was_asked_for(asked: list[float]) -> None:
    engine = Engine(10_000, 0.1, components=4)
    before = engine.blocks.nbytes
    asked.clear()
    _, held = peak(lambda: engine._make_room(100))
    assert asked == [before + engine.blocks.nbytes]
    assert held == pytest.approx(engine.blocks.nbytes, rel=0.01)


def test_sensors_take_what_was_asked_for(asked: list[float]) -> None:
    bank, held = peak(lambda: SensorBank(Sensors(delay=10.0), 2000, 0.1))
    assert asked[0] <= held < 1.05 * asked[0]
    assert bank.readings.shape[0] == 2000


def ship(step: float, count: int = 20) -> RecordedMotion:
    times = step * np.arange(count)
    return RecordedMotion(times=times, coordinates=np.outer(np.sin(times / step), np.full(6, 0.1)))


def test_a_records_table_takes_what_was_asked_for(asked: list[float]) -> None:
    motion = ship(1000.0)
    table, held = peak(lambda: motion.table(0.1))
    assert asked == [2 * table.nbytes]
    assert asked[0] <= held < 1.2 * asked[0]


def test_a_slow_record_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "machine_memory", lambda: 4 * GIB)
    with pytest.raises(InvalidValue, match=r"^1.9e\+06 s of recorded motion at steps of 0.1 s: needs 5.1 GiB"):
        ship(1e5).table(0.1)
    with pytest.raises(InvalidValue, match=r"GiB: must be at most 2e\+06 s"):
        ship(1e7).table(0.1)


def test_records_side_by_side_take_what_was_asked_for(asked: list[float]) -> None:
    engine = Engine(2, 0.1)
    engine.reset_row(0, Scenario(motion=ship(100.0)))
    first = engine.records.nbytes
    asked.clear()
    engine.reset_row(1, Scenario(motion=ship(101.0)))
    lines = engine.records.shape[0] * 144
    assert asked[-1] == first + lines + ship(101.0).table(0.1).nbytes


def test_episodes_take_what_was_asked_for(asked: list[float]) -> None:
    episodes = run(DrumStill(), [Scenario.paper()] * 3, TaskConfig(episode_duration=2.0))
    assert asked[-1] == episodes.error.nbytes + episodes.drum_speed.nbytes + episodes.tension.nbytes


@pytest.mark.parametrize("learner", ["sac", "ppo"])
def test_a_learners_memory_is_what_was_asked_for(monkeypatch: pytest.MonkeyPatch, learner: str) -> None:
    pytest.importorskip("stable_baselines3")
    import importlib

    module = importlib.import_module(f"train.learn.{learner}")
    sizes: list[float] = []
    monkeypatch.setattr(module, "require_memory", lambda what, size: sizes.append(size))
    some = {"replay": 1000} if learner == "sac" else {"n_steps": 32, "batch_size": 48}
    options = module.Options(n_envs=3, **some)
    module.SPEC.check(options)
    model: Any = module.build(options).model
    buffer = model.replay_buffer if learner == "sac" else model.rollout_buffer
    assert sizes == [sum(each.nbytes for each in vars(buffer).values() if isinstance(each, np.ndarray))]
