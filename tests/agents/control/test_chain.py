"""Loads on ropes with mass against closed forms and SciPy, and the filter of them against the one for light ropes."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from aframe_env import Crane, LoadShape, Rope, Scenario, TaskConfig, Water, find_task
from agents.control.chain import STATE, Chains, Hanging
from agents.control.chain_filter import ChainFilter
from agents.control.expected_waves import ExpectedWaves
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.control.rope import RopeModel
from agents.control.rope_filter import RopeFilter
from agents.rollout import run

PERIOD = 0.1
SIX_STRAND = Rope.six_strand(loss_time=0.0)


def moved(chains, speed):
    """States (n, S) of one load whose rope's end goes up at these mean speeds (n,) m/s."""
    state, states = np.zeros((1, STATE)), []
    for each in speed:
        state = chains.advance(state, np.array([each]))
        states.append(state[0])
    return np.array(states)


@pytest.mark.parametrize(("below", "inertia"), [(1000.0, 180e3), (3000.0, 54e3)])
def test_frequencies_are_those_of_a_bar_with_a_mass_at_its_end(below, inertia):
    drum_part, rope = 15.0, SIX_STRAND
    chains = Chains.of([Hanging(rope, below, drum_part, inertia, 0.0, 0.0)], PERIOD)
    turns = np.angle(np.linalg.eigvals(chains.transition[0, :, :-1]))
    reckoned = np.unique(turns[turns > 1e-6].round(9)) / PERIOD
    wave = np.sqrt(rope.axial_stiffness / rope.mass_per_length)

    def misfit(frequency):
        k = frequency / wave
        # The load's end pulls with m ω² u; at the top the rope to the drum with E F u / λ.
        load = inertia * k / rope.mass_per_length
        u = np.cos(k * below) - load * np.sin(k * below)
        slope = -k * np.sin(k * below) - load * k * np.cos(k * below)
        return slope * drum_part + u

    first = 0.6 * np.pi * wave / below
    true = [brentq(misfit, 1e-3, first), brentq(misfit, first, 1.5 * np.pi * wave / below)]
    assert reckoned == pytest.approx(true, rel=5e-3)
    assert reckoned[0] == pytest.approx(true[0], rel=1e-4)


def test_a_rope_without_mass_in_air_is_the_rope_model():
    rope, mass, length = Rope(), 60e3, 800.0
    frequency = np.sqrt(rope.axial_stiffness / length / mass)
    chains = Chains.of([Hanging(rope, length - 15.0, 15.0, mass, 0.0, 0.06 / frequency)], PERIOD)
    model = RopeModel.of(np.array([frequency]), 0.03, PERIOD)
    assert chains.transition[0, :3][:, [0, 1, 2, -1]] == pytest.approx(model.a[0, :3], abs=1e-12)
    assert not chains.drag.any()
    assert chains.pull[0, :3] == pytest.approx(mass * frequency**2 * np.array([-1.0, 0.0, 1.0]))


def test_drag_on_a_load_is_that_of_its_differential_equation():
    """A rope without mass, its end moved as by a sea at resonance: half of the swing is drag's."""
    rope, mass, below, drum_part, drag = Rope(), 180e3, 2985.0, 15.0, 3e4
    stiffness = rope.axial_stiffness / (below + drum_part)
    frequency = np.sqrt(stiffness / mass)
    speed = 0.5 * np.cos(frequency * PERIOD * (np.arange(600) + 0.5))
    reckoned = moved(Chains.of([Hanging(rope, below, drum_part, mass, drag, 0.0)], PERIOD), speed)[:, 0]
    free = moved(Chains.of([Hanging(rope, below, drum_part, mass, 0.0, 0.0)], PERIOD), speed)[:, 0]
    end = np.append(0.0, PERIOD * np.cumsum(speed))

    def rate(time, x):
        pull = stiffness * (np.interp(time, PERIOD * np.arange(len(end)), end) - x[0])
        return x[1], (pull - drag * abs(x[1]) * x[1]) / mass

    times = PERIOD * np.arange(1, 601)
    true = solve_ivp(rate, (0.0, 60.0), np.zeros(2), t_eval=times, rtol=1e-8, atol=1e-8, max_step=PERIOD).y[0]
    assert abs(true).max() < 0.5 * abs(free).max()
    assert reckoned == pytest.approx(true, abs=5e-3 * abs(true).max())


