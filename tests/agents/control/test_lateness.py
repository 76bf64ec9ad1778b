import numpy as np
import pytest

from aframe_env import TASKS, InvalidValue, TaskConfig
from agents.control.lateness import MOST, Lateness
from agents.control.predictive import PlanningConfig
from agents.policy import DrumStill
from agents.registry import BuildContext, choose
from agents.rollout import run

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


def test_rows_that_begin_anew_know_nothing():
    lateness = Lateness(2, PERIOD, DELAY)
    for time in TIMES[:200]:
        lateness.advance(np.full(2, np.sin(time)), np.full(2, np.sin(time - 0.4)))
    before = lateness.seconds
    lateness.start(np.array([1]))
    assert lateness.seconds.tolist() == [before[0], 0.0]
    assert before[0] == pytest.approx(0.2, abs=0.01)


def test_predictive_control_that_adapts_holds_what_is_not_as_told():
    task = TASKS["Unknown"]
    config, scenarios = TaskConfig(**task.arguments), task.scenarios("train", 12)
    still = run(DrumStill(), scenarios, config).rms
    reduction = {}
    for name in ("predictive control", "adaptive predictive control", "feed-forward + feedback"):
        policy = choose(name).policy(BuildContext(scenarios=scenarios, config=config))
        reduction[name] = 1.0 - run(policy, scenarios, config).rms / still
    plain, adaptive, other = reduction.values()
    assert adaptive.mean() > 0.93
    assert adaptive.min() > 0.8
    assert adaptive.mean() > max(plain.mean(), other.mean()) + 0.03


def test_the_full_state_is_never_late():
    with pytest.raises(InvalidValue, match="adapts = True: it takes sensors"):
        PlanningConfig(sensors=None, adapts=True)
