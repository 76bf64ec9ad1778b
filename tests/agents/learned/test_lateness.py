import numpy as np
import pytest

from agents.learned.lateness import MOST, Lateness

PERIOD, DELAY = 0.1, 2
TIMES = PERIOD * np.arange(600)
FREQUENCY, PHASE = np.array([[0.5, 0.8, 1.1], [0.0, 1.0, 3.0]])


def reckon(late, lag=0.0, noise=0.0):
    """Lateness of drums that go as a sea does, ``late`` (N,) s more than told, with a lag (N,) s beside."""
    delay = late + DELAY * PERIOD
    lateness = Lateness(len(late), PERIOD, DELAY)
    rng = np.random.default_rng(0)
    for time in TIMES:
        reckoned = np.full(len(late), np.sin(FREQUENCY * time + PHASE).sum())
        # The steady answer of a first-order lag is a share of each wave, and behind it.
        angle, size = np.arctan(np.outer(lag, FREQUENCY)), 1.0 / np.hypot(1.0, np.outer(lag, FREQUENCY))
        read = (size * np.sin(FREQUENCY * (time - delay[:, None]) + PHASE - angle)).sum(axis=1)
        lateness.advance(reckoned, read + noise * rng.normal(size=len(late)))
    return lateness.seconds


def test_it_is_by_how_much_readings_are_later_than_told():
    late = np.array([-0.15, 0.0, 0.1, 0.2])
    assert reckon(late, np.zeros(4)) == pytest.approx(late, abs=0.01)


def test_a_lag_makes_as_late_as_its_time_constant():
    lag = np.array([0.05, 0.15, 0.3])
    assert reckon(np.zeros(3), lag) == pytest.approx(lag, rel=0.1)
    assert reckon(np.full(3, -0.1), lag) == pytest.approx(lag - 0.1, abs=0.03)


def test_noise_hides_it_hardly_and_does_not_make_any_of_a_drum_at_rest():
    assert reckon(np.array([0.1]), np.zeros(1), noise=0.01) == pytest.approx([0.1], abs=0.01)
    still, rng = Lateness(50, PERIOD, DELAY), np.random.default_rng(1)
    for _ in range(300):
        still.advance(np.zeros(50), 0.01 * rng.normal(size=50))
    assert abs(still.seconds).max() < 0.01


def test_no_more_than_that_is_reckoned_with():
    assert reckon(np.array([1.0, -1.0]), np.zeros(2)) == pytest.approx([MOST, -MOST])