def test_tension_at_the_pulley_accelerates_load_and_rope():
    """Momentum: over any time the tension beyond that at rest is what load and rope gained, whatever the modes."""
    hanging = Hanging(SIX_STRAND, 2000.0, 15.0, 100e3, 0.0, 0.0)
    chains = Chains.of([hanging], PERIOD)
    whole = hanging.inertia + SIX_STRAND.mass_per_length * hanging.below
    # The rope's end goes up smoothly for a minute, until all of it goes along at 0.5 m/s.
    states = moved(chains, 0.5 * np.clip(PERIOD * np.arange(800) / 60.0, 0.0, 1.0))
    impulse = PERIOD * (states @ chains.pull[0]).sum()
    assert states[-1, 1] == pytest.approx(0.5, abs=0.02)
    assert impulse == pytest.approx(0.5 * whole, rel=0.05)


def test_what_is_weighed_on_board_is_what_hangs():
    load = LoadShape(volume=7.6, added_mass_vertical=48e3, drag_area_vertical=40.0)
    scenario = Scenario(
        crane=Crane(rope=Rope.six_strand()),
        load_mass=60e3,
        target_level=-2000.0,
        rope_damping=0.0,
        water=Water(),
        load=load,
    )
    true, known = Hanging.of(scenario), Hanging.weighed(scenario, scenario.free_length, scenario.moved_mass, 1.0)
    assert known[1:] == pytest.approx(true[1:], rel=5e-3)
    assert true.inertia == 108e3
    nothing = Chains.of(
        [Hanging.weighed(scenario, 5.0, 0.0, 1.0), Hanging.weighed(scenario, 2000.0, 100.0, 1.0)], PERIOD
    )
    assert np.isfinite(nothing.transition).all()
    assert np.abs(np.linalg.eigvals(nothing.transition[:, :, :-1])).max() < 1.0 + 1e-9


def test_on_light_ropes_the_filter_is_the_rope_filter():
    rope, mass, length, noise = Rope(), 60e3, 800.0, np.array([0.004])
    frequency = np.sqrt(rope.axial_stiffness / length / mass)
    model = RopeModel.of(np.array([frequency]), 0.03, PERIOD)
    chains = Chains.of([Hanging(rope, length - 15.0, 15.0, mass, 0.0, 0.06 / frequency)], PERIOD)
    known, mine = RopeFilter(1, 0.01), ChainFilter(1, 0.01)
    known.start(model, PERIOD, noise)
    mine.start(chains, PERIOD, np.array([length / rope.axial_stiffness]), noise)
    rng = np.random.default_rng(0)
    for step in range(100):
        speed, stretch = rng.normal(0.0, 0.3, 1), rng.normal(0.0, 0.1, 1)
        known.advance(speed, stretch)
        mine.advance(speed, stretch)
        if step == 50:
            known.retune(model, PERIOD, noise, np.array([1.2]))
            mine.retune(chains, PERIOD, np.array([length / rope.axial_stiffness]), noise, np.array([1.2]))
    assert mine.stretch == pytest.approx(known.stretch, abs=1e-9)
    assert mine.load_velocity == pytest.approx(known.load_velocity, abs=1e-9)


def test_a_law_whose_filter_knows_the_rope_leaves_less_of_the_heave():
    """Eight lifts of DeepRope, half a minute long: a tenth less at the least in the mean."""
    task = find_task("DeepRope")
    config, scenarios = TaskConfig(**{**task.arguments, "episode_duration": 30.0}), task.scenarios("train", 8)
    waves = ExpectedWaves.of(config.source)
    knows, does_not = (
        run(
            PredictiveControl(PlanningConfig(sensors=config.sensors, horizon=80, waves=waves, chains=chains)),
            scenarios,
            config,
        ).rms
        for chains in (True, False)
    )
    assert knows.mean() < 0.9 * does_not.mean()
