import cmath
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from aframe_env import Crane, Harmonic, HarmonicMotion, InvalidValue, Scenario, ScenarioDistribution, Sensors, Winch
from aframe_env.task import SENSED, STATE
from agents.drives import map as drive_map
from agents.drives.map import DriveMap
from agents.drives.realtime_map import RealTimeMapPolicy
from agents.policy import DrumStill, Knowledge
from agents.rollout import held_out_scenarios, run

SHIPPED = drive_map.load(Path(__file__).parents[3] / "results" / "drive-map")
PERIOD, RADIUS = 0.1, 0.75
FREQUENCY = 2.0 * np.pi / 9.0


def constant(ratio):
    axes = [np.array(axis) for axis in ([0.5, 4.0], [5.0, 20.0], [1e4, 1.1e5], [40.0, 1600.0])]
    return DriveMap(*axes, np.full((2, 2, 2, 2), ratio, dtype=complex), np.zeros((2, 2, 2, 2)))


def heaving(amplitude=1.0, period=9.0, **changes):
    heave = Harmonic(coordinate="heave", amplitude=amplitude, period=period)
    motion = HarmonicMotion(harmonics=(heave,))
    return Scenario(motion=motion, load_mass=60.0e3, rope_damping=2.0e4, ramp=10.0, **changes)


class Watched:
    """A policy, and the drum angles that were observed, rad."""

    def __init__(self, policy, told=None):
        self.policy, self.name, self.knows, self.told = policy, policy.name, policy.knows, told
        names = [q.name for q in (STATE if policy.knows is Knowledge.STATE else SENSED)]
        self.column, self.angles = names.index("drum_angle"), []

    def reset(self, scenarios, control_period):
        self.policy.reset(self.told or scenarios, control_period)

    def act(self, observation, time):
        self.angles.append(observation[:, self.column].astype(float))
        return self.policy.act(observation, time)


def paid_out(policy, scenario, observation, duration=90.0):
    """Times (T,) s of the drum angles as measured, and rope (T,) m that the drum had paid out at them."""
    watched = Watched(policy)
    run(watched, [scenario], observation=observation, episode_duration=duration)
    delay = 0.0 if policy.sensors is None else policy.sensors.delay
    return PERIOD * np.arange(len(watched.angles)) - delay, RADIUS * np.array(watched.angles)[:, 0]


@pytest.mark.parametrize(
    ("sensors", "tolerance"),
    [
        (None, 0.007),
        (Sensors.ideal(), 0.007),
        (dataclasses.replace(Sensors.ideal(), delay=0.25), 0.01),
        (Sensors(), 0.05),
        (Sensors(delay=0.3), 0.05),
    ],
)
def test_in_a_regular_wave_the_drum_tracks_the_ratio_of_the_heave(sensors, tolerance):
    """Once the filter has settled: the closed form times the heave itself, of 1 m."""
    scenario = heaving()
    times, rope = paid_out(RealTimeMapPolicy(SHIPPED, sensors), scenario, "state" if sensors is None else sensors)
    wanted = np.sin(FREQUENCY * times) / (1.0 + 60.0e3 * 9.81 / 2.0e8)
    assert abs(rope - wanted)[times > 60.0].max() < tolerance


@pytest.mark.parametrize(
    ("ratio", "tolerance"),
    [(0.0, 1e-12), (0.6, 2e-3), (1.3, 4e-3), (cmath.rect(0.8, 0.5), 0.04), (cmath.rect(0.8, -0.5), 0.04)],
)
def test_it_pays_out_the_share_of_the_heave_that_the_map_says_and_leads_it_as_much(ratio, tolerance):
    """A lead takes the quadrature of the waves, which a filter knows less well than their sum."""
    times, rope = paid_out(RealTimeMapPolicy(constant(ratio), None), heaving(), "state")
    late = times > times[-1] - 27.0 + 1e-9
    basis = np.exp(1j * FREQUENCY * times[late])
    # The heave is Im exp(i ω t): so is the answer's part at that frequency, over three whole periods.
    assert 2.0j * np.mean(rope[late] * basis.conj()) == pytest.approx(ratio, abs=tolerance)


