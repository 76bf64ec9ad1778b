"""Control laws with heavy ropes in water."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aframe_env import (
    Crane,
    Harmonic,
    HarmonicMotion,
    LoadShape,
    Rope,
    Scenario,
    Sea,
    SeaMotion,
    Sensors,
    TaskConfig,
    Vessel,
    Water,
    Winch,
)
from aframe_env.scenario.crane import GRAVITY
from aframe_env.simulation import Simulation
from aframe_env.task import STATE
from agents.control.feedback import Feedback
from agents.control.inverse_dynamics import InverseDynamics, RequiredRope
from agents.control.lift import unweighed
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.control.regulator import HoistBatch
from agents.drives.forecast import Harmonics
from agents.drives.map import DriveMap, ideal_ratio
from agents.learned.feature_policy import FeaturePolicy
from agents.policy import DrumStill, Policy
from agents.rollout import run

PERIOD = 0.1
HEAVY = Crane(rope=Rope.six_strand())
SHAPE = LoadShape(volume=6.4, added_mass_vertical=3e4, drag_area_vertical=20.0, drag_area_horizontal=20.0)


def at_depth(level: float, seed: int = 0) -> Scenario:
    sea = Sea(hs=2.5, tp=8.0, heading=2.0, seed=seed)
    return Scenario(
        crane=HEAVY,
        motion=SeaMotion(sea=sea, vessel=Vessel.supply()),
        load_mass=5e4,
        target_level=level,
        ramp=10.0,
        water=Water(current=((0.0, 0.3, 0.1),)),
        load=SHAPE,
    )


DEEP = [at_depth(-60.0), at_depth(-1000.0), at_depth(-2500.0, 1)]


@pytest.mark.parametrize(
    "scenario",
    [
        *DEEP[1:],
        replace(DEEP[1], water=None, load=LoadShape()),
        replace(DEEP[1], crane=Crane()),
        Scenario.paper(),
    ],
)
def test_what_the_tension_at_rest_leaves_unsaid(scenario: Scenario) -> None:
    known = unweighed(scenario)
    below = scenario.lengths[0]
    moved = scenario.hanging_weight / GRAVITY + known.fixed + known.by_length * below
    assert moved == pytest.approx(scenario.moved_mass, rel=1e-9)
    strain = known.softness * scenario.hanging_weight
    assert strain == (0.0 if scenario.is_light else pytest.approx(scenario.pulley_strain))
    if known.slowness:
        # A bar that is held at both ends.
        rope = scenario.crane.rope
        first = np.pi / below * np.sqrt(rope.axial_stiffness / rope.mass_per_length)
        assert np.pi / (known.slowness * below) == pytest.approx(first)


def test_loads_are_weighed_without_their_mass() -> None:
    observation = np.zeros((2, len(STATE)), dtype=np.float32)
    names = [quantity.name for quantity in STATE]
    for row, scenario in enumerate(DEEP[1:]):
        observation[row, names.index("rope_tension")] = scenario.hanging_weight
        observation[row, names.index("rope_length")] = scenario.free_length
    hoists = HoistBatch(2, PERIOD, STATE)
    hoists.start(DEEP[1:], observation)
    assert hoists.mass == pytest.approx([s.moved_mass for s in DEEP[1:]], rel=1e-3)
    assert hoists.frequency == pytest.approx([s.rope_frequency for s in DEEP[1:]], rel=1e-3)
    # A pin that reads nothing: still a load.
    observation[:, names.index("rope_tension")] = 0.0
    hoists.start(DEEP[1:], observation)
    assert (hoists.mass > 0.0).all()
    assert np.isfinite(hoists.frequency).all()


@pytest.mark.parametrize(
    ("law", "bar"),
    [
        (Feedback(None), 0.02),
        (PredictiveControl(PlanningConfig(sensors=None)), 0.02),
        (InverseDynamics(), 0.02),
        (Feedback(), 0.06),
        (PredictiveControl(), 0.05),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_laws_hold_loads_on_heavy_ropes(law: Policy, bar: float) -> None:
    """As a share of what a still drum leaves, at any depth: the rope's own waves are not driven on."""
    observation = "state" if "state" in law.name or isinstance(law, InverseDynamics) else Sensors()
    held = run(law, DEEP, observation=observation, episode_duration=30.0).rms
    still = run(DrumStill(), DEEP, episode_duration=30.0).rms
    assert (held < bar * still).all(), held / still


