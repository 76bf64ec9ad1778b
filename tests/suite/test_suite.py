"""Tasks of the suite: what Gymnasium makes of them, that their scenarios stay as they are, and who is told what."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from aframe_env import TASKS, InvalidValue, ScenarioDistribution, TaskConfig, find_task
from aframe_env.suite import SPLITS
from aframe_env.task import SENSED
from agents.control.optimum import saturating
from agents.policy import Knowledge
from agents.registry import BuildContext, choose_all
from agents.rollout import HELD_OUT_SEED, run

IDS = [task.id for task in TASKS.values()]
STORM, UNKNOWN, MRU = TASKS["Storm"], TASKS["Unknown"], TASKS["MRU"]
SPLASH, LANDING = TASKS["Splash"], TASKS["Landing"]


def test_every_task_is_registered_and_nothing_else():
    registered = {name for name in gymnasium.registry if name.startswith("AFrameHeave-")}
    assert registered == {"AFrameHeave-v0", *IDS}
    assert [find_task(text) for text in ("Storm", "storm", STORM.id)] == [STORM] * 3


@pytest.mark.parametrize("env_id", IDS)
@pytest.mark.parametrize("observation", ["state", "sensors"])
@pytest.mark.filterwarnings("ignore:.*symmetric and normalized.*")  # actions are rad/s by design
def test_gymnasium_has_nothing_to_say(env_id, observation):
    check_env(gymnasium.make(env_id, observation=observation).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("env_id", IDS)
def test_a_row_of_many_is_the_scalar_environment(env_id):
    rows = gymnasium.make_vec(env_id, num_envs=3, vectorization_mode="vector_entry_point")
    alone = gymnasium.make(env_id)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-2.0, 2.0, (50, 3, 1)).astype(np.float32)
    together = [rows.reset(seed=7)[0], *(rows.step(action)[0] for action in actions)]
    for row in range(3):
        one = [alone.reset(seed=7 + row)[0], *(alone.step(action[row])[0] for action in actions)]
        assert np.array_equal(np.array(together)[:, row], np.array(one))


@pytest.mark.parametrize("task", TASKS.values(), ids=list(TASKS))
def test_an_environment_is_the_task_but_for_what_the_user_says(task):
    def config(env_id: str = task.id, **arguments: Any) -> TaskConfig:
        return gymnasium.make(env_id, **arguments).unwrapped.simulation.config  # type: ignore[attr-defined]

    assert config() == TaskConfig(**task.arguments) == config("AFrameHeave-v0", task=task.name)
    assert config().source == task.distribution
    assert config(control_period=0.2) == TaskConfig(**{**task.arguments, "control_period": 0.2})
    assert config(config={"control_period": 0.2}) == config(config=TaskConfig(control_period=0.2))
    assert config(config=TaskConfig(control_period=0.2)) == config(control_period=0.2)
    calm = ScenarioDistribution(hs=1.0)
    assert config(scenario=calm).source == config(config=TaskConfig(scenario=calm)).source == calm
    assert config(scenario=calm).observation == "sensors"
    assert config(observation="state").observation == "state"
    assert config(max_episode_steps=20).steps == 20


@pytest.mark.parametrize("env_id", IDS)
def test_a_spec_makes_the_same_task_again(env_id):
    env = gymnasium.make(env_id, observation="state", control_period=0.2)
    text = env.spec.to_json()
    assert json.loads(text)["id"] == env_id
    again = gymnasium.make(EnvSpec.from_json(text))
    assert again.unwrapped.simulation.config.observation == "state"
    assert np.array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])
    assert again.unwrapped.scenario.crane == env.unwrapped.scenario.crane


def test_a_task_that_is_none_is_refused():
    with pytest.raises(InvalidValue, match=r"task = 'Calm': must be one of 'Storm', 'Unknown', 'DeepRope'"):
        gymnasium.make("AFrameHeave-v0", task="Calm")
    with pytest.raises(InvalidValue, match="task = 3"):
        TaskConfig(**find_task(3).arguments)  # type: ignore[arg-type]


def test_splits_are_apart_and_do_not_depend_on_the_count():
    seeds = [task.seed(split) for task in TASKS.values() for split in SPLITS]
    assert len({*seeds, HELD_OUT_SEED}) == len(seeds) + 1
    for task in TASKS.values():
        assert task.scenarios("test", 3) == task.scenarios("test", 5)[:3]


@pytest.mark.parametrize("task", TASKS.values(), ids=list(TASKS))
def test_the_scenarios_are_those_that_were_frozen(task):
    assert [task.require_frozen(split) for split in SPLITS] == list(task.digests.values())


@pytest.mark.parametrize(
    "change",
    [
        {"hs": (3.0, 5.001)},
        {"components": 33},
        {"max_rope_acceleration": (1.0, 2.001)},
        {"told_mass_error": 0.001},
        {"sensor_delay": 0.1},
        {"ramp": 10.001},
    ],
)
def test_a_change_of_what_is_drawn_is_noticed(change):
    other = replace(STORM, distribution=replace(STORM.distribution, **change))
    with pytest.raises(InvalidValue, match=r"AFrameHeave-Storm-v0: the scenarios of the split 'test' have the digest"):
        other.require_frozen("test")


@pytest.mark.parametrize(
    "change", [{"heave_period": (18.0, 22.5)}, {"lever_arm_error": 0.6}, {"dropouts": 2.1}, {"angle_bias": 0.0}]
)
def test_a_change_of_what_is_drawn_of_the_motion_unit_is_noticed(change):
    sensors = MRU.distribution.sensors
    changed = replace(sensors, motion_unit=replace(sensors.motion_unit, **change))
    other = replace(MRU, distribution=replace(MRU.distribution, sensors=changed))
    with pytest.raises(InvalidValue, match=r"AFrameHeave-MRU-v0: the scenarios of the split 'test' have the digest"):
        other.require_frozen("test")


def test_in_storm_most_winches_saturate_and_all_is_told_truly():
    scenarios = STORM.scenarios("test", 100)
    assert 85 <= saturating(scenarios, TaskConfig(**STORM.arguments)).sum() <= 95
    assert all(scenario.as_told is scenario for scenario in scenarios)
    for scenario in scenarios:
        winch = scenario.crane.winch
        assert 1.5 <= winch.max_rope_speed <= 2.5
        assert 1.0 <= winch.max_rope_acceleration <= 2.0
        assert 3.0 <= scenario.motion.sea.hs <= 5.0
        assert 7.0 <= scenario.motion.sea.tp <= 12.0


class Spy:
    """Looks for the truth wherever a policy is let."""

    name, knows = "spy", Knowledge.SENSORS

    def reset(self, scenarios, control_period):
        self.handed = list(scenarios)
        self.masses = []

    def act(self, observation, time):
        self.masses.append(observation[:, [quantity.name for quantity in SENSED].index("load_mass")])
        return np.zeros(len(observation))


def test_in_unknown_a_policy_comes_by_nothing_but_what_was_told():
    scenarios, spy = UNKNOWN.scenarios("test", 20), Spy()
    run(spy, scenarios, TaskConfig(**UNKNOWN.arguments), episode_duration=1.0)
    for handed, true in zip(spy.handed, scenarios, strict=True):
        assert (handed.crane.rope.axial_stiffness, handed.crane.winch.lag, handed.sensor_delay) == (2.0e8, 0.15, 0.2)
        assert handed.told is None
        assert 0.0 < abs(handed.load_mass / true.load_mass - 1.0) <= 0.2
    told = np.array([handed.load_mass for handed in spy.handed], dtype=np.float32)
    assert all(np.array_equal(seen, told) for seen in spy.masses)


def test_in_unknown_readings_are_as_late_as_is_and_not_as_told():
    # Perfect instruments, so that nothing but the delay is between a motion and its reading.
    perfect = {name: {} for name in ("heave", "heave_rate", "roll", "pitch", "drum_speed", "tension", "depth_error")}
    rows = gymnasium.make_vec(
        UNKNOWN.id,
        num_envs=8,
        vectorization_mode="vector_entry_point",
        observation={"delay": 0.2, **perfect},
        autoreset_mode=AutoresetMode.DISABLED,
    )
    seen, true = [rows.reset(seed=1)[0]], [rows.unwrapped.simulation.state.copy()]
    for _ in range(300):
        seen.append(rows.step(np.zeros((8, 1), np.float32))[0])
        true.append(rows.unwrapped.simulation.state.copy())
    times = 0.1 * np.arange(len(seen))
    heave, heard = np.array(true)[:, :, 6], np.array(seen)[:, :, 0]
    for row, scenario in enumerate(rows.unwrapped.scenarios):
        late = np.interp(times[100:] - scenario.sensor_delay, times, heave[:, row])
        np.testing.assert_allclose(heard[100:, row], late, atol=1e-5)
        assert scenario.sensor_delay != pytest.approx(0.2, abs=1e-3)


def test_in_mru_the_ship_moves_at_the_start_and_the_load_hangs_on_it():
    rows = gymnasium.make_vec(MRU.id, num_envs=32, vectorization_mode="vector_entry_point")
    rows.reset(seed=3)
    state = rows.unwrapped.simulation.state
    # The load is off its level by the pulley's heave, and goes with it: the rope is as taut as at rest.
    np.testing.assert_allclose(state[:, 0], state[:, 6], rtol=0, atol=1e-9)
    np.testing.assert_allclose(state[:, 1], state[:, 7], rtol=0, atol=1e-9)
    assert state[:, 6].std() > 0.3
    weights = np.array([scenario.weight for scenario in rows.unwrapped.scenarios])
    # But for the horizontal way of the pulley, which the drum has not.
    np.testing.assert_allclose(state[:, 11], weights, rtol=0.3)


def test_in_mru_a_policy_comes_by_nothing_but_what_was_told():
    scenarios, spy = MRU.scenarios("test", 20), Spy()
    config = TaskConfig(**MRU.arguments)
    run(spy, scenarios, config, episode_duration=1.0)
    assert {handed.sensor_delay for handed in spy.handed} == {0.2}
    true = [scenario.sensor_delay for scenario in scenarios]
    assert 0.1 <= min(true) < 0.2 < max(true) <= 0.4
    # Whatever the seed of the noise draws of the unit, what is known of it is the task's.
    assert config.sensors == MRU.distribution.sensors
    assert all(handed.motion == each.motion for handed, each in zip(spy.handed, scenarios, strict=True))


def test_in_mru_what_is_read_is_not_what_the_pulley_does():
    rows = gymnasium.make_vec(MRU.id, num_envs=16, vectorization_mode="vector_entry_point")
    seen, true = [rows.reset(seed=1)[0]], [rows.unwrapped.simulation.state.copy()]
    for _ in range(599):
        seen.append(rows.step(np.zeros((16, 1), np.float32))[0])
        true.append(rows.unwrapped.simulation.state.copy())
    read, rate = np.array(seen)[:, :, 1], np.array(true)[:, :, 7]
    errors = (read - rate).std(axis=0) / rate.std(axis=0)
    assert 0.2 < np.median(errors) < 0.6
    # A delay or a lead does not mend it, not even the best one in each episode.
    shifted = [np.roll(read, k, axis=0)[10:-10] - rate[10:-10] for k in range(-10, 11)]
    assert np.median(np.min([each.std(axis=0) for each in shifted], axis=0) / rate.std(axis=0)) > 0.2


def lowered(task, policies):
    """Episodes of drums and laws in a dozen scenarios of a task whose target moves."""
    scenarios, config = task.scenarios("train", 12), TaskConfig(**task.arguments)
    context = BuildContext(scenarios=scenarios, config=config)
    return scenarios, [run(spec.policy(context), scenarios, config) for spec in choose_all(policies)]


def test_in_splash_loads_go_from_the_air_through_the_surface_and_ropes_go_slack():
    scenarios, (law, still) = lowered(SPLASH, ["feed-forward + feedback", "drum still"])
    for scenario in scenarios:
        change, rate = scenario.target_path.at(60.0)
        water, half = scenario.water.surface_level, 0.5 * scenario.load.height
        assert scenario.target_level - half > water  # dry at first, in calm water
        assert scenario.target_level + change + half < water - 10.0 < water
        assert change > -20.0 > change + 60.0 * rate  # still on its way at the end
        assert scenario.weight == pytest.approx(9.81 * scenario.load_mass)
    assert not still.parted.any()
    assert still.slack_events.sum() > law.slack_events.sum()
    # A drum that does not look at the sea still brings the load down.
    assert (still.rms < 3.0).all()


def test_in_landing_loads_come_down_on_the_ground_where_the_target_ends():
    scenarios, (law, still) = lowered(LANDING, ["feed-forward + feedback", "drum still"])
    for scenario in scenarios:
        assert scenario.target_levels[0] == pytest.approx(scenario.bed_level)
    for episodes in (law, still):
        assert (episodes.landings >= 1).all()
        # Each comes off the ground as often as it comes down on it, or once less.
        assert np.isin(episodes.landings - episodes.lift_offs, (0, 1)).all()
        assert (episodes.landing_speed > 0.0).all()
    assert np.quantile(law.landing_speed, 0.5) < np.quantile(still.landing_speed, 0.5)
