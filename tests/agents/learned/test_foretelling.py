from dataclasses import replace

import numpy as np
import pytest
import torch
from test_recurrent import SEAS, agent, play

from aframe_env import InvalidValue, Preview, TaskConfig, task
from aframe_env.scenario.sensors import Sensors
from aframe_env.simulation import Simulation
from aframe_env.suite import find_task
from agents import shipped
from agents.control.predictive import PredictiveControl
from agents.learned.foretelling import Foretelling, ForetellingControl, weights
from agents.learned.recurrent import load
from agents.learned.recurrent_inputs import FORECASTS, RATES_AHEAD, RISES_AHEAD, Lookout
from agents.policy import Knowledge
from agents.registry import choose, choose_all
from agents.rollout import held_out_scenarios
from train.benchmark.specialists import forecasters

STRONG = replace(SEAS, hs=(3.0, 4.0), ramp=0.0)  # winches saturate from the start


def foretelling(gain=1.0, **card):
    """The policy on the memory of a network of small random weights, its corrections as many times greater."""
    policy, _ = agent()
    with torch.no_grad():
        for parameter in policy.network.forecast.parameters():
            parameter.mul_(0.05 * gain)
    return ForetellingControl(policy.network, replace(policy.card, **card))


def test_without_corrections_it_is_adaptive_predictive_control_to_the_bit():
    scenarios = held_out_scenarios(STRONG, 3)
    policy, plain = foretelling(0.0), PredictiveControl(foretelling().config)
    assert plain.name == "adaptive predictive control"
    assert policy.knows is plain.knows is Knowledge.SENSORS
    assert np.array_equal(play(policy, scenarios).drum_speed, play(plain, scenarios).drum_speed)
    # And a network that corrects is heard.
    assert not np.array_equal(play(foretelling(), scenarios).drum_speed, play(plain, scenarios).drum_speed)


def test_a_row_does_not_depend_on_the_others():
    policy, scenarios = foretelling(), held_out_scenarios(STRONG, 70)  # more than a block
    many = play(policy, scenarios)
    for row in (0, 37, 66):
        alone = play(policy, scenarios[row : row + 1], first=row)
        assert np.array_equal(alone.drum_speed[0], many.drum_speed[row])


def test_a_wave_that_is_missing_from_the_forecasts_is_put_into_the_path():
    """Corrections that are those of a wave of 7 s give its mean speeds in the steps to come, but for the first few."""
    rate, ahead, ends = 2.0 * np.pi / 7.0, np.array(RATES_AHEAD), 0.1 * np.arange(81)
    wave = np.concatenate([np.cos(rate * ahead + 0.3), np.full(len(RISES_AHEAD), 1e3)])
    found = weights(80, 0.1) @ wave
    expected = np.diff(np.sin(rate * ends + 0.3) / rate) / 0.1
    assert len(wave) == FORECASTS
    assert found[4:] == pytest.approx(expected[4:], abs=0.02)
    assert found[3] == pytest.approx(0.5 * expected[3], abs=0.01)
    assert np.array_equal(found[:3], np.zeros(3))


def test_what_is_foretold_in_a_storm_is_nearer_to_what_comes_than_the_wave_banks():
    storm = find_task("Storm")
    scenarios, config = storm.scenarios("validation", 8), TaskConfig(**storm.arguments)
    policy = load(shipped.folder("apg-storm") / "seed-0")
    bank = Lookout(8, policy.card.made_for)
    memory = Foretelling(8, policy.network, policy.card.made_for)
    simulation = Simulation(8, config.replaced(scenario=scenarios[0], observation=config.sensors))
    simulation.reset_rows(np.arange(8), [(scenario, 3) for scenario in scenarios])
    foretold, corrected, true, still = [], [], [], np.zeros(8)
    for step in range(400):
        seen = simulation.observe()
        told = bank.advance(seen) if step else bank.start(seen, scenarios)
        foretold.append(told.series[:, : len(RATES_AHEAD)])
        corrections = memory.advance(seen) if step else memory.start(seen, scenarios)
        corrected.append(foretold[-1] + corrections[:, : len(RATES_AHEAD)])
        true.append(simulation.state[:, task.PULLEY_VELOCITY_Z].copy())
        simulation.advance(still)
    for ahead in (2.2, 3.5, 4.0, 5.0):
        steps, place = round(ahead / 0.1), RATES_AHEAD.index(ahead)
        came = np.array(true)[steps:]
        ours, banks = (np.array(each)[: len(came), :, place] - came for each in (corrected, foretold))
        assert np.sqrt((ours**2).mean()) < 0.95 * np.sqrt((banks**2).mean())


@pytest.mark.parametrize(
    ("card", "words"),
    [
        ({"observation": "state", "sensors": None}, "acts on the full state"),
        ({"sensors": Sensors(preview=Preview())}, "a radar foretells further"),
    ],
)
def test_agents_whose_forecasts_are_no_use_are_refused(card, words):
    with pytest.raises(InvalidValue, match=words):
        foretelling(**card)


def test_another_control_period_is_refused():
    with pytest.raises(InvalidValue, match=r"trained for 0\.1 s"):
        foretelling().reset(held_out_scenarios(SEAS, 1), 0.2)


def test_it_stands_behind_the_agent_and_in_the_benchmark_of_its_task():
    (spec,) = choose_all(["apg-storm:forecasts"])
    assert spec.name == "predictive control on learned forecasts"
    assert (spec.control_period, spec.digest) == (0.1, choose("apg-storm").digest)
    for word in ("apg-storm:forecast", "ppo:forecasts"):
        with pytest.raises(InvalidValue, match="behind this folder may stand"):
            choose(word)
    expected = {"Storm": ["apg-storm:forecasts"], "Preview": [], "Landing": [], "DeepRope": ["apg-deeprope:forecasts"]}
    assert {name: forecasters(find_task(name)) for name in expected} == expected


def test_it_goes_on_with_ropes_that_grow():
    scenarios = held_out_scenarios(SEAS, 2)

    class Growing:
        name, knows = "growing", Knowledge.SENSORS

        def __init__(self, policy):
            self.policy, self.reset = policy, policy.reset

        def act(self, observation, time):
            if time == 1.0:
                self.policy.retune(1.3 * observation[:, -1].astype(np.float64), np.zeros(2), np.ones(2))
            return self.policy.act(observation, time)

    one, other = (Growing(each) for each in (foretelling(0.0), PredictiveControl(foretelling().config)))
    assert np.array_equal(play(one, scenarios).drum_speed, play(other, scenarios).drum_speed)
    assert not np.array_equal(play(one, scenarios).drum_speed, play(one.policy, scenarios).drum_speed)
