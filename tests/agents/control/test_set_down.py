"""Loads that are set down on the seabed, and stay there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aframe_env import TASKS, HarmonicMotion, Scenario, Sensors, TargetPath, TaskConfig
from agents.control.feedback import Feedback
from agents.control.lowering import Following
from agents.control.set_down import SettingDown, into_the_ground, lands
from agents.policy import Policy
from agents.registry import BuildContext, choose_all
from agents.rollout import run

LANDING = TASKS["Landing"]
CONFIG = TaskConfig(**LANDING.arguments)
SENSORS = CONFIG.sensors


def scenarios(count: int = 8) -> list[Scenario]:
    return LANDING.scenarios("train", count)


@pytest.mark.parametrize("sensors", [None, SENSORS], ids=["state", "sensors"])
def test_a_load_that_is_set_down_is_lifted_less_often_and_stays_at_its_level(sensors: Sensors | None) -> None:
    config = CONFIG.replaced(observation=sensors or "state")
    held, left = (
        run(policy, scenarios(), config)
        for policy in (
            Following(Feedback(sensors), sensors),
            SettingDown(Following(Feedback(sensors), sensors), sensors),
        )
    )
    assert left.lift_offs.sum() < 0.5 * held.lift_offs.sum()
    assert left.rms.mean() < held.rms.mean()
    # At the end the ground bears all of it: nothing but the rope hangs on the pulley.
    ropes = np.array([s.rope_weight * s.lengths[0] for s in scenarios()])
    np.testing.assert_allclose(left.tension[:, -20:].mean(axis=1), ropes, rtol=0.1)


def test_in_calm_water_it_lands_at_the_speed_of_its_way() -> None:
    calm = [replace(s, motion=HarmonicMotion(harmonics=())) for s in scenarios(3)]
    episodes = run(SettingDown(Following(Feedback(SENSORS), SENSORS), SENSORS), calm, CONFIG)
    # The ground, which is a spring and a damper, may throw it up once by a hair.
    assert (episodes.landings <= 2).all()
    assert (episodes.landings - episodes.lift_offs == 1).all()
    # The corner at the ground is cut off: it goes on into it.
    np.testing.assert_allclose(episodes.landing_speed, 0.3, atol=0.1)  # it bobs


def test_before_it_is_down_and_elsewhere_the_policy_is_left_alone() -> None:
    short = CONFIG.replaced(episode_duration=20.0)
    plain, wrapped = Following(Feedback(SENSORS), SENSORS), Following(Feedback(SENSORS), SENSORS)
    one, other = run(plain, scenarios(3), short), run(SettingDown(wrapped, SENSORS), scenarios(3), short)
    np.testing.assert_array_equal(one.drum_speed, other.drum_speed)
    holding = [replace(s, target_path=None) for s in scenarios(2)]
    one, other = run(plain, holding, short), run(SettingDown(wrapped, SENSORS), holding, short)
    np.testing.assert_array_equal(one.drum_speed, other.drum_speed)


def test_only_a_way_down_to_the_ground_lands() -> None:
    (scenario,) = scenarios(1)
    assert lands(scenario)
    assert not lands(replace(scenario, target_path=TargetPath.lowering(-4.0, 0.3)))
    assert not lands(replace(scenario, target_path=TargetPath.lowering(3.0, 0.3)))
    assert not lands(replace(scenario, target_path=None))
    told = into_the_ground(scenario, 3.0)
    assert scenario.target_path is not None
    assert told.target_path is not None
    for time in (0.0, 14.0, 30.0, scenario.target_path.duration - 2.0):
        assert told.target_path.at(time) == pytest.approx(scenario.target_path.at(time))
    assert told.target_path.at(1e3) == pytest.approx((scenario.target_path.at(1e3)[0] - 3.0, 0.0))


@pytest.mark.parametrize(
    ("name", "kind"),
    [("feed-forward + feedback", SettingDown), ("drum still", Following), ("inverse dynamics", SettingDown)],
)
def test_the_comparison_has_policies_set_loads_down_that_have_readings(name: str, kind: type[Policy]) -> None:
    (spec,) = choose_all([name])
    assert isinstance(spec.policy(BuildContext(scenarios=scenarios(1), config=CONFIG)), kind)
    deep = TASKS["DeepRope"]
    context = BuildContext(scenarios=deep.scenarios("train", 1), config=TaskConfig(**deep.arguments))
    assert not isinstance(spec.policy(context), Following | SettingDown)
