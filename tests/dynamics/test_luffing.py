"""A frame that luffs, against SciPy on kinematics written here, statics, and the bits of rows alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import oracle
import pytest
from scipy.optimize import brentq

from aframe_env import (
    Crane,
    Frame,
    HarmonicMotion,
    InvalidValue,
    LoadShape,
    Luffing,
    Rope,
    Scenario,
    Sea,
    SeaMotion,
    Water,
    Winch,
)
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.env import AFrameHeaveEnv

INBOARD, OUTBOARD = math.radians(-40.0), math.radians(25.0)
CRANE = Crane(frame=Frame(luffing_angle=INBOARD), winch=Winch(min_rope_length=5.0))
QUICK = Luffing(points=((3.0, INBOARD), (43.0, OUTBOARD), (60.0, math.radians(10.0))), max_speed=0.3)


def smoothstep(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def angle_of(scenario: Scenario) -> Callable[[float], float]:
    """Luffing angle over time, by the triangle of foot, N and C, solved with brentq."""
    frame, luffing = scenario.crane.frame, scenario.luffing
    assert luffing is not None

    def length(angle: float) -> float:
        x, z = frame.servomotor_height * math.sin(angle), frame.servomotor_height * math.cos(angle)
        return math.hypot(x - frame.servomotor_deck_x, z)

    def at(t: float) -> float:
        wanted = length(luffing.points[0][1])
        for (t0, a0), (t1, a1) in zip(luffing.points, luffing.points[1:], strict=False):
            wanted += (length(a1) - length(a0)) * smoothstep((t - t0) / (t1 - t0))
        return float(brentq(lambda angle: length(angle) - wanted, -1.5, 1.5, xtol=1e-15, rtol=1e-15))

    return at


def tip_of(scenario: Scenario) -> Callable[[float], oracle.FloatArray]:
    """Position and velocity of the pulley in the base frame, the velocity by differences."""
    angle, height = angle_of(scenario), scenario.crane.frame.height
    deck = oracle.of_components(scenario.motion.components())

    def place(t: float) -> oracle.FloatArray:
        phi = angle(t)
        return oracle.pulley(deck, (height * math.sin(phi), 0.0, height * math.cos(phi)))(t)[:3]

    def at(t: float) -> oracle.FloatArray:
        h = 1e-3
        slope = (8.0 * (place(t + h) - place(t - h)) - (place(t + 2 * h) - place(t - 2 * h))) / (12.0 * h)
        return np.concatenate([place(t), slope])

    return at


def reach_of(scenario: Scenario) -> Callable[[float], tuple[float, float]]:
    angle, frame, drum = angle_of(scenario), scenario.crane.frame, scenario.crane.drum_position

    def reach(t: float) -> float:
        phi = angle(t)
        return math.dist((frame.height * math.sin(phi), 0.0, frame.height * math.cos(phi)), drum)

    def at(t: float) -> tuple[float, float]:
        h = 1e-3
        return reach(t), (8.0 * (reach(t + h) - reach(t - h)) - (reach(t + 2 * h) - reach(t - 2 * h))) / (12.0 * h)

    return at


def run(
    scenarios: list[Scenario],
    commands: oracle.FloatArray,
    row: int = 0,
    period: float = 0.1,
    max_inner_step: float | None = None,
) -> oracle.FloatArray:
    """Load position and velocity, Ω1, tension and luffing angle (T + 1, 9) of a row."""
    engine = Engine(len(scenarios), period, max_inner_step=max_inner_step)
    for index, scenario in enumerate(scenarios):
        engine.reset_row(index, scenario)
    slots = [*range(at.LOAD_POSITION, at.LOAD_POSITION + 6), at.OMEGA1, at.TENSION, at.LUFFING_ANGLE]
    out = [[engine.read(slot)[row] for slot in slots]]
    for command in commands:
        engine.step(np.full(len(scenarios), command))
        out.append([engine.read(slot)[row] for slot in slots])
    return np.array(out)


@pytest.mark.parametrize(
    "changes",
    [{}, {"target_level": -20.0, "rope_damping": 3e4, "crane": replace(CRANE, drum_position=(-6.0, 2.0, 3.0))}],
    ids=["deep", "damped, close under the pulley"],
)
def test_load_under_luffing_frame_moves_as_by_independent_integration(changes: dict[str, object]) -> None:
    scenario = Scenario(
        **{"crane": CRANE, "target_level": -60.0, "motion": oracle.SixDofMotion(2), "luffing": QUICK, **changes}  # type: ignore[arg-type]
    )
    commands = 0.25 * np.sin(0.7 * np.arange(700) * 0.1) + 0.05
    # Finer than by default, which leaves 26 µm of a load that bobs undamped on 60 m, whether the frame luffs or not.
    found = run([scenario], commands, max_inner_step=0.005)
    radius = 0.5 * scenario.crane.winch.drum_diameter
    drum, kinks = oracle.winch(commands, 0.1, 3.0 / radius, 2.0 / radius)
    times = np.arange(701) * 0.1
    tip, reach = tip_of(scenario), reach_of(scenario)
    expected = oracle.solve(scenario, times, tip, drum, breaks=[*kinks, 3.0, 43.0, 60.0], reach=reach)
    assert np.abs(found[:, :3] - expected[:, :3]).max() < 1e-6
    tensions = [oracle.forces(t, y, scenario, tip, drum, reach)[0] for t, y in zip(times, expected, strict=True)]
    assert np.abs(found[:, 7] - tensions).max() < 1e-5 * max(tensions)
    assert found[:, 8] == pytest.approx([angle_of(scenario)(t) for t in times], abs=1e-9)


@pytest.mark.parametrize(("rope", "level"), [(Rope(), -60.0), (Rope.six_strand(), -60.0), (Rope.six_strand(), -700.0)])
def test_load_hangs_as_statics_have_it_after_a_slow_swing(rope: Rope, level: float) -> None:
    scenario = Scenario(
        crane=replace(CRANE, rope=rope),
        target_level=level,
        motion=HarmonicMotion(),
        luffing=Luffing.swing(INBOARD, OUTBOARD, 0.0, 400.0),
        water=Water(surface_level=0.0),
        load=LoadShape(volume=5.0, drag_area_vertical=30.0, drag_area_horizontal=30.0),
    )
    after = replace(CRANE, rope=rope, frame=Frame(luffing_angle=OUTBOARD))

    def rope_out(hanging: float) -> float:
        """Unstretched rope that holds the load at a level under the frame as it is in the end."""
        lifted = replace(scenario, crane=after, luffing=None, target_level=hanging)
        return lifted.free_length - scenario.free_length

    hangs = float(brentq(rope_out, level - 10.0, level + 10.0))
    assert abs(hangs - level) > 0.1
    last = run([scenario], np.zeros(900), period=0.5)[-1]
    assert last[2] == pytest.approx(hangs, abs=1e-3)
    assert last[0] == pytest.approx(after.pulley_position[0], abs=0.05)


def test_rows_side_by_side_have_the_bits_of_rows_alone() -> None:
    rope = Rope.six_strand()
    luffing = Scenario(crane=CRANE, target_level=-60.0, motion=oracle.SixDofMotion(2), luffing=QUICK)
    others = [
        Scenario.paper(),
        replace(luffing, crane=replace(CRANE, rope=rope), target_level=-600.0),
        Scenario(crane=Crane(rope=rope), target_level=-300.0),
        luffing,
    ]
    commands = np.linspace(-0.2, 0.3, 80)
    for row, scenario in enumerate(others):
        assert np.array_equal(run(others, commands, row), run([scenario], commands))


def test_kinematics_are_derivatives_of_each_other_and_lengths_those_of_the_triangle() -> None:
    scenario = Scenario(crane=CRANE, target_level=-60.0, luffing=QUICK)
    times = np.linspace(0.0, 62.0, 62001)
    found = QUICK.at(CRANE.frame, times)
    assert found.angle[::1000] == pytest.approx([angle_of(scenario)(t) for t in times[::1000]], abs=1e-12)
    for value, rate, bend in (found[:3], found[3:]):
        assert np.gradient(value, times, axis=0)[1:-1] == pytest.approx(rate[1:-1], abs=1e-8)
        assert np.gradient(rate, times, axis=0)[1:-1] == pytest.approx(bend[1:-1], abs=1e-4)
    lengths = np.hypot(4.8 * np.sin(found.angle) + 5.0, 4.8 * np.cos(found.angle))
    speed = np.abs(np.gradient(lengths, times))
    with pytest.raises(InvalidValue, match=f"peak speed of {speed.max():.3g} m/s: must be at most 0.15 m/s"):
        Scenario(crane=CRANE, target_level=-60.0, luffing=Luffing(points=QUICK.points))


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (
            ((0.0, 0.0), (60.0, OUTBOARD)),
            "points\\[0\\] angle = 0.0 rad: must be -0.69.* rad, the frame's luffing_angle",
        ),
        (((0.0, INBOARD), (60.0, 1.4)), "points\\[1\\] angle = 1.4 rad: must be in \\[-1.39626, 1.39626\\] rad"),
        (((5.0, INBOARD), (4.0, OUTBOARD)), "points\\[1\\] time = 4.0 s: must be in \\[5.1, 1e\\+06\\] s"),
        (((0.0, INBOARD),), "must be a tuple of 2 to 16 points"),
        (((0.0, INBOARD), (400.0, 1.3)), "target_level = 5.0 m: must be below the pulley, in \\(-inf, 3.20"),
    ],
)
def test_ways_that_cannot_be_are_refused(points: tuple[tuple[float, float], ...], message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        Scenario(crane=CRANE, target_level=5.0, luffing=Luffing(points=points))


def test_waves_about_the_load_are_those_where_the_pulley_has_got_to() -> None:
    sea = SeaMotion(sea=Sea(hs=2.0, tp=7.0, heading=2.5, seed=1))
    swing = Luffing.swing(INBOARD, OUTBOARD, 1.0, 30.0, max_speed=0.3)
    scenario = Scenario(
        crane=CRANE,
        target_level=-20.0,
        motion=sea,
        luffing=swing,
        water=Water(surface_level=-5.0),
        load=LoadShape(volume=5.0, added_mass_vertical=5e3, drag_area_vertical=10.0),
    )
    engine = Engine(1, 0.1)
    engine.reset_row(0, scenario)
    for _ in range(200):
        level = engine.read(at.LOAD_POSITION + 2)[0]
        engine.step(np.zeros(1))
    time = 19.9
    out = 12.0 * math.sin(angle_of(scenario)(time))
    elevation, _ = sea.waves_under(out, 0.0, 9.81)
    frequency = sea.sea.waves().frequency
    turned = elevation * np.exp(1j * frequency * time)
    assert engine.read(at.SURFACE)[0] == pytest.approx(-5.0 + turned.real.sum(), abs=1e-6)
    upwards = -(frequency * np.exp(-(frequency**2) / 9.81 * (-5.0 - level)) * turned.imag).sum()
    assert engine.read(at.FLOW + 2)[0] == pytest.approx(upwards, abs=1e-6)


def test_information_tells_angle_and_pulley_and_the_picture_shows_them() -> None:
    scenario = Scenario(crane=CRANE, target_level=-20.0, motion=HarmonicMotion(), luffing=QUICK)
    env = AFrameHeaveEnv(scenario=scenario, episode_duration=65.0, render_mode="rgb_array")
    _, info = env.reset(seed=0)
    assert info["luffing_angle"] == pytest.approx(INBOARD, abs=1e-12)
    before = env.render()
    for _ in range(450):
        *_, info = env.step(np.zeros(1, dtype=np.float32))
    assert info["luffing_angle"] == pytest.approx(OUTBOARD, abs=0.01)
    place = 12.0 * np.array([math.sin(info["luffing_angle"]), 0.0, math.cos(info["luffing_angle"])])
    assert info["pulley_position"] == pytest.approx(place, abs=1e-9)
    assert np.any(before != env.render())
