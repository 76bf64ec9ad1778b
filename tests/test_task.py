"""The task: what a lost load costs."""

from __future__ import annotations

import inspect
import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import Crane, HarmonicMotion, Rope, Scenario, ScenarioDistribution, task
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.env import AFrameHeaveEnv
from aframe_env.task import LEAST_FALL, SENSED, STATE, Quantity, free_fall_cost, free_fall_peak

GRAVITY = 9.81
UNBREAKABLE = 1e12


def fall(error: float, velocity: float) -> np.polynomial.Polynomial:
    """Error over time of a load that falls freely."""
    return np.polynomial.Polynomial([error, velocity, -0.5 * GRAVITY])


@settings(max_examples=200, deadline=None)
@given(error=st.floats(-20.0, 20.0), velocity=st.floats(-20.0, 20.0), duration=st.floats(0.0, 60.0))
def test_cost_and_peak_of_a_free_fall(error: float, velocity: float, duration: float) -> None:
    path = fall(error, velocity)
    integral = (path**2).integ()(duration)
    cost = free_fall_cost(error, velocity, GRAVITY, duration)
    assert cost == pytest.approx(integral, rel=1e-9, abs=1e-9)
    # No start makes a fall of so long cheaper than this: the part of g τ²/2 that no e + v τ can cancel.
    assert cost >= GRAVITY**2 * duration**5 / 720.0 * (1 - 1e-9) - 1e-9
    sampled = np.abs(path(np.linspace(0.0, duration, 2001))).max()
    peak = free_fall_peak(error, velocity, GRAVITY, duration)
    rounding = 1e-12 * (1.0 + sampled)
    assert sampled - rounding <= peak <= sampled + GRAVITY * (duration / 2000) ** 2 + rounding


def scenario(seed: int, breaking_load: float) -> Scenario:
    source = ScenarioDistribution(load_mass=1e5, rope_length=(50.0, 300.0), hs=(2.0, 4.0), ramp=1.0)
    drawn = source.draw(np.random.default_rng(seed))
    return replace(drawn, crane=Crane(rope=Rope(breaking_load=breaking_load)))


def commands(seed: int) -> list[np.ndarray]:
    return list(np.random.default_rng(seed).uniform(-4.0, 4.0, (200, 1)).astype(np.float32))


@pytest.mark.parametrize("seed", range(6))
def test_parting_ends_the_episode_at_the_cost_of_the_fall(seed: int) -> None:
    env = AFrameHeaveEnv(scenario=scenario(seed, 1.3e6), episode_duration=20.0)
    env.reset(seed=0)
    total, before, omega2 = 0.0, 0.0, 0.0
    for action in commands(seed):
        _, reward, terminated, truncated, info = env.step(action)
        total += float(reward)
        if terminated:
            break
        before, omega2 = info["omega1"], info["omega2"]
    assert terminated
    assert not truncated
    assert info["rope_tension"] == 0.0
    assert total == pytest.approx(-info["omega1"], rel=1e-12)
    error = info["load_position"][2] - env.scenario.target_level
    velocity = env.simulation.engine.read(at.LOAD_VELOCITY + 2)[0]
    left = max(20.0 - info["time"], LEAST_FALL)
    path = fall(error, velocity)
    cost = (path**2).integ()(left)
    # What is left over is the cost within the step in which the rope parted.
    within = -float(reward) - cost
    assert within + 1e-9 * cost >= 0.0
    assert within <= 0.1 * (max(omega2, abs(error)) + 0.1 * abs(velocity) + 0.1) ** 2 + 1e-9 * cost
    assert info["omega1"] == pytest.approx(before - float(reward), rel=1e-12)
    assert info["omega2"] >= abs(path(left)) * (1.0 - 1e-12)


