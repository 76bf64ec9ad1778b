"""Hostile values: whatever is no number in range is refused by the usual sentence."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import Crane, InvalidValue, Scenario, ScenarioDistribution, Sensors
from aframe_env.config import TaskConfig
from aframe_env.env import AFrameHeaveEnv
from aframe_env.scenario.file import scenario_source
from aframe_env.scenario.motion import Harmonic
from aframe_env.scenario.sea import Sea
from aframe_env.validation import (
    require_choice,
    require_integer,
    require_number,
    require_numbers,
    require_vector,
    shown,
)

NO_NUMBERS: list[Any] = [
    *(True, None, "1", b"1", 1j, [1.0], {}, set(), object()),
    *(Decimal(1), Fraction(10**5000, 3), np.bool_(True), np.complex64(1.0), np.float16(1.0), np.longdouble(1.0)),
    *(np.timedelta64(1, "s"), np.datetime64("2020-01-01"), np.str_("1"), np.array(1.0), np.array([1.0]), np.void(b"1")),
]
OUT_OF_RANGE: list[Any] = [
    *(10**400, -(10**400), 10**5000, 2**64, math.nan, math.inf, -math.inf, np.float64(np.nan), np.float32(np.inf)),
    *(1e308, -1.0, np.int8(-1), np.uint64(2**63)),
]
HOSTILE = [*NO_NUMBERS, *OUT_OF_RANGE]


def kind(value: Any) -> str:
    return type(value).__name__


def sentence(call: Callable[[], object]) -> str:
    with pytest.raises(InvalidValue) as caught:
        call()
    said = str(caught.value)
    assert len(said.splitlines()) == 1
    assert len(said) < 400
    return said


@pytest.mark.parametrize("value", HOSTILE, ids=kind)
def test_no_number_passes_for_one(value: Any) -> None:
    said = sentence(lambda: require_number("mass", value, "kg", low=0.0, high=1e7))
    assert said.startswith("mass = ")
    assert said.endswith("in [0, 1e+07] kg")
    assert "in [0, 9]" in sentence(lambda: require_integer("count", value, low=0, high=9))
    assert "kind = " in sentence(lambda: require_choice("kind", value, ("a", "b")))


@pytest.mark.parametrize("value", [1, 1.0, np.float64(1.0), np.float32(1.0), np.int8(1), np.uint64(1)])
def test_numbers_of_numpy_are_numbers(value: Any) -> None:
    require_number("mass", value, "kg", low=0.0, high=1.0)
    require_vector("point", np.array([value, value, value]), "m")
    np.testing.assert_array_equal(require_numbers("actions", [value, value], "rad/s"), [1.0, 1.0])


@pytest.mark.parametrize(
    "value", [None, np.array(3.0), {0: 0, 1: 1, 2: 2}, "abc", (1, 2), np.eye(3), (0, 10**400, 0)], ids=kind
)
def test_no_three_numbers_pass_for_a_vector(value: Any) -> None:
    assert sentence(lambda: require_vector("point", value, "m")).startswith("point")


@pytest.mark.parametrize(
    "value", [[10**400], ["1"], [[1.0], [1.0, 2.0]], [1j], [True], [np.timedelta64(1)], object()], ids=kind
)
def test_no_array_of_something_else_passes_for_numbers(value: Any) -> None:
    assert "must be an array of numbers, rad/s" in sentence(lambda: require_numbers("actions", value, "rad/s"))


def test_what_is_long_is_shown_on_one_short_line() -> None:
    assert shown("a\nb") == repr("a\nb")
    assert shown(np.zeros((3, 2))) == "array([[0., 0.], [0., 0.], [0., 0.]])"
    assert shown(10**400).startswith("1000")
    assert len(shown(10**400)) < 160
    assert shown([10**5000]) == "a list too long to print"


MAKERS: list[Callable[..., object]] = [
    *(Scenario, ScenarioDistribution, Sensors, TaskConfig),
    lambda **values: Sea(**{"hs": 2.0, "tp": 8.0, **values}),
    lambda **values: Harmonic(**{"coordinate": "heave", "amplitude": 1.0, "period": 8.0, **values}),
]
TYPES = [Scenario, ScenarioDistribution, Sensors, TaskConfig, Sea, Harmonic]


def parts_of(value: Any) -> Iterator[Any]:
    """A dataclass and all that lie within it."""
    if dataclasses.is_dataclass(value):
        yield value
        for each in dataclasses.fields(value):
            yield from parts_of(getattr(value, each.name))


def fields_of(type_: Any, make: Callable[..., object]) -> Iterator[Any]:
    for each in dataclasses.fields(type_):
        if each.init and each.name != "max_inner_step":  # the engine refuses it
            yield pytest.param(make, each.name, id=f"{type_.__name__}.{each.name}")


FIELDS = [
    *(param for type_, make in zip(TYPES, MAKERS, strict=True) for param in fields_of(type_, make)),
    *(param for part in parts_of(Crane()) for param in fields_of(type(part), partial(dataclasses.replace, part))),
]


@pytest.mark.parametrize(("make", "name"), FIELDS)
def test_a_hostile_value_in_any_field_is_taken_or_refused_in_one_sentence(
    make: Callable[..., object], name: str
) -> None:
    said = []
    for value in [*HOSTILE, (10**400, 10**400), (1.0, 10**5000), (math.nan, math.nan), [1.0, 2.0]]:
        try:
            make(**{name: value})
        except InvalidValue as error:
            said.append(str(error))
    assert said
    assert all(len(each.splitlines()) == 1 for each in said)


HUGE = st.integers(400, 4200).map(lambda digits: 10**digits)  # Hypothesis cannot print more
JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.floats(), st.text(max_size=5), HUGE),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=5), inner, max_size=3)),
    max_leaves=5,
)
KEYS = ["load_mass", "target_level", "initial", "motion", "crane", "kind", "hs", "records", "sensors", "x"]


@settings(deadline=None, max_examples=200)
@given(data=st.dictionaries(st.sampled_from(KEYS), JSON, max_size=4))
def test_a_mapping_of_anything_is_a_scenario_or_refused(data: dict[str, Any]) -> None:
    with contextlib.suppress(InvalidValue):
        scenario_source(data)


@pytest.mark.parametrize("action", [[10**400], ["1"], np.array([True]), None, object(), 10**400, [math.nan]], ids=kind)
def test_a_hostile_action_is_refused(action: Any) -> None:
    env = AFrameHeaveEnv()
    env.reset(seed=0)
    assert sentence(lambda: env.step(action)).startswith("action")


def test_what_may_be_none_is_zero_or_large_enough_to_count() -> None:
    for value in (0, 0.0, 1e-3, 1e4):
        Scenario(ramp=value)
    assert sentence(lambda: Scenario(ramp=1e-300)) == "ramp = 1e-300 s: must be 0, or in [0.001, 10000] s"
    assert "must be 0, or in [0.001, 10000] s" in sentence(lambda: ScenarioDistribution(ramp=1e-300))
    assert sentence(lambda: Scenario(ramp=False)).startswith("ramp = False: must be 0, or a number in")
