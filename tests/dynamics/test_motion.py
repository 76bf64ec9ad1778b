import numpy as np
import pytest

from aframe_env import Harmonic, HarmonicMotion, Scenario, Sea, SeaMotion
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import kernel
from aframe_env.dynamics.motion import on_quintic, quintic, smooth_ramp
from aframe_env.engine import Engine


@kernel
def ramp(time, rate, offset):
    return smooth_ramp(time, rate, offset)


def test_ramp_is_smooth():
    duration = 10.0
    times = np.linspace(0.0, 12.0, 24001)
    values = np.array([ramp(t, 1 / duration, 0.0) for t in times])
    assert values[0] == pytest.approx([0.0, 0.0, 0.0])
    assert values[times >= duration] == pytest.approx(np.tile([1.0, 0.0, 0.0], (4001, 1)), abs=1e-12)
    assert (np.diff(values[:, 0]) >= -1e-15).all()
    # Each column is the derivative of the one before it, also across the end: no jumps in value or first two.
    h = times[1] - times[0]
    for k in range(2):
        central = (values[2:, k] - values[:-2, k]) / (2 * h)
        assert np.abs(central - values[1:-1, k + 1]).max() < (1e-8, 1e-5)[k]
    assert np.abs(np.diff(values[:, 2])).max() < 1e-3


def test_no_ramp():
    assert [ramp(t, 0.0, 1.0) for t in (0.0, 3.0, 1e4)] == [(1.0, 0.0, 0.0)] * 3


def test_ramped_start_is_at_rest():
    engine = Engine(1, 0.1)
    engine.reset_row(0, Scenario(motion=SeaMotion(sea=Sea(hs=4.0, tp=8.0, seed=1)), ramp=10.0))
    assert engine.read_many(at.MOTION, 18)[0] == pytest.approx(np.zeros(18), abs=1e-15)
    assert engine.read_many(at.LOAD_VELOCITY, 3)[0] == pytest.approx(np.zeros(3), abs=1e-15)


@kernel
def interpolate(values, duration, t):
    return on_quintic(*quintic(*values, duration), t)


@pytest.mark.parametrize(("frequency", "duration"), [(0.5, 0.1), (2.5, 0.1), (2.5, 0.2), (4.0, 0.2)])
def test_quintic_stays_within_its_stated_error(frequency, duration):
    worst = 0.0
    for phase in np.linspace(0, 2 * np.pi, 25):

        def exact(t, phase=phase):
            angle = frequency * t + phase
            return np.cos(angle), -frequency * np.sin(angle), -(frequency**2) * np.cos(angle)

        ends = (*map(float, exact(0.0)), *map(float, exact(duration)))
        for t in np.linspace(0, duration, 41):
            position, velocity = interpolate(ends, duration, float(t))
            worst = max(worst, abs(position - exact(t)[0]))
            assert abs(velocity - exact(t)[1]) < 8 * (frequency * duration) ** 6 / 46080 / duration + 1e-14
    bound = (frequency * duration) ** 6 / 46080
    assert worst < bound + 1e-14
    assert bound < 1e-11 or worst > 0.5 * bound  # and the statement is no exaggeration


def test_phases_do_not_drift():
    """1e5 steps on, the turned phases still give the motion of the formula."""
    motion = SeaMotion(sea=Sea(hs=3.0, tp=9.0, heading=2.0, seed=7))
    engine = Engine(1, 0.1, max_inner_step=0.1)
    engine.reset_row(0, Scenario(motion=motion))
    command = np.zeros(1)
    for _ in range(100_000):
        engine.step(command)
    want = motion.components().at(100_000 * 0.1)[:, 0].reshape(-1)
    assert np.abs(engine.read_many(at.MOTION, 18)[0] - want).max() < 1e-9
    assert engine.read(at.TIME)[0] == pytest.approx(1e4, rel=1e-14)


def test_paper_motion():
    """Eq. (42): surge 1 m, 6 s; heave 2 m, 12 s."""
    t = np.linspace(0, 30, 301)
    position, rate, acceleration = HarmonicMotion.paper().components().at(t)
    w = 2 * np.pi / np.array([6.0, 12.0])
    amplitude = np.array([1.0, 2.0])
    np.testing.assert_allclose(position[:, [0, 2]], amplitude * np.sin(t[:, None] * w), atol=1e-12)
    np.testing.assert_allclose(rate[:, [0, 2]], amplitude * w * np.cos(t[:, None] * w), atol=1e-12)
    np.testing.assert_allclose(acceleration[:, [0, 2]], -amplitude * w**2 * np.sin(t[:, None] * w), atol=1e-12)
    assert not position[:, [1, 3, 4, 5]].any()


def test_harmonic_with_phase():
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="roll", amplitude=0.1, period=8.0, phase=0.6),))
    t = np.linspace(0, 20, 50)
    np.testing.assert_allclose(motion.components().at(t)[0][:, 3], 0.1 * np.sin(2 * np.pi * t / 8 + 0.6), atol=1e-14)
