"""Kinematics of a point of the deck against SciPy's rotations, the C library and finite differences."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aframe_env import Crane, Scenario
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.transforms import rotate_pair, sine_cosine
from aframe_env.engine import Engine
from aframe_env.scenario.motion import Components


def both(angles: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Sines and cosines (N, 2)."""
    return np.array([sine_cosine(angle) for angle in angles.tolist()])


@pytest.mark.parametrize("size", [1e-6, 1.0, 10.0, 1e3, 1e5])
def test_sine_and_cosine(size: float) -> None:
    rng = np.random.default_rng(int(size) + 1)
    angles = np.concatenate([rng.uniform(-size, size, 20_000), np.linspace(-size, size, 1001)])
    out = both(angles)
    ulp = np.spacing(1.0)
    assert np.abs(out[:, 0] - np.sin(angles)).max() <= 1.5 * ulp
    assert np.abs(out[:, 1] - np.cos(angles)).max() <= 1.5 * ulp
    # Relative to the value itself too, also near the zeros.
    for column, exact in ((0, np.sin(angles)), (1, np.cos(angles))):
        assert (np.abs(out[:, column] - exact) <= 2.0 * np.spacing(np.abs(exact)) + 1e-5 * ulp).all()


def test_sine_and_cosine_at_multiples_of_half_pi() -> None:
    angles = np.arange(-40, 41) * (math.pi / 2)
    out = both(angles)
    np.testing.assert_allclose(out[:, 0], np.sin(angles), rtol=1e-15, atol=1e-21)
    np.testing.assert_allclose(out[:, 1], np.cos(angles), rtol=1e-15, atol=1e-21)


def test_turned_pair_against_differences() -> None:
    """The pair (p, q) = (polynomials) turned by a polynomial angle, with its two derivatives."""
    p, q, a = (np.polynomial.Polynomial(c) for c in ([1, 2, 3], [-2, 1, 0.5], [0.3, 1.5, -2.0]))

    def exact(t: float) -> Any:
        return np.array(
            [
                p(t) * math.cos(a(t)) - q(t) * math.sin(a(t)),
                p(t) * math.sin(a(t)) + q(t) * math.cos(a(t)),
            ]
        )

    one = (1.0, -2.0, 2.0, 1.0, 6.0, 1.0, 0.3, 1.5, -4.0)
    got = np.array(rotate_pair(*one)).reshape(3, 2)
    h = 1e-3
    before, now, after = exact(-h), exact(0.0), exact(h)
    np.testing.assert_allclose(got[0], now, rtol=1e-14)
    np.testing.assert_allclose(got[1], (after - before) / (2 * h), rtol=1e-4)
    np.testing.assert_allclose(got[2], (after - 2 * now + before) / h**2, rtol=1e-4)


class GivenComponents:
    """A motion that is given by its components."""

    def __init__(self, frequency: npt.ArrayLike, response: npt.ArrayLike) -> None:
        self._components = Components(np.asarray(frequency, float), np.asarray(response, complex))

    def components(self) -> Components:
        return self._components


def pulley(motion: GivenComponents, steps: int = 0) -> npt.NDArray[np.float64]:
    """Position, velocity and acceleration (steps + 1, 3, 3) of the pulley."""
    engine = Engine(1, 0.1)
    engine.reset_row(0, Scenario(motion=motion))
    out = [engine.read_many(at.PULLEY, 9)[0]]
    for _ in range(steps):
        engine.step(np.zeros(1))
        out.append(engine.read_many(at.PULLEY, 9)[0])
    return np.array(out).reshape(-1, 3, 3)


POINT = np.array(Crane().pulley_position)
ANGLE = st.floats(-10.0, 10.0)


@settings(max_examples=100, deadline=None)
@given(shift=st.tuples(*[st.floats(-50.0, 50.0)] * 3), roll=ANGLE, pitch=ANGLE, yaw=ANGLE)
def test_pose_is_that_of_eq_38(shift: tuple[float, float, float], roll: float, pitch: float, yaw: float) -> None:
    got = pulley(GivenComponents([1e-12], [[*shift, roll, pitch, yaw]]))[0]
    want = shift + Rotation.from_euler("ZYX", [yaw, pitch, roll]).apply(POINT)
    np.testing.assert_allclose(got[0], want, rtol=0, atol=1e-13 * 60)
    np.testing.assert_allclose(got[1:], 0.0, atol=1e-9)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), tilt=st.floats(0.01, 0.5))
def test_pulley_moves_with_the_deck(seed: int, tilt: float) -> None:
    """Velocity and acceleration of the pulley against differences of its place, under large angles."""
    rng = np.random.default_rng(seed)
    response = (rng.normal(size=(4, 6)) + 1j * rng.normal(size=(4, 6))) * [1, 1, 1, tilt, tilt, tilt]
    motion = GivenComponents(rng.uniform(0.4, 2.0, 4), response)

    def exact(t: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        q = (np.exp(1j * np.outer(t, motion.components().frequency)) @ response).real
        return np.asarray(q[:, :3] + Rotation.from_euler("ZYX", q[:, [5, 4, 3]]).apply(POINT))

    h = 2e-3
    for step, (place, velocity, acceleration) in list(enumerate(pulley(motion, 20)))[::4]:  # at the knots
        x = exact(step * 0.1 + h * np.arange(-2, 3))
        np.testing.assert_allclose(place, x[2], rtol=0, atol=1e-12)
        np.testing.assert_allclose(velocity, (x[0] - 8 * x[1] + 8 * x[3] - x[4]) / (12 * h), atol=1e-7)
        second = (-x[0] + 16 * x[1] - 30 * x[2] + 16 * x[3] - x[4]) / (12 * h**2)
        np.testing.assert_allclose(acceleration, second, atol=1e-5)


@pytest.mark.parametrize(("dof", "place"), [(3, (0, 2, 1)), (4, (2, 1, 0)), (5, (1, 0, 2))])
def test_quarter_turns(dof: int, place: tuple[int, int, int]) -> None:
    """Pitch tips x down, yaw turns x to y, roll turns y to z."""
    response = np.zeros((1, 6))
    response[0, dof] = math.pi / 2
    signs = {3: (1, -1, 1), 4: (1, 1, -1), 5: (-1, 1, 1)}[dof]
    np.testing.assert_allclose(pulley(GivenComponents([1e-9], response))[0, 0], POINT[list(place)] * signs, atol=1e-12)


def test_still_ship() -> None:
    expected = [[5.0714191409, 0.0, 10.8756934444], [0.0] * 3, [0.0] * 3]
    np.testing.assert_allclose(pulley(GivenComponents([], np.zeros((0, 6))))[0], expected, atol=1e-9)
