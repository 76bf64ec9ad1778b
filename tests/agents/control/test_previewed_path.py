"""Policies beside a wave radar: who plans by the preview, and that everybody else does what it did."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from aframe_env import (
    HarmonicMotion,
    InvalidValue,
    Preview,
    Scenario,
    ScenarioDistribution,
    Sensors,
    TaskConfig,
    find_task,
)
from aframe_env.simulation import Simulation
from aframe_env.task import PULLEY_HEAVE, SENSED, STATE
from agents import shipped
from agents.control.expected_waves import ExpectedWaves
from agents.control.feed_forward import PartialFeedForward
from agents.control.feedback import Feedback
from agents.control.observer import observer_for
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.control.previewed_path import PreviewedPath
from agents.control.regulator import HoistBatch
from agents.learned import recurrent
from agents.learned.feature_policy import FeaturePolicy
from agents.learned.features import FeatureConfig
from agents.learned.recurrent_inputs import RATES_AHEAD, RISES_AHEAD, Lookout, LookoutConfig
from agents.policy import FloatArray, Policy
from agents.registry import BuildContext, choose
from agents.rollout import run

TASK = find_task("Preview")
CONFIG = TaskConfig(**TASK.arguments)
FIRST = len(SENSED)


@cache
def waves() -> ExpectedWaves:
    return ExpectedWaves.of(TASK.distribution)


def test_a_true_preview_tells_the_way_to_come() -> None:
    """To a centimetre in every control step's rise, summed over ten seconds; the filter alone is off by far more."""
    scenarios, sensors = TASK.scenarios("train", 4), Sensors(preview=Preview(frequency_error=0.0))
    config = TaskConfig(scenario=scenarios[0], observation=sensors)
    simulation = Simulation(4, config)
    simulation.reset_rows(np.arange(4), [(scenario, row) for row, scenario in enumerate(scenarios)])
    hoists = HoistBatch(4, 0.1, SENSED)
    observer, path = observer_for(hoists, 0.03, sensors, waves()), PreviewedPath.of(sensors, 4, 0.1)
    assert path is not None
    observer.start(hoists.start(scenarios, simulation.observe()))
    heave, told, filtered = [], [], []
    for step in range(501):
        if step:
            observer.advance(np.zeros(4), hoists.columns(simulation.observe()))
        path.take(simulation.observe())
        heave.append(simulation.state[:, PULLEY_HEAVE].copy())
        if step in (200, 300, 400):
            told.append(np.cumsum(path.rises(observer.waves, 100), axis=0))
            filtered.append(np.cumsum(observer.rises(100), axis=0))
        simulation.advance(np.zeros(4))
    true = np.array([np.array(heave[k + 1 : k + 101]) - heave[k] for k in (200, 300, 400)])
    assert abs(true).max() > 2.0
    assert abs(np.array(told) - true).max() < 0.05
    assert np.sqrt(np.square(np.array(filtered) - true).mean()) > 0.3


def test_the_way_covers_no_more_than_is_foretold() -> None:
    observer = observer_for(HoistBatch(2, 0.1, SENSED), 0.03, Sensors(), waves())
    path = PreviewedPath(Preview(horizon=3.0), 2, 0.1, 0.1)
    observer.waves.start()
    assert path.rises(observer.waves, 50).shape == (30, 2)
    assert path.rises(observer.waves, 20).shape == (20, 2)
    assert PreviewedPath.of(Sensors(), 2, 0.1) is None


def test_a_preview_of_another_length_is_refused() -> None:
    path = PreviewedPath(Preview(), 1, 0.1, 0.1)
    with pytest.raises(InvalidValue, match="observation: 14 quantities, the policy reads 40"):
        path.take(np.zeros((1, 14), dtype=np.float32))


def shares(policy: Policy, sensors: Sensors, count: int = 6) -> FloatArray:
    scenarios = TASK.scenarios("train", count)
    return run(policy, scenarios, CONFIG, observation=sensors, episode_duration=30.0).rms


def test_predictive_control_is_the_better_for_it() -> None:
    plain, radar = Sensors(), TASK.distribution.sensors
    without = shares(PredictiveControl(PlanningConfig(sensors=plain, waves=waves())), plain)
    with_it = shares(PredictiveControl(PlanningConfig(sensors=radar, waves=waves())), radar)
    assert with_it.mean() < 0.8 * without.mean()


def test_of_a_sea_it_knows_nothing_but_what_is_foretold() -> None:
    scenarios, radar = TASK.scenarios("train", 2), TASK.distribution.sensors
    policy = PredictiveControl(PlanningConfig(sensors=radar, waves=waves()))
    observations = np.random.default_rng(0).normal(0.0, 1.0, (20, 2, FIRST + 30)).astype(np.float32)
    observations[:, :, 6:10] = (6e5, 0.0, 6e4, 300.0)
    commands = []
    for handed in (scenarios, [replace(each, motion=HarmonicMotion()) for each in scenarios]):
        policy.reset(handed, 0.1)
        commands.append([policy.act(seen, 0.1 * step) for step, seen in enumerate(observations)])
    assert np.array_equal(*commands)
    other = observations.copy()
    other[:, :, FIRST + 5 :] += 1.0
    policy.reset(scenarios, 0.1)
    assert not np.array_equal([policy.act(seen, 0.1 * k) for k, seen in enumerate(other)], commands[0])