@pytest.mark.parametrize("seed", range(6))
def test_parted_load_falls_freely_in_the_engine(seed: int) -> None:
    """The charge is what the engine's own integral comes to when it goes on until the episode's end."""
    env = AFrameHeaveEnv(scenario=scenario(seed, 1.3e6), episode_duration=20.0)
    env.reset(seed=0)
    engine = Engine(1, 0.1)
    engine.reset_row(0, env.scenario)
    terminated = False
    for action in commands(seed):
        if not terminated:
            _, _, terminated, _, info = env.step(action)
        engine.step(action.astype(float))
    while engine.read(at.TIME)[0] < info["time"] + LEAST_FALL - 1e-9:
        engine.step(np.zeros(1))
    assert engine.read(at.PARTED)[0] == 1.0
    assert engine.read(at.OMEGA1)[0] == pytest.approx(info["omega1"], rel=1e-6)
    assert engine.read(at.OMEGA2)[0] == pytest.approx(info["omega2"], rel=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_to_lose_the_load_costs_more_than_to_go_on(seed: int) -> None:
    returns = []
    for breaking_load in (1.3e6, UNBREAKABLE):
        env = AFrameHeaveEnv(scenario=scenario(seed, breaking_load), episode_duration=20.0)
        env.reset(seed=0)
        total, steps = 0.0, 0
        for action in commands(seed):
            _, reward, terminated, truncated, _ = env.step(action)
            total, steps = total + float(reward), steps + 1
            if terminated or truncated:
                break
        returns.append(total)
        assert terminated == (breaking_load != UNBREAKABLE)
    assert returns[0] < returns[1]


def test_to_lose_the_load_at_the_very_end_does_not_pay() -> None:
    """Here the load is above its level, so that a short fall would bring it nearer."""
    weak = replace(scenario(0, 1.03e6), target_level=-100.0, rope_damping=5e5)
    for crane in (weak.crane, Crane(rope=Rope(breaking_load=UNBREAKABLE))):
        env = AFrameHeaveEnv(scenario=replace(weak, crane=crane, motion=HarmonicMotion()), episode_duration=5.0)
        env.reset(seed=0)
        total, terminated = 0.0, False
        for step in range(50):
            # Haul in gently, and jerk in the last step.
            _, reward, terminated, _, info = env.step(np.array([-0.05 if step < 49 else -4.0], dtype=np.float32))
            total += float(reward)
        assert info["load_position"][2] > -100.0
        if crane is weak.crane:
            assert terminated
            lost = total
    assert lost < total


def test_rope_parts_at_its_breaking_load() -> None:
    """A rope of little more than the load's weight bears it in a calm, and parts when the drum pulls it up."""
    rope = Rope(breaking_load=1.001e6 * 0.981)
    for drum_speed, parts in ((0.0, False), (-1.0, True)):
        env = AFrameHeaveEnv(scenario=Scenario.paper(motion=HarmonicMotion(), crane=Crane(rope=rope)))
        env.reset(seed=0)
        ends = [env.step(np.array([drum_speed], dtype=np.float32))[2] for _ in range(3)]
        assert any(ends) is parts


def documented(heading: str) -> list[tuple[str, str, str]]:
    """Number, unit and range of each row of the first table after a heading of the environment's docstring."""
    text = inspect.cleandoc(AFrameHeaveEnv.__doc__ or "")
    lines = text[text.index(heading) :].splitlines()
    begin = next(i for i, line in enumerate(lines) if line.startswith("| ---")) + 1
    rows = itertools.takewhile(lambda line: line.startswith("|"), lines[begin:])
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    return [(number, row[-2], row[-1]) for row in cells for number in row[0].split(", ")]


def in_words(low: float, high: float) -> str:
    """A range as the docstring writes it."""
    if low == -high:
        return "±π" if high == np.pi else "±" + plain(high)
    return f"{plain(low)} ... {plain(high)}"


def plain(value: float) -> str:
    return f"{value:.0f}" if value <= 100.0 else f"{value:.0e}".replace("e+0", "e")


@pytest.mark.parametrize(
    ("heading", "quantities"), [('`observation="state"`', STATE), ('`observation="sensors"`', SENSED)]
)
def test_the_docstring_s_tables_are_the_observation(heading: str, quantities: tuple[Quantity, ...]) -> None:
    wanted = [(str(i), q.unit, in_words(q.low, q.high)) for i, q in enumerate(quantities)]
    assert documented(heading) == wanted


def test_columns_have_the_names_of_the_state() -> None:
    for index, quantity in enumerate(STATE):
        assert getattr(task, quantity.name.upper()) == index
