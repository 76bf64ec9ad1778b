"""The winch against a fine integration of its differential equation, and closed forms."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import Crane, HarmonicMotion, Scenario, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine

PERIOD = 0.1
FINE = 4000


def brute(winch: Winch, free_length: float, commands: Sequence[float]) -> npt.NDArray[np.float64]:
    """Angle and speed at the end of each control step, by fine integration of the speed's differential
    equation.

    v' = (command - v) / lag, or towards the command, within the limit of acceleration. Within a control step
    the drive runs on unseen while the brake holds the drum at a limit switch; the next step begins from rest.
    """
    radius = winch.drum_diameter / 2
    fastest, hardest = winch.max_rope_speed / radius, winch.max_rope_acceleration / radius
    low = (winch.min_rope_length - free_length) / radius
    high = (winch.max_rope_length - free_length) / radius
    angle = speed = 0.0
    out = []
    h = PERIOD / FINE
    for command in np.clip(commands, -fastest, fastest):
        for _ in range(FINE):
            gap = command - speed
            # Half-implicit: the mean of the slope at both ends, cut to the limit.
            if winch.lag:
                slope = gap / (winch.lag + h / 2)
                slope = min(max(slope, -hardest), hardest)
            else:
                slope = min(max(gap / h, -hardest), hardest)
            angle += h * (speed + 0.5 * h * slope)
            speed += h * slope
        if angle <= low:
            angle, speed = low, max(speed, 0.0)
        if angle >= high:
            angle, speed = high, min(speed, 0.0)
        out.append((angle, speed))
    return np.array(out)


def engine_run(winch: Winch, commands: Sequence[float]) -> tuple[float, npt.NDArray[np.float64]]:
    """Free rope length, and the drum's angle and speed after each control step."""
    scenario = Scenario(crane=Crane(winch=winch), motion=HarmonicMotion())
    engine = Engine(1, PERIOD)
    engine.reset_row(0, scenario)
    out = []
    for command in commands:
        engine.step(np.array([command]))
        out.append((engine.read(at.DRUM_ANGLE)[0], engine.read(at.DRUM_SPEED)[0]))
    return scenario.free_length, np.array(out)


@settings(max_examples=30, deadline=None)
@given(
    commands=st.lists(st.floats(-6.0, 6.0), min_size=1, max_size=8),
    lag=st.sampled_from([0.0, 0.02, 0.3, 2.0]),
    acceleration=st.sampled_from([0.5, 2.0, 20.0]),
    speed=st.sampled_from([0.5, 3.0]),
)
def test_winch_follows_its_command(commands: list[float], lag: float, acceleration: float, speed: float) -> None:
    winch = Winch(lag=lag, max_rope_acceleration=acceleration, max_rope_speed=speed)
    free_length, got = engine_run(winch, commands)
    want = brute(winch, free_length, commands)
    assert np.abs(got - want).max() < 1e-3 * max(1.0, acceleration / 2)
    assert np.abs(got[:, 0] - want[:, 0]).max() < 1e-4 * max(1.0, acceleration / 2)
    assert np.abs(got[:, 1]).max() <= speed / 0.75 + 1e-12
    assert np.abs(np.diff(got[:, 1], prepend=0.0)).max() <= acceleration / 0.75 * PERIOD + 1e-12


@settings(max_examples=20, deadline=None)
@given(
    commands=st.lists(st.floats(-4.0, 4.0), min_size=4, max_size=12),
    lag=st.sampled_from([0.0, 0.3]),
    room=st.floats(0.01, 0.3),
)
def test_limit_switches_hold_the_drum(commands: list[float], lag: float, room: float) -> None:
    length = Scenario.paper().free_length
    winch = Winch(lag=lag, min_rope_length=length - room, max_rope_length=length + room)
    free_length, got = engine_run(winch, commands)
    want = brute(winch, free_length, commands)
    assert np.abs(got - want).max() < 1e-3
    assert np.abs(got[:, 0]).max() <= room / 0.75 + 1e-12


def test_speed_at_the_limit_switch_is_zero() -> None:
    length = Scenario.paper().free_length
    winch = Winch(max_rope_length=length + 0.5)
    _, got = engine_run(winch, [4.0] * 20 + [-1.0] * 5)
    assert got[19] == pytest.approx([0.5 / 0.75, 0.0], abs=1e-12)
    assert got[24, 1] == pytest.approx(-1.0, abs=1e-12)


def test_lag_is_first_order() -> None:
    """Far from the limits a step in the command is answered by 1 - exp(-t / lag)."""
    winch = Winch(lag=0.5, max_rope_acceleration=1e3)
    _, got = engine_run(winch, [1.0] * 20)
    t = PERIOD * np.arange(1, 21)
    # Until the error is a·lag the acceleration is limited: with a = 1333 rad/s² nowhere.
    np.testing.assert_allclose(got[:, 1], 1 - np.exp(-t / 0.5), rtol=1e-12)
    np.testing.assert_allclose(got[:, 0], t - 0.5 * (1 - np.exp(-t / 0.5)), rtol=1e-11)


def test_drum_without_lag_ramps() -> None:
    _, got = engine_run(Winch(), [4.0] * 20)
    a, t = 2.0 / 0.75, PERIOD * np.arange(1, 21)
    ramp = 4.0 / a
    want = np.where(t < ramp, a * t**2 / 2, 4.0 * t - 4.0 * ramp / 2)
    np.testing.assert_allclose(got[:, 0], want, rtol=1e-12)
    assert math.isclose(got[-1, 1], 4.0, rel_tol=1e-14)