def without_a_radar(folder: Path) -> bool:
    """Whether a recurrent agent acts on sensors, and was trained without a radar."""
    sensors = recurrent.load(folder / "seed-0").card.sensors
    return sensors is not None and sensors.preview is None


ON_SENSORS = [
    *("feed-forward + feedback", "output zero on sensors", "drive-map"),
    *(name for name in shipped.AGENTS if "sensors" in name),
    *(name for name, folder in shipped.RECURRENT.items() if without_a_radar(folder)),
]


def test_recurrent_agents_without_a_radar_are_among_them() -> None:
    assert {"apg-deeprope", "apg-mru", "apg-storm", "apg-unknown"} == set(ON_SENSORS) & set(shipped.RECURRENT)


@pytest.mark.parametrize("name", ON_SENSORS)
def test_everybody_else_does_what_it_does_without(name: str) -> None:
    """To the bit, the agents that were trained without a radar included."""
    scenarios = TASK.scenarios("train", 2)
    errors = []
    for sensors in (Sensors(), TASK.distribution.sensors):
        config = CONFIG.replaced(observation=sensors, episode_duration=5.0)
        policy = choose(name).policy(BuildContext(scenarios=scenarios, config=config))
        errors.append(run(policy, scenarios, config).error)
    assert np.array_equal(*errors)


@pytest.mark.parametrize(
    "make",
    [
        PartialFeedForward,
        lambda: Feedback(Sensors(), waves=waves()),
        lambda: PredictiveControl(PlanningConfig(waves=waves())),
    ],
    ids=["partial feed-forward", "feedback", "predictive control for readings alone"],
)
def test_laws_that_were_made_without_a_radar_leave_it_alone(make) -> None:  # type: ignore[no-untyped-def]
    scenarios = TASK.scenarios("train", 2)
    errors = [
        run(make(), scenarios, CONFIG, observation=sensors, episode_duration=5.0).error
        for sensors in (Sensors(), TASK.distribution.sensors)
    ]
    assert np.array_equal(*errors)


def test_an_agents_predict_takes_the_readings_out() -> None:
    agent = FeaturePolicy(lambda inputs: np.tanh(inputs.sum(axis=1)), FeatureConfig(sensors=Sensors(), waves=waves()))
    seen = np.random.default_rng(0).normal(0.0, 0.1, (3, FIRST + 30)).astype(np.float32)
    seen[:, 6:10] = (6e5, 0.0, 6e4, 300.0)
    assert np.array_equal(agent.predict(seen)[0], agent.predict(seen[:, :FIRST])[0])
    with pytest.raises(InvalidValue, match="observation of shape"):
        agent.predict(seen[:, : len(STATE)])


def test_a_recurrent_agent_is_shown_how_far_the_pulley_will_have_risen() -> None:
    scenario = TASK.scenarios("train", 1)[0]
    sensors = Sensors(preview=Preview(frequency_error=0.0))
    config = LookoutConfig(sensors=sensors, waves=waves())
    assert config.readings[4:] == tuple(f"pulley_heave_in_{0.5 * k:g}_s" for k in range(1, 31))
    heave, shown = [], []
    simulation = Simulation(1, TaskConfig(scenario=scenario, observation=sensors))
    simulation.reset_rows(np.arange(1), [(scenario, 5)])
    lookouts = [Lookout(1, config), Lookout(1, replace(config, sensors=Sensors()))]
    for step in range(401):
        seen = simulation.observe()
        looks = [each.advance(seen) if step else each.start(seen, [scenario]) for each in lookouts]
        shown.append(looks[0].series[0])
        heave.append(simulation.state[0, PULLEY_HEAVE])
        for each in lookouts:
            each.follow(np.zeros(1))
        simulation.advance(np.zeros(1))
    first = len(RATES_AHEAD) + len(RISES_AHEAD) + 4
    true = np.array(heave[205:351:5]) - heave[200]
    np.testing.assert_allclose(2.0 * shown[200][first:-1], true, atol=0.05)
    # Beside them it sees what it would without.
    assert np.array_equal(np.delete(looks[0].series[0], slice(first, first + 30)), looks[1].series[0])


def test_another_width_is_no_preview() -> None:
    """Observations of the full state are refused by policies on sensors, as before."""
    policy = Feedback(Sensors(), waves=ExpectedWaves.of(ScenarioDistribution()))
    for width in (FIRST - 1, len(STATE)):
        policy.reset([Scenario()], 0.1)
        with pytest.raises(InvalidValue, match=f"observation: {width} quantities, the policy reads {FIRST}"):
            policy.act(np.zeros((1, width), dtype=np.float32), 0.0)
