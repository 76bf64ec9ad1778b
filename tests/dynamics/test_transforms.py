import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aframe_env import HarmonicMotion, Scenario
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel
from aframe_env.dynamics.transforms import rotate_pair, sine_cosine
from aframe_env.engine import Engine
from aframe_env.motion import Components


@kernel
def both(angles, out):
    for i in range(angles.shape[0]):
        out[i, 0], out[i, 1] = sine_cosine(angles[i])


@pytest.mark.parametrize("size", [1e-6, 1.0, 10.0, 1e3, 1e5])
def test_sine_and_cosine(size):
    rng = np.random.default_rng(int(size) + 1)
    angles = np.concatenate([rng.uniform(-size, size, 100_000), np.linspace(-size, size, 1001)])
    out = np.empty((len(angles), 2))
    both(angles, out)
    ulp = np.spacing(1.0)
    assert np.abs(out[:, 0] - np.sin(angles)).max() <= 1.5 * ulp
    assert np.abs(out[:, 1] - np.cos(angles)).max() <= 1.5 * ulp
    # Relative to the value itself too, also near the zeros.
    for column, exact in ((0, np.sin(angles)), (1, np.cos(angles))):
        assert (np.abs(out[:, column] - exact) <= 2.0 * np.spacing(np.abs(exact)) + 1e-5 * ulp).all()


def test_sine_and_cosine_at_multiples_of_half_pi():
    angles = np.arange(-40, 41) * (math.pi / 2)
    out = np.empty((len(angles), 2))
    both(angles, out)
    np.testing.assert_allclose(out[:, 0], np.sin(angles), rtol=1e-15, atol=1e-21)
    np.testing.assert_allclose(out[:, 1], np.cos(angles), rtol=1e-15, atol=1e-21)


@kernel
def turn(values):
    return rotate_pair(*values)


def test_turned_pair_against_differences():
    """The pair (p, q) = (polynomials) turned by a polynomial angle, with its two derivatives."""
    p, q, a = (np.polynomial.Polynomial(c) for c in ([1, 2, 3], [-2, 1, 0.5], [0.3, 1.5, -2.0]))

    def exact(t):
        return np.array(
            [
                p(t) * math.cos(a(t)) - q(t) * math.sin(a(t)),
                p(t) * math.sin(a(t)) + q(t) * math.cos(a(t)),
            ]
        )

    one = (1.0, -2.0, 2.0, 1.0, 6.0, 1.0, 0.3, 1.5, -4.0)
    got = np.array(turn(one)).reshape(3, 2)
    h = 1e-3
    before, now, after = exact(-h), exact(0.0), exact(h)
    np.testing.assert_allclose(got[0], now, rtol=1e-14)
    np.testing.assert_allclose(got[1], (after - before) / (2 * h), rtol=1e-4)
    np.testing.assert_allclose(got[2], (after - 2 * now + before) / h**2, rtol=1e-4)


class Rolling:
    """Six-degree-of-freedom motion with large angles."""

    def __init__(self, seed=0):
        rng = np.random.default_rng(seed)
        response = rng.normal(size=(4, 6)) + 1j * rng.normal(size=(4, 6))
        response[:, 3:] *= 0.3
        self._components = Components(rng.uniform(0.4, 2.0, 4), response)

    def components(self):
        return self._components


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_pulley_moves_with_the_deck(seed):
    """Position of the pulley against SciPy's rotation, eq. (38); velocity and acceleration by differences."""
    scenario = Scenario(motion=Rolling(seed))
    components = scenario.motion.components()

    def exact(t):
        q = components.at(t)[0]
        turned = Rotation.from_euler("ZYX", q[:, [5, 4, 3]]).apply(scenario.crane.pulley_position)
        return q[:, :3] + turned

    engine = Engine(1, 0.1)
    engine.reset_row(0, scenario)
    for step in range(50):
        t, h = step * 0.1, 1e-3
        got = engine.read_many(at.PULLEY, 9)[0].reshape(3, 3)
        samples = exact(t + h * np.arange(-2, 3))
        np.testing.assert_allclose(got[0], samples[2], rtol=0, atol=1e-12)
        first = (samples[0] - 8 * samples[1] + 8 * samples[3] - samples[4]) / (12 * h)
        second = (-samples[0] + 16 * samples[1] - 30 * samples[2] + 16 * samples[3] - samples[4]) / (12 * h**2)
        np.testing.assert_allclose(got[1], first, atol=1e-8)
        np.testing.assert_allclose(got[2], second, atol=1e-6)
        engine.step(np.zeros(1))


def test_rotation_order_and_signs():
    """One quarter turn at a time: pitch tips x down, yaw turns x to y, roll turns y to z."""

    class Fixed:
        def __init__(self, dof):
            self.dof = dof

        def components(self):
            response = np.zeros((1, 6), dtype=complex)
            response[0, self.dof] = math.pi / 2
            return Components(np.array([1e-9]), response)

    x, _, z = Scenario.paper().crane.pulley_position
    for dof, place in ((3, (x, -z, 0.0)), (4, (z, 0.0, -x)), (5, (0.0, x, z))):
        engine = Engine(1, 0.1)
        engine.reset_row(0, Scenario(motion=Fixed(dof)))
        np.testing.assert_allclose(engine.read_many(at.PULLEY, 3)[0], place, atol=1e-12)


def test_still_ship():
    engine = Engine(1, 0.1)
    engine.reset_row(0, Scenario(motion=HarmonicMotion()))
    np.testing.assert_allclose(
        engine.read_many(at.PULLEY, 9)[0], [5.0714191409, 0.0, 10.8756934444, 0, 0, 0, 0, 0, 0], atol=1e-9
    )
