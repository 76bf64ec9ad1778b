"""Loads that are set down on the seabed, and stay there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from aframe_env import TASKS, HarmonicMotion, InvalidValue, Luffing, Scenario, Sensors, TargetPath, TaskConfig
from aframe_env.scenario import Told
from agents.control.feedback import Feedback
from agents.control.lowering import Following
from agents.control.regulator import Observation
from agents.control.set_down import SettingDown, into_the_ground, lands
from agents.policy import DrumStill, FloatArray, Knowledge, Policy
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
            SettingDown(Following(Feedback(sensors), sensors)),
        )
    )
    assert left.lift_offs.sum() < 0.5 * held.lift_offs.sum()
    assert left.rms.mean() < held.rms.mean()
    # At the end the ground bears all of it: nothing but the rope hangs on the pulley.
    ropes = np.array([s.rope_weight * s.lengths[0] for s in scenarios()])
    np.testing.assert_allclose(left.tension[:, -20:].mean(axis=1), ropes, rtol=0.1)


def test_in_calm_water_it_lands_at_the_speed_of_its_way() -> None:
    calm = [replace(s, motion=HarmonicMotion(harmonics=())) for s in scenarios(3)]
    episodes = run(SettingDown(Following(Feedback(SENSORS), SENSORS)), calm, CONFIG)
    # The ground, which is a spring and a damper, may throw it up once by a hair.
    assert (episodes.landings <= 2).all()
    assert (episodes.landings - episodes.lift_offs == 1).all()
    # The corner at the ground is cut off: it goes on into it.
    np.testing.assert_allclose(episodes.landing_speed, 0.3, atol=0.1)  # it bobs


def test_before_it_is_down_and_elsewhere_the_policy_is_left_alone() -> None:
    short = CONFIG.replaced(episode_duration=20.0)
    plain, wrapped = Following(Feedback(SENSORS), SENSORS), Following(Feedback(SENSORS), SENSORS)
    one, other = run(plain, scenarios(3), short), run(SettingDown(wrapped), scenarios(3), short)
    np.testing.assert_array_equal(one.drum_speed, other.drum_speed)
    holding = [replace(s, target_path=None) for s in scenarios(2)]
    one, other = run(plain, holding, short), run(SettingDown(wrapped), holding, short)
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


def down_by(*corners: tuple[float, float]) -> Scenario:
    return replace(scenarios(1)[0], target_path=TargetPath(corners=corners))


def test_a_way_that_holds_at_its_end_lands_as_if_it_did_not() -> None:
    (scenario,) = scenarios(1)
    assert scenario.target_path is not None
    corners = scenario.target_path.corners
    held = down_by(*corners, (50.0, corners[-1][1]), (55.0, corners[-1][1]))
    assert lands(held)
    assert into_the_ground(held, 3.0) == into_the_ground(scenario, 3.0)
    assert not lands(down_by((15.0, 0.0), (20.0, 0.0)))


def test_a_way_that_ends_slowly_goes_on_into_the_ground_less_slowly() -> None:
    for slow in (1e-3, 1e-6):
        scenario = down_by((15.0, 0.0), (34.0, slow - 6.0), (40.0, -6.0))
        assert scenario.target_path is not None
        told = into_the_ground(scenario, 3.0).target_path
        assert told is not None
        for time in (20.0, 36.0, 38.9):
            assert told.at(time) == pytest.approx(scenario.target_path.at(time), abs=1e-9)
        assert told.at(50.0) == pytest.approx((-7.0, -0.1))
        assert told.at(1e3) == pytest.approx((-9.0, 0.0))


def test_it_goes_into_the_ground_no_further_than_the_rope_reaches_and_by_one_that_does_not_part() -> None:
    (scenario,) = scenarios(1)
    crane = scenario.crane
    # 10 m of rope are left at the ground, of which its stretch takes some, and 100 N of what it bears.
    winch = replace(crane.winch, max_rope_length=scenario.free_length + 16.0)
    most = scenario.hanging_weight + 6.0 * scenario.rope_weight + 100.0
    ends = replace(scenario, crane=replace(crane, winch=winch, rope=replace(crane.rope, breaking_load=most)))
    told = into_the_ground(ends, 100.0)
    assert -16.0 < told.target_levels[0] - scenario.target_level < -12.0
    none = replace(winch, max_rope_length=scenario.free_length + 6.5)
    told = into_the_ground(replace(scenario, crane=replace(crane, winch=none)), 100.0)
    assert told.target_levels == scenario.target_levels


def test_loads_on_soft_ropes_and_under_frames_that_luff_are_left_on_the_ground() -> None:
    (calm,) = (replace(s, motion=HarmonicMotion(harmonics=())) for s in scenarios(1))
    crane = calm.crane
    soft = replace(crane, rope=replace(crane.rope, axial_stiffness=1.5e7))  # stretched by 25 m and more
    out = replace(crane, frame=replace(crane.frame, luffing_angle=-1.2))
    luffing = Luffing.swing(-1.2, 0.0, 60.0, 80.0)
    target = out.pulley_position[2] - crane.pulley_position[2] + calm.target_level
    assert calm.water is not None
    assert calm.water.seabed is not None
    bed = replace(calm.water.seabed, depth=calm.water.seabed.depth - (target - calm.target_level))
    luffed = replace(calm, crane=out, luffing=luffing, target_level=target, water=replace(calm.water, seabed=bed))
    ways = [each.pulley_position[2] + each.drum_to_pulley for each in luffed.cranes]
    assert max(ways) - min(ways) > 9.0  # more than is paid out of it below a frame that holds
    policy = SettingDown(Following(Feedback(SENSORS), SENSORS))
    episodes = run(policy, [replace(calm, crane=soft), luffed], CONFIG, episode_duration=160.0)
    assert (episodes.landings - episodes.lift_offs == 1).all()
    assert (episodes.lift_offs <= 1).all()
    np.testing.assert_allclose(episodes.tension[:, -1], calm.rope_weight * calm.lengths[0], rtol=0.1)


class Spy:
    """Keeps what it is handed."""

    name, knows = "spy", Knowledge.SENSORS

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        self.handed = list(scenarios)

    def act(self, observation: Observation, time: float) -> FloatArray:
        return np.zeros(len(observation))


def test_a_policy_is_handed_what_was_told_and_no_seabed() -> None:
    told = Told(load_mass=55e3, axial_stiffness=1.9e8)
    spy, true = Spy(), [replace(scenario, told=told) for scenario in scenarios(2)]
    run(SettingDown(Following(spy, SENSORS)), true, CONFIG, episode_duration=1.0)
    assert len(spy.handed) == 2
    for each in spy.handed:
        assert (each.load_mass, each.crane.rope.axial_stiffness, each.told) == (55e3, 1.9e8, None)
        assert each.water is not None
        assert each.water.seabed is None


def test_nobody_without_readings_sets_a_load_down() -> None:
    with pytest.raises(InvalidValue, match="policy = 'drum still, following': knows nothing: must have readings"):
        SettingDown(Following(DrumStill()))
    (spec,) = choose_all(["drive-map:clock"])
    policy = spec.policy(BuildContext(scenarios=scenarios(1), config=CONFIG))
    assert isinstance(policy, Following)
    # It runs on the task's own observation, of which it reads the drum's encoder.
    assert np.isfinite(run(policy, scenarios(1), CONFIG, episode_duration=2.0).rms).all()


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
