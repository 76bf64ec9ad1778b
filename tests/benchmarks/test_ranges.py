"""The documented ranges are true: a short form of ``python -m benchmarks.ranges``."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.stateful import run_state_machine_as_test

from aframe_env import Crane, Scenario, ScenarioDistribution, Sensors
from aframe_env.config import TaskConfig
from aframe_env.scenario.motion import Harmonic
from aframe_env.scenario.sea import Sea
from benchmarks.ranges.values import intervals, intervals_of

pytest.importorskip("tensordict", reason="needs the extra cuda: tensordict")
from benchmarks.ranges.machine import Rows, Tensors

SHORT = settings(
    max_examples=8,
    stateful_step_count=8,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)


def parts(part: Any) -> list[Any]:
    inner = [getattr(part, each.name) for each in fields(part)]
    return [part, *(deep for each in inner if is_dataclass(each) for deep in parts(each))]


@pytest.mark.parametrize("machine", [Rows, Tensors])
def test_rows_are_alone_what_they_are_among_others(machine: Any) -> None:
    run_state_machine_as_test(machine, settings=SHORT)


@pytest.mark.parametrize(
    "part",
    [
        *parts(Crane()),
        *parts(Sensors()),
        Scenario(),
        Sea(hs=2.0, tp=8.0),
        Harmonic(coordinate="heave", amplitude=1.0, period=8.0),
        TaskConfig(),
    ],
    ids=lambda part: type(part).__name__,
)
def test_every_range_has_two_ends(part: Any) -> None:
    numbers = {each.name for each in fields(part) if each.init and type(getattr(part, each.name)) in (int, float)}
    found = intervals_of(part)
    assert found.keys() == numbers
    assert all(math.isfinite(each.low) and math.isfinite(each.high) for each in found.values())


def test_every_range_of_a_distribution_has_two_ends() -> None:
    found = intervals(ScenarioDistribution, [each.name for each in fields(ScenarioDistribution)])
    assert {"hs", "tp", "heading", "spreading", "load_mass", "rope_length"} <= found.keys()
    assert all(math.isfinite(each.low) and math.isfinite(each.high) for each in found.values())