def test_a_map_of_light_ropes_allows_for_the_strain_at_the_pulley() -> None:
    """A ratio that is exact for light ropes pays out 1 / (1 + e) of the heave on heavy ones."""
    axes = [np.array(axis) for axis in ((0.5, 3.0), (5.0, 15.0), (1e4, 3e5), (50.0, 3000.0))]
    exact = np.broadcast_to(1.0 / (1.0 + axes[2] * GRAVITY / 2e8), (2, 2, 2, 2)).transpose(0, 1, 3, 2)
    light = DriveMap(*axes, ratio=exact.astype(np.complex128), remaining=np.zeros((2, 2, 2, 2)))
    heave = Harmonics(np.array([1.5]), np.array([0.7]), np.array([0.0]))
    for scenario in DEEP:
        drive = light.drive(scenario, heave, 30.0)
        assert drive.variables[0] * 0.75 == pytest.approx(1.5 * ideal_ratio(scenario), rel=1e-4)
        assert ideal_ratio(scenario) == pytest.approx(1.0 / (1.0 + scenario.hanging_weight / 2e8))


def test_agents_predict_with_the_water_that_is_set() -> None:
    """As in the rollout, where the scenario tells it."""
    policy = FeaturePolicy(lambda features: np.clip(0.1 * features[:, 0], -1.0, 1.0))
    policy.crane, policy.water, policy.load = HEAVY, DEEP[1].water, SHAPE
    simulation = Simulation(1, TaskConfig(scenario=DEEP[1]))
    simulation.reset_rows(np.arange(1), [(DEEP[1], 0)])
    twin = FeaturePolicy(policy._function)
    twin.reset([DEEP[1]], PERIOD)
    memory = None
    for step in range(20):
        observation = simulation.observe()
        predicted, memory = policy.predict(observation, memory)
        command = twin.act(observation, step * PERIOD)
        np.testing.assert_array_equal(predicted[:, 0], command.astype(np.float32))
        simulation.advance(command)


def test_light_rows_keep_their_bits_beside_heavy_ones() -> None:
    light = Scenario.paper(ramp=5.0)
    for law in (InverseDynamics(), PredictiveControl(PlanningConfig(sensors=None)), Feedback()):
        observation = Sensors() if isinstance(law, Feedback) else "state"
        mixed = run(law, [light, *DEEP[:2]], observation=observation, episode_duration=4.0)
        for row, scenario in enumerate([light, *DEEP[:2]]):
            alone = run(law, [scenario], observation=observation, episode_duration=4.0, first=row)
            np.testing.assert_array_equal(alone.drum_speed[0], mixed.drum_speed[row])


def test_required_rope_is_that_of_a_rope_at_rest() -> None:
    """For a pulley that has risen: what holds the load at rest as far below it, by the rope's own statics."""
    heave = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=2.0, period=20.0),))
    scenario = replace(DEEP[2], motion=heave, ramp=0.0, initial="rest")
    rope = RequiredRope([scenario], PERIOD)
    for step in range(100):
        rope.advance()
        time = 0.05 * (step + 1)
    deeper = replace(scenario, target_level=scenario.target_level - 2.0 * np.sin(2.0 * np.pi * time / 20.0))
    # The load swings a little in the current, and the rope is longer by that.
    assert rope.now()[0] == pytest.approx(deeper.free_length - scenario.free_length, abs=1e-3)


def test_laws_reckon_with_the_layer_that_the_rope_runs_off() -> None:
    """On a drum of many layers the laws do as well as on a plain one."""
    plain = replace(at_depth(-200.0), ramp=10.0)
    layered = replace(plain, crane=Crane(rope=HEAVY.rope, winch=Winch(drum_width=1.5)))
    assert layered.crane.drum_radius(layered.free_length) > 1.1 * layered.crane.winch.drum_radius
    for policy, observation in (
        (Feedback(sensors=None), "state"),
        (Feedback(), "sensors"),
        (InverseDynamics(), "state"),
    ):
        task = TaskConfig(observation=observation)
        rms = [float(run(policy, [each], task).rms[0]) for each in (plain, layered)]
        assert rms[1] < 1.3 * rms[0] + 1e-3


def test_predictive_control_leaves_the_waves_in_the_rope_alone() -> None:
    """100 t at 1,500 m: poles nearer to the rope's own waves drove these on, to a decimetre."""
    shape = LoadShape(volume=12.7, added_mass_vertical=8e4, drag_area_vertical=60.0)
    sea = SeaMotion(sea=Sea(hs=1.5, tp=9.0, heading=3.0))
    scenario = replace(at_depth(-1500.0), load_mass=1e5, load=shape, motion=sea, water=Water())
    config = TaskConfig(observation="sensors", episode_duration=120.0)
    assert run(PredictiveControl(), [scenario], config).rms[0] < 0.03
