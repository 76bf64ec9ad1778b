"""The load under a hard-driven drum in a rough sea, against SciPy's DOP853 on the same equations."""

from __future__ import annotations

import numpy as np
import oracle
import pytest
from test_simplified_model import expected, run

from aframe_env import Crane, Rope, Scenario, Sea, SeaMotion, Winch
from aframe_env.dynamics.load import last_tension
from aframe_env.dynamics.winch import middle_speed

WINCH = Winch(max_rope_length=4000.0)


def rough(length: float, mass: float, damping: float, seed: int) -> Scenario:
    """A load on ``length`` m of rope under a ship in waves of 6 m."""
    crane = Crane(winch=WINCH, rope=Rope(breaking_load=1e9))
    return Scenario(
        crane=crane,
        motion=SeaMotion(sea=Sea(hs=6.0, tp=9.0, heading=2.5, seed=seed)),
        load_mass=mass,
        target_level=crane.pulley_position[2] - length,
        rope_damping=damping,
    )


def hard(seed: int, steps: int = 600) -> oracle.FloatArray:
    """Commands (steps,) rad/s: half of them one of the limits, the others anywhere, and beyond."""
    rng = np.random.default_rng(seed)
    anywhere, limits = rng.uniform(-1.2, 1.2, steps), np.sign(rng.normal(size=steps))
    return WINCH.max_speed * np.where(rng.random(steps) < 0.5, anywhere, limits)


@pytest.mark.parametrize("damping", [1e5, 3e5])
@pytest.mark.parametrize("length", [300.0, 1000.0, 2950.0])
def test_load_under_a_moving_drum(length: float, damping: float) -> None:
    scenario, commands = rough(length, 1e5, damping, 4), hard(4)
    got, want = run(scenario, commands), expected(scenario, commands)
    assert not got[:, 8].any()  # taut throughout
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-5


@pytest.mark.parametrize(
    ("length", "mass", "damping", "seed"), [(300.0, 2e4, 3e3, 5), (1000.0, 1e5, 0.0, 1), (2950.0, 1e5, 0.0, 6)]
)
def test_load_under_a_moving_drum_through_slack(length: float, mass: float, damping: float, seed: int) -> None:
    scenario, commands = rough(length, mass, damping, seed), hard(seed)
    got, want = run(scenario, commands), expected(scenario, commands)
    assert np.count_nonzero(np.diff(got[:, 8]) == 1.0) >= 2
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-3


@pytest.mark.parametrize("kink", [0.0, 0.1, 0.5, 0.8, 1.0])
def test_middle_speed_gives_the_turn(kink: float) -> None:
    """A ramp of 2 rad/s² that ends at ``kink`` of a step of 0.02 s."""
    h, speed = 0.02, 0.3
    ramp = kink * h
    turn, end = speed * h + 2.0 * ramp * (h - 0.5 * ramp), speed + 2.0 * ramp
    middle = middle_speed(5.0, speed, 5.0 + turn, end, h)
    assert h / 6.0 * (speed + 4.0 * middle + end) == pytest.approx(turn, rel=1e-12)
    if kink in (0.0, 1.0):  # the speed itself
        assert middle == pytest.approx(speed + ramp, rel=1e-9)


@pytest.mark.parametrize("pulls", [(1.0, 0.4, -0.2), (-0.3, 0.2, 0.9), (2.0, 0.1, -1.0), (-1.0, -0.7, 0.1)])
def test_last_tension_gives_the_impulse(pulls: tuple[float, float, float]) -> None:
    """Against a fine sum over the parabola; where it crosses zero is known to first order in its bend."""
    first, middle, last = pulls
    x = (np.arange(100_000) + 0.5) / 100_000
    bend = 2.0 * (first - 2.0 * middle + last)
    pull = first + (last - first) * x + bend * x * (x - 1.0)
    felt = max(first, 0.0) + 4.0 * max(middle, 0.0) + last_tension(first, middle, middle, last)
    assert felt / 6.0 == pytest.approx(np.maximum(pull, 0.0).mean(), abs=1e-6 + bend**2 / (16.0 * abs(last - first)))
    assert last_tension(1.0, 2.0, 2.0, 3.0) == 3.0
    assert last_tension(-1.0, -2.0, -2.0, -3.0) == 0.0