def test_it_removes_the_heave_of_held_out_seas_on_sensors():
    scenarios = held_out_scenarios(ScenarioDistribution(), 12)
    still = run(DrumStill(), scenarios).rms
    policy = RealTimeMapPolicy(SHIPPED)
    assert (policy.name, policy.knows) == ("drive map in real time", Knowledge.SENSORS)
    sensed = 1.0 - run(policy, scenarios, observation="sensors").rms / still
    assert np.median(sensed) > 0.95
    assert sensed.min() > 0.0
    on_state = RealTimeMapPolicy(SHIPPED, None)
    assert (on_state.name, on_state.knows) == ("drive map in real time (state)", Knowledge.STATE)
    assert np.median(1.0 - run(on_state, scenarios).rms / still) > np.median(sensed)


@pytest.mark.parametrize("sensors", [Sensors(), None])
def test_a_row_alone_acts_as_in_a_batch(sensors):
    scenarios = held_out_scenarios(ScenarioDistribution(), 5)
    observation = sensors or "state"
    together = run(RealTimeMapPolicy(SHIPPED, sensors), scenarios, observation=observation, episode_duration=20.0)
    alone = run(RealTimeMapPolicy(SHIPPED, sensors), scenarios[:1], observation=observation, episode_duration=20.0)
    np.testing.assert_array_equal(alone.drum_speed[0], together.drum_speed[0])


def wanted(policy, **told):
    """Drum angles (N,) rad wanted after half a minute of one heave of 1 m, with readings and ropes (N,) like these."""
    rows = len(next(iter(told.values())))
    policy.reset([Scenario()] * rows, PERIOD)
    for step in range(300):
        time = PERIOD * step
        read = {"rope_tension": 5e4 * 9.81, "rope_length": 300.0, **told}
        read["pulley_velocity_z"] = FREQUENCY * np.cos(FREQUENCY * time) * min(time / 10.0, 1.0)
        columns = [np.broadcast_to(read.get(q.name, 0.0), rows) for q in SENSED]
        policy.act(np.stack(columns, axis=1).astype(np.float32), time)
    return policy.wanted(np.zeros(1))[0]


def test_the_load_that_it_weighs_changes_the_ratio_as_in_the_closed_form():
    mass = np.array([2e4, 5e4, 1e5])
    angle = wanted(RealTimeMapPolicy(SHIPPED), rope_tension=9.81 * mass)
    closed = 1.0 / (1.0 + mass * 9.81 / 2.0e8)
    assert abs(angle).min() > 0.5
    np.testing.assert_allclose(angle / angle[0], closed / closed[0], atol=5e-4)


def test_the_rope_that_it_is_told_enters_as_the_map_says():
    angle = wanted(RealTimeMapPolicy(SHIPPED), rope_length=np.array([80.0, 1200.0]))
    assert angle[1] == pytest.approx(angle[0], rel=1e-3)  # as in the closed form, which knows no length
    sloping = constant(0.5)
    sloping.ratio[..., 1] = 1.0
    short, long = wanted(RealTimeMapPolicy(sloping), rope_length=np.array([40.0, 1600.0]))
    assert long == pytest.approx(2.0 * short, rel=1e-12)


def test_a_sea_beyond_the_winch_is_not_made_worse():
    """Drums that fall behind catch up without running past their drives."""
    scenario = heaving(amplitude=3.0, period=7.0)
    still = run(DrumStill(), [scenario]).rms
    assert 3.0 * (2.0 * np.pi / 7.0) ** 2 > scenario.crane.winch.max_rope_acceleration
    assert run(RealTimeMapPolicy(SHIPPED), [scenario], observation="sensors").rms < 0.8 * still


def test_the_encoder_brings_back_a_drum_that_did_not_turn_as_reckoned():
    """The winch is slower than the one that the policy was told of, so that rope is lost in every large heave."""
    scenario = heaving(amplitude=2.0, period=7.0, crane=Crane(winch=Winch(max_rope_acceleration=1.2)))
    watched = Watched(RealTimeMapPolicy(SHIPPED), told=[heaving()])
    run(watched, [scenario], observation="sensors", episode_duration=120.0)
    last = RADIUS * np.array(watched.angles)[-700:, 0]  # ten waves
    assert abs(last.mean()) < 0.05
    assert np.ptp(last) > 2.0


def test_an_observation_of_another_width_is_refused():
    policy = RealTimeMapPolicy(SHIPPED)
    policy.reset([Scenario()], PERIOD)
    with pytest.raises(InvalidValue, match="14 quantities, the policy reads 10"):
        policy.act(np.zeros((1, 14), dtype=np.float32), 0.0)
