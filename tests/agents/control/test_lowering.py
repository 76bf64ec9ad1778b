"""Policies that follow a target on its way down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aframe_env import (
    Crane,
    Frame,
    HarmonicMotion,
    LoadShape,
    Luffing,
    Rope,
    Scenario,
    Sea,
    SeaMotion,
    Sensors,
    Vessel,
    Water,
    Winch,
    find_task,
)
from aframe_env.config import TaskConfig
from aframe_env.scenario.target import TargetPath
from aframe_env.validation import InvalidValue
from agents.control.feedback import Feedback
from agents.control.inverse_dynamics import InverseDynamics
from agents.control.lowering import Following, PayOut
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.policy import DrumStill, Policy
from agents.rollout import run

DOWN = TargetPath.lowering(-20.0, 0.5, start=5.0, corner_time=8.0)
CALM = HarmonicMotion(harmonics=())
LIGHT = Scenario(motion=CALM, load_mass=50e3, target_level=-100.0, target_path=DOWN, rope_damping=2e4)
HEAVY = Scenario(
    crane=Crane(rope=Rope.six_strand()),
    motion=CALM,
    load_mass=50e3,
    target_level=-1000.0,
    target_path=DOWN,
    water=Water(),
    load=LoadShape(volume=6.4, added_mass_vertical=3e4, drag_area_vertical=20.0),
)
LAYERS = replace(HEAVY, crane=replace(HEAVY.crane, winch=Winch(drum_width=1.5)))


def in_a_sea(scenario: Scenario) -> Scenario:
    sea = Sea(hs=2.0, tp=8.0, heading=2.0, seed=1)
    return replace(scenario, motion=SeaMotion(sea=sea, vessel=Vessel.supply()), ramp=10.0)


@pytest.mark.parametrize("scenario", [LIGHT, HEAVY, LAYERS], ids=["light", "heavy", "layers"])
@pytest.mark.parametrize(
    "policy", [DrumStill(), Feedback(None), PredictiveControl(PlanningConfig(sensors=None))], ids=lambda p: p.name
)
def test_in_calm_water_the_load_ends_at_its_target(policy: Policy, scenario: Scenario) -> None:
    episodes = run(Following(policy), [scenario], episode_duration=60.0)
    end = episodes.error[0, -50:]
    # Nothing but the rope calms what a still drum set bobbing.
    assert abs(end.mean() if policy.name == DrumStill.name else abs(end).max()) < 0.002
    assert episodes.omega2[0] < 0.06


@pytest.mark.parametrize("scenario", [LIGHT, HEAVY, LAYERS], ids=["light", "heavy", "layers"])
@pytest.mark.parametrize("sensors", [None, Sensors()], ids=["state", "sensors"])
def test_in_a_sea_following_is_nearly_as_good_as_holding(scenario: Scenario, sensors: Sensors | None) -> None:
    moving = in_a_sea(scenario)
    holding = replace(moving, target_path=None, target_level=moving.target_level - 10.0)
    see = "state" if sensors is None else "sensors"
    # A mean over the sensors' noise: what a loop leaves on a heavy rope's own waves scatters by a tenth with it.
    still, held, followed = (
        run(policy, [each] * 4, observation=see).rms.mean()
        for policy, each in (
            (DrumStill(), holding),
            (Feedback(sensors), holding),
            (Following(Feedback(sensors), sensors), moving),
        )
    )
    assert followed < held + 0.02
    assert followed < 0.1 * still


@pytest.mark.parametrize("sensors", [None, Sensors()], ids=["state", "sensors"])
def test_while_the_frame_swings_the_load_is_held_as_under_one_that_holds(sensors: Sensors | None) -> None:
    inboard, outboard = np.radians([-40.0, 25.0]).tolist()
    crane = Crane(frame=Frame(luffing_angle=inboard), winch=Winch(min_rope_length=10.0))
    holding = in_a_sea(replace(LIGHT, crane=crane, target_level=-50.0, target_path=None))
    swinging = replace(holding, luffing=Luffing.swing(inboard, outboard, 10.0, 60.0))
    see = "state" if sensors is None else "sensors"
    held = run(Feedback(sensors), [holding], observation=see, episode_duration=80.0).rms[0]
    followed = run(Following(Feedback(sensors), sensors), [swinging], observation=see, episode_duration=80.0)
    blind = run(Feedback(sensors), [swinging], observation=see, episode_duration=80.0)
    assert followed.rms[0] < 1.5 * held
    assert followed.rms[0] < 0.2 * blind.rms[0]
    # Who knows the future knows where the pulley will be.
    assert run(InverseDynamics(), [swinging], episode_duration=80.0).rms[0] < 0.005


def test_a_policy_is_tuned_to_a_rope_that_grows() -> None:
    path = TargetPath.lowering(-160.0, 2.0, start=5.0)
    scenario = in_a_sea(replace(LIGHT, target_level=-40.0, target_path=path))
    holding = replace(scenario, target_level=-200.0, target_path=None)
    policy, fresh = Feedback(None), Feedback(None)
    run(Following(policy), [scenario], episode_duration=100.0)
    run(fresh, [holding], episode_duration=1.0)
    k, wanted = policy._regulator.k, fresh._regulator.k
    assert k == pytest.approx(wanted, rel=0.1)
    assert np.ptp([policy._hoists.frequency[0], fresh._hoists.frequency[0]]) < 0.05  # type: ignore[union-attr]


def test_when_a_policy_is_tuned_anew_goes_by_each_lift_alone() -> None:
    paths = (TargetPath.lowering(-30.0, 1.0, start=5.0), TargetPath.lowering(-30.0, 0.9, start=8.0))
    both = [in_a_sea(replace(THROUGH, target_path=path)) for path in paths]
    policy = Following(PredictiveControl(PlanningConfig(chains=True)), Sensors())
    together = run(policy, both, observation="sensors", episode_duration=45.0).error
    for place, one in enumerate(both):
        alone = run(policy, [one], observation="sensors", episode_duration=45.0, first=place).error
        # But for rounding: how a product of matrices is summed goes by their number.
        np.testing.assert_allclose(together[place], alone[0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    "policy", [Feedback(None), PredictiveControl(PlanningConfig(sensors=None))], ids=lambda p: p.name
)
def test_a_lift_that_keeps_its_rope_is_left_alone_when_another_is_tuned(policy: Policy) -> None:
    still = in_a_sea(replace(HEAVY, target_path=TargetPath.lowering(-5.0, 0.5, start=5.0)))
    together, alone = (
        run(Following(policy), scenarios, episode_duration=15.0).drum_speed[0]
        for scenarios in ([still, in_a_sea(THROUGH)], [still])
    )
    # The law hardly holds this load in this sea: another rounding in its gains would soon make millimetres.
    np.testing.assert_allclose(together, alone, rtol=0.0, atol=1e-9)


def test_the_plan_is_the_rope_at_rest() -> None:
    plan = PayOut.weighed(HEAVY, HEAVY.hanging_weight)
    assert plan.weight == pytest.approx(HEAVY.weight, rel=1e-9)
    below = replace(HEAVY, target_level=-1020.0, target_path=None)
    assert plan.at(0.0).length == pytest.approx(HEAVY.free_length, abs=1e-6)
    assert plan.at(60.0).length == pytest.approx(below.free_length, abs=1e-6)
    assert plan.at(60.0).tension == pytest.approx(below.hanging_weight, rel=1e-9)


THROUGH = replace(
    HEAVY,
    target_level=-2.0,  # 3 m above the water
    target_path=TargetPath.lowering(-12.0, 0.5, start=5.0, corner_time=0.01),
    load=replace(HEAVY.load, height=4.0),
)


@pytest.mark.parametrize("depth", [-3.0, -1.0, 0.0, 1.5, 6.0])
def test_the_plan_has_as_much_of_the_load_wet_as_hangs_in_the_water(depth: float) -> None:
    there = replace(THROUGH, target_level=THROUGH.water.surface_level - depth, target_path=None)  # type: ignore[union-attr]
    now = 5.0 + (THROUGH.target_level - there.target_level) / 0.5
    planned = PayOut.weighed(THROUGH, THROUGH.hanging_weight).at(now)
    drag = 0.5 * 1025.0 * 0.5**2 * 20.0 * (there.share_under_water if now > 5.0 else 0.0)
    assert planned.wet == there.share_under_water
    assert planned.length == pytest.approx(there.free_length, abs=1e-3)
    assert planned.tension == pytest.approx(there.hanging_weight - drag, abs=20.0)  # drag of 10 m of rope beside


def test_a_policy_is_tuned_to_a_load_that_gets_wet() -> None:
    policy = Feedback(None)
    for seconds, level in ((1.0, THROUGH.target_level), (60.0, THROUGH.target_level - 12.0)):
        run(Following(policy), [THROUGH], episode_duration=seconds)
        rope = THROUGH.crane.rope.mass_per_length * (THROUGH.crane.pulley_position[2] - level) / 3.0
        wet = 3e4 if seconds == 60.0 else 0.0
        assert policy._hoists is not None
        assert policy._hoists.mass[0] == pytest.approx(THROUGH.load_mass + wet + rope, rel=2e-3)


def test_predictive_control_does_not_shake_a_load_above_the_water() -> None:
    """Taken for wet there it would be thought half as quick as it is, and be driven on until the rope hangs slack."""
    task = find_task("Splash")
    config = TaskConfig(**task.arguments)
    assert config.sensors
    scenarios = task.scenarios("validation", 4)
    policy = Following(PredictiveControl(PlanningConfig(sensors=config.sensors)), config.sensors)
    episodes = run(policy, scenarios, config, episode_duration=15.0)
    assert not episodes.slack_events.any()


def test_sensors_go_with_a_policy_on_sensors() -> None:
    with pytest.raises(InvalidValue, match="sensors = None: feed-forward"):
        Following(Feedback())
    with pytest.raises(InvalidValue, match="sensors = given"):
        Following(InverseDynamics(), Sensors())
