"""Ropes with mass and loads in water against closed forms, and side by side.

Reference cases, statics, frequencies, responses and energy are checks of ``train.verify`` and tested there.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from aframe_env import (
    Crane,
    Harmonic,
    HarmonicMotion,
    InvalidValue,
    LoadShape,
    Rope,
    Scenario,
    Sea,
    SeaMotion,
    Water,
    Winch,
)
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from train.verify.rope_checks import steel_load

FloatArray = npt.NDArray[np.float64]
MU, G, RHO = 19.55, 9.81, 1025.0
LONG_WINCH = Winch(max_rope_length=6000.0, max_rope_speed=10.0)


def test_pendulum() -> None:
    scenario = steel_load(1000.0, 5e4, rope=Rope.six_strand(loss_time=0.1))
    added = 3e4
    scenario = replace(scenario, load=replace(scenario.load, added_mass_horizontal=added))
    engine = Engine(1, 0.1)
    row = engine.row_vector(scenario)
    row[at.LOAD_POSITION] += 5.0
    engine.write_row(0, row)
    track = []
    for _ in range(3000):
        engine.step(np.zeros(1))
        track.append(engine.read(at.LOAD_POSITION)[0] - scenario.crane.pulley_position[0])
    x = np.array(track)
    crossings = np.nonzero(x[:-1] * x[1:] < 0.0)[0]
    times = 0.1 * (crossings + x[crossings] / (x[crossings] - x[crossings + 1]))
    # A rod with an end mass, of the stretched length, about the pulley.
    length, w = scenario.rope_length, scenario.rope_weight
    inertia, lever = 5e4 + added + MU * 1000.0 / 3.0, scenario.weight + 0.5 * w * 1000.0
    assert 2.0 * np.diff(times).mean() == pytest.approx(2.0 * math.pi * math.sqrt(inertia * length / lever), rel=1e-3)


def drift(scenario: Scenario, seconds: int) -> FloatArray:
    """Where the load hangs from the pulley's plumb line in the end, x and y, m."""
    engine = Engine(1, 0.2)
    row = engine.row_vector(scenario)
    engine.write_row(0, row)
    found = []
    for _ in range(5 * seconds):
        engine.step(np.zeros(1))
        found.append(engine.read_many(at.LOAD_POSITION, 2)[0] - engine.read_many(at.PULLEY, 2)[0])
    # The mean of the last periods of a swing that dies away slowly.
    return np.asarray(found[len(found) // 2 :]).mean(axis=0)


@pytest.mark.parametrize("below", [60.0, 1000.0])
def test_drift_in_a_current(below: float) -> None:
    current = ((0.0, 0.3, -0.4),)
    load = LoadShape(volume=6.4, drag_area_horizontal=30.0)
    scenario = steel_load(below, 5e4, load=load, water=Water(current=current))
    # Drags on load and rope turn the straight rope about the pulley until weight does as much the other way.
    push = 0.5 * RHO * 0.5**2 * (30.0 + 1.2 * 0.07 * below * 0.5)
    expected = scenario.rope_length * push / (scenario.weight + 0.5 * scenario.rope_weight * below)
    assert drift(scenario, 3000) == pytest.approx(expected * np.array([0.6, -0.8]), rel=5e-3)


def test_current_is_that_of_its_depth() -> None:
    """Drag of the rope under a current of the upper water alone, by the integral of lever and velocity squared."""
    current = ((0.0, 1.0, 0.0), (400.0, 1.0, 0.0), (401.0, 0.0, 0.0))
    rope = Rope.six_strand(mass_per_length=19.55)
    scenario = steel_load(1000.0, 5e4, rope=rope, water=Water(current=current, surface_level=0.0))
    engine = Engine(1, 0.1)
    engine.reset_row(0, scenario)
    engine.step(np.zeros(1))
    pieces = (np.arange(9) + 0.5) / 9.0
    depths = pieces * scenario.rope_length - scenario.crane.pulley_position[2]
    per_metre = 0.5 * RHO * 1.2 * 0.07
    expected = per_metre * scenario.rope_length / 9.0 * pieces[depths < 400.0].sum()
    assert engine.read(at.PUSH)[0] == pytest.approx(expected, rel=1e-3)
    assert engine.read_many(at.FLOW, 2)[0] == pytest.approx([0.0, 0.0])


def test_fall_reaches_terminal_velocity() -> None:
    load = LoadShape(volume=2.0, added_mass_vertical=1e4, drag_area_vertical=12.0)
    scenario = steel_load(60.0, 2e4, load=load, rope=Rope())
    engine = Engine(1, 0.1)
    row = engine.row_vector(scenario)
    row[at.PARTED] = 1.0
    engine.write_row(0, row)
    for _ in range(600):
        engine.step(np.zeros(1))
    terminal = math.sqrt(scenario.weight / (0.5 * RHO * 12.0))
    assert engine.read(at.LOAD_VELOCITY + 2)[0] == pytest.approx(-terminal, rel=1e-3)


def mixed() -> list[Scenario]:
    motion = SeaMotion(sea=Sea(hs=5.0, tp=7.0, seed=2))
    shape = LoadShape(volume=1.0, added_mass_vertical=2e4, added_mass_horizontal=5e3, drag_area_vertical=20.0)
    shape = replace(shape, drag_area_horizontal=9.0)
    found = []
    for length, mass in ((60.0, 5e3), (120.0, 2e3), (300.0, 1e5), (700.0, 3e3), (2900.0, 1.5e3), (2900.0, 3e5)):
        for water, load in ((None, LoadShape()), (Water(current=((5.0, 0.5, 0.1), (90.0, -0.2, 0.3))), shape)):
            crane = Crane(rope=Rope.six_strand(breaking_load=6e6), winch=LONG_WINCH)
            found.append(
                Scenario(
                    crane=crane, motion=motion, load_mass=mass, target_level=-length, water=water, load=load, ramp=2.0
                )
            )
    return [*found, replace(Scenario.paper(), motion=motion), Scenario.paper()]


@pytest.mark.parametrize("kinds", ["mixed", "all with mass"])
def test_rows_side_by_side_are_rows_alone(kinds: str) -> None:
    scenarios = mixed() if kinds == "mixed" else mixed()[:-2]
    commands = np.random.default_rng(1).uniform(-3.0, 3.0, (60, len(scenarios)))
    many = Engine(len(scenarios), 0.1)
    alone = [Engine(1, 0.1) for _ in scenarios]
    for i, scenario in enumerate(scenarios):
        many.reset_row(i, scenario)
        alone[i].reset_row(0, scenario)
    slots = (at.LIFT, at.LIFT_SIZE), (at.OMEGA1, 4), (at.PEAK_TENSION, 1), (at.LOAD_TENSION, 1), (at.SLACK, 3)
    for command in commands:
        many.step(command)
        for i, engine in enumerate(alone):
            engine.step(command[i : i + 1])
        for slot, size in slots:
            side_by_side = many.read_many(slot, size)
            assert np.isfinite(side_by_side).all()
            for i, engine in enumerate(alone):
                assert side_by_side[i].tobytes() == engine.read_many(slot, size)[0].tobytes(), (i, slot)


def test_light_load_goes_slack_and_snaps() -> None:
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=4.0, period=6.0),))
    load = LoadShape(volume=0.1, added_mass_vertical=2e4, drag_area_vertical=40.0)
    scenario = steel_load(200.0, 2e3, motion=motion, load=load, ramp=6.0)
    engine = Engine(1, 0.1)
    engine.reset_row(0, scenario)
    slack, tensions = [], []
    for _ in range(300):
        engine.step(np.zeros(1))
        slack.append(engine.read(at.SLACK)[0])
        tensions.append(engine.read(at.PEAK_TENSION)[0])
    assert 0.1 < np.mean(slack) < 0.9
    assert max(tensions) > 4.0 * scenario.hanging_weight
    assert min(tensions) >= 0.0


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Water(density=100.0), r"density = 100.0 kg/m³: must be in \[900, 1300\] kg/m³"),
        (lambda: Water(current=((0.0, 9.0, 0.0),)), r"current\[0\] velocity = 9.0 m/s: must be in \[-5, 5\] m/s"),
        (
            lambda: Water(current=((10.0, 1.0, 0.0), (5.0, 1.0, 0.0))),
            r"current\[1\] depth = 5.0 m, each deeper by 1 m: must be in \[11, 12000\]",
        ),
        (lambda: LoadShape(volume=-1.0), r"volume = -1.0 m³: must be in \[0, 10000\] m³"),
        (lambda: Rope(mass_per_length=2e3), r"mass_per_length = 2000.0 kg/m: must be 0, or in \[0.001, 1000\] kg/m"),
        (lambda: steel_load(300.0, 1e4, load=LoadShape(volume=20.0)), r"volume = 20.0 m³: a load of 10000 kg floats"),
        (lambda: steel_load(300.0, 1e4, water=None), "goes with water"),
        (
            lambda: steel_load(300.0, 1e4, rope=Rope(mass_per_length=1.0, solid_diameter=0.056)),
            r"solid_diameter = 0.056 m: the rope floats.*must be at most 0.035",
        ),
        (
            lambda: steel_load(3000.0, 1e5, rope=Rope.six_strand(breaking_load=1e6)),
            r"target_level.*a rope that weighs 167.\d+ N/m would bear 1.1\d+e\+06 N .*must be below 1e\+06 N",
        ),
        (
            lambda: steel_load(300.0, 1e4, rope=Rope(mass_per_length=0.06, axial_stiffness=1e12)),
            "mass_per_length = 0.06 kg/m: the waves in the rope",
        ),
    ],
)
def test_bad_input_is_named(build, words) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidValue, match=words):
        build()
