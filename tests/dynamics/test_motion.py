"""The deck's motion: build-up, interpolation, long runs, records; each against its formula."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from aframe_env import Harmonic, HarmonicMotion, Scenario, Sea, SeaMotion
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.motion import on_quintic, quintic, smooth_ramp
from aframe_env.dynamics.wave_components import PATH_ERROR
from aframe_env.engine import Engine


def test_ramp_is_the_quintic_smoothstep_with_its_derivatives() -> None:
    duration = 8.0
    step = np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    times = np.linspace(0.0, duration, 401)
    got = np.array([smooth_ramp(t, 1 / duration, 0.0) for t in times])
    s = times / duration
    want = np.stack([step.deriv(k)(s) / duration**k if k else step(s) for k in range(3)], axis=1)
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-14)
    assert [smooth_ramp(t, 1 / duration, 0.0) for t in (8.0, 8.1, 1e5)] == [(1.0, 0.0, 0.0)] * 3


def test_no_ramp() -> None:
    assert [smooth_ramp(t, 0.0, 1.0) for t in (0.0, 3.0, 1e4)] == [(1.0, 0.0, 0.0)] * 3


def test_ramped_start_is_at_rest() -> None:
    engine = Engine(1, 0.1)
    engine.reset_row(0, Scenario(motion=SeaMotion(sea=Sea(hs=4.0, tp=8.0, seed=1)), ramp=10.0))
    assert engine.read_many(at.NODE, 18)[0] == pytest.approx(np.zeros(18), abs=1e-15)
    assert engine.read_many(at.LOAD_VELOCITY, 3)[0] == pytest.approx(np.zeros(3), abs=1e-15)


@pytest.mark.parametrize(("frequency", "duration"), [(0.5, 0.1), (2.5, 0.1), (2.5, 0.2), (4.0, 0.2)])
def test_quintic_stays_within_its_stated_error(frequency: float, duration: float) -> None:
    worst = 0.0
    for phase in np.linspace(0, 2 * np.pi, 25):

        def exact(t: float, phase: float = phase) -> tuple[float, float, float]:
            angle = frequency * t + phase
            return np.cos(angle), -frequency * np.sin(angle), -(frequency**2) * np.cos(angle)

        ends = (*map(float, exact(0.0)), *map(float, exact(duration)))
        for t in np.linspace(0, duration, 41):
            position, velocity = on_quintic(*quintic(*ends, duration), float(t))
            worst = max(worst, abs(position - exact(t)[0]))
            assert abs(velocity - exact(t)[1]) < 8 * (frequency * duration) ** 6 / 46080 / duration + 1e-14
    bound = (frequency * duration) ** 6 / 46080
    assert worst < bound + 1e-14
    assert bound < 1e-11 or worst > 0.5 * bound  # and the statement is no exaggeration


def test_phases_do_not_drift() -> None:
    """1e5 steps on, the turned phases still give the motion of the formula."""
    motion = SeaMotion(sea=Sea(hs=3.0, tp=9.0, heading=2.0, seed=7))
    engine = Engine(1, 0.1, max_inner_step=0.1)
    engine.reset_row(0, Scenario(motion=motion))
    command = np.zeros(1)
    for _ in range(100_000):
        engine.step(command)
    want = motion.components().at(100_000 * 0.1)[:, 0].reshape(-1)
    assert np.abs(engine.read_many(at.NODE, 18)[0] - want).max() < 1e-9
    assert np.abs(engine.deck()[0] - want[:6]).max() < 1e-9
    assert engine.read(at.TIME)[0] == pytest.approx(1e4, rel=1e-14)


class Record:
    """The motion of a sea, tabled over ``duration`` s."""

    def __init__(self, motion: SeaMotion, duration: float, ramp: float = 0.0) -> None:
        self._motion, self._duration, self._ramp = motion, duration, ramp

    @property
    def duration(self) -> float:
        return self._duration

    def table(self, period: float) -> npt.NDArray[np.float64]:
        times = np.arange(0.0, self._duration + period / 2, period)
        lines = self._motion.components().at(times).transpose(1, 0, 2).reshape(len(times), 18)
        # A ramp builds a record's yaw up about its first, a sea's about zero; where it begins nothing else is read.
        if self._ramp:
            lines[0, 5] = 0.0
        return lines


def history(engine: Engine, row: int, steps: int) -> npt.NDArray[np.float64]:
    """Deck (6), pulley (9) and load (3) of a row (steps, 18), the drum turning."""
    out = []
    for _ in range(steps):
        engine.step(np.ones(engine.rows))
        parts = [engine.read_many(slot, size)[row] for slot, size in ((at.PULLEY, 9), (at.LOAD_POSITION, 3))]
        out.append(np.concatenate([engine.deck()[row], *parts]))
    return np.array(out)


@pytest.mark.parametrize(("period", "ramp"), [(0.1, 0.0), (0.5, 0.0), (0.1, 10.0)])
def test_recorded_motion_is_that_of_its_components(period: float, ramp: float) -> None:
    motion = SeaMotion(sea=Sea(hs=3.0, tp=9.0, heading=2.0, seed=3))
    given = Scenario(motion=motion, ramp=ramp)
    recorded = Scenario(motion=Record(motion, 60.0, ramp), ramp=ramp)
    other = Scenario(motion=Record(SeaMotion(sea=Sea(hs=1.0, tp=7.0, seed=4)), 30.0))
    engine = Engine(3, period)
    for row, scenario in enumerate((given, other, recorded)):
        engine.reset_row(row, scenario)
    twin = Engine(1, period)
    twin.reset_row(0, given)
    steps = round(60 / period)
    got, want = history(engine, 2, steps), history(twin, 0, steps)
    # A record has a knot at every line, the sea as few as PATH_ERROR allows; derivatives lose by the knots' distance.
    interval = engine.read(at.NODE_SEGMENTS)[0] * engine.read(at.CONTROL_PERIOD)[0]
    tolerance = np.full(18, PATH_ERROR)
    tolerance[9:12] *= 8.0 / interval
    tolerance[12:15] *= 60.0 / interval**2
    assert (np.abs(got - want) < tolerance).all()
    at_knots = np.arange(steps) % 4 == 3
    if period == 0.1:
        assert interval == 0.4
        np.testing.assert_allclose(got[at_knots, :15], want[at_knots, :15], rtol=0, atol=1e-8)


def test_deck_stands_still_after_the_end_of_a_record() -> None:
    motion = SeaMotion(sea=Sea(hs=3.0, tp=9.0, heading=2.0, seed=3))
    engine = Engine(1, 0.1)
    engine.reset_row(0, Scenario(motion=Record(motion, 5.0)))
    got = history(engine, 0, 60)
    np.testing.assert_allclose(got[50:, :6], np.tile(got[49, :6], (10, 1)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(got[50:, 9:15], 0.0, rtol=0, atol=1e-12)


def test_paper_motion() -> None:
    """Eq. (42): surge 1 m, 6 s; heave 2 m, 12 s."""
    t = np.linspace(0, 30, 301)
    position, rate, acceleration = HarmonicMotion.paper().components().at(t)
    w = 2 * np.pi / np.array([6.0, 12.0])
    amplitude = np.array([1.0, 2.0])
    np.testing.assert_allclose(position[:, [0, 2]], amplitude * np.sin(t[:, None] * w), atol=1e-12)
    np.testing.assert_allclose(rate[:, [0, 2]], amplitude * w * np.cos(t[:, None] * w), atol=1e-12)
    np.testing.assert_allclose(acceleration[:, [0, 2]], -amplitude * w**2 * np.sin(t[:, None] * w), atol=1e-12)
    assert not position[:, [1, 3, 4, 5]].any()


def test_harmonic_with_phase() -> None:
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="roll", amplitude=0.1, period=8.0, phase=0.6),))
    t = np.linspace(0, 20, 50)
    np.testing.assert_allclose(motion.components().at(t)[0][:, 3], 0.1 * np.sin(2 * np.pi * t / 8 + 0.6), atol=1e-14)
