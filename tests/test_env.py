"""The environments: the reference trajectory, Gymnasium's checks, and scalar against vector."""

from __future__ import annotations

import copy
import pickle
import warnings
from importlib.resources import files

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from aframe_env import InvalidValue, Scenario, ScenarioDistribution, Sea

STILL = np.zeros(1, dtype=np.float32)


def test_reference_trajectory_of_the_paper() -> None:
    path = files("aframe_env") / "data" / "reference" / "dynamic_paper_rigid.csv"
    reference = np.genfromtxt(str(path), delimiter=",", names=True)
    env = gymnasium.make("AFrameHeave-v0", scenario=Scenario.paper(), control_period=0.05)
    env.reset(seed=0)
    for row in reference[1:]:
        _, _, _, _, info = env.step(STILL)
        expected = [row["xL1_m"], row["xL2_m"], row["xL3_m"]]
        assert np.abs(info["load_position"] - expected).max() < 1e-4


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_gymnasium_check(observation: str) -> None:
    env = gymnasium.make("AFrameHeave-v0", observation=observation).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Actions are rad/s by design, as Pendulum-v1's are N m.
        warnings.filterwarnings("ignore", message=".*symmetric and normalized.*")
        check_env(env, skip_render_check=True)


@pytest.mark.parametrize("observation", ["state", "sensors"])
def test_stable_baselines3_check(observation: str) -> None:
    env = gymnasium.make("AFrameHeave-v0", observation=observation)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Actions are rad/s by design; what trains rescales them.
        warnings.filterwarnings("ignore", message="We recommend you to use a symmetric and normalized Box action space")
        sb3_check_env(env, warn=True, skip_render_check=True)


def test_return_is_minus_omega1() -> None:
    env = gymnasium.make("AFrameHeave-v0", episode_duration=20.0)
    env.reset(seed=3)
    rng = np.random.default_rng(0)
    total, done = 0.0, False
    while not done:
        _, reward, terminated, truncated, info = env.step(rng.uniform(-1.0, 1.0, 1).astype(np.float32))
        total += float(reward)
        done = terminated or truncated
    assert total == pytest.approx(-info["omega1"], rel=1e-12)
    assert info["time"] == pytest.approx(20.0)


@pytest.mark.parametrize("observation", ["state", "sensors"])
@pytest.mark.parametrize("rows", [2, 70])
def test_scalar_row_is_vector_row(rows: int, observation: str) -> None:
    arguments = {"episode_duration": 3.0, "observation": observation}
    vector = gymnasium.make_vec("AFrameHeave-v0", num_envs=rows, vectorization_mode="vector_entry_point", **arguments)
    k = rows - 1
    scalar = gymnasium.make("AFrameHeave-v0", **arguments)
    observations, _ = vector.reset(seed=10)
    expected, _ = scalar.reset(seed=10 + k)
    rng = np.random.default_rng(1)
    done = False
    for _ in range(70):
        actions = rng.uniform(-2.0, 2.0, (rows, 1)).astype(np.float32)
        np.testing.assert_array_equal(observations[k], expected)
        observations, rewards, terminations, truncations, _ = vector.step(actions)
        if done:
            expected, _ = scalar.reset()
            reward, terminated, truncated = 0.0, False, False
        else:
            expected, reward, terminated, truncated, _ = scalar.step(actions[k])
        assert (rewards[k], terminations[k], truncations[k]) == (reward, terminated, truncated)
        done = terminated or truncated


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_go_on_identically(clone: object) -> None:
    env = gymnasium.make("AFrameHeave-v0", observation="sensors").unwrapped
    env.reset(seed=4)
    for _ in range(20):
        env.step(np.array([0.3], dtype=np.float32))
    twin = clone(env)  # type: ignore[operator]
    for _ in range(20):
        np.testing.assert_array_equal(env.step(STILL)[0], twin.step(STILL)[0])
    np.testing.assert_array_equal(env.reset()[0], twin.reset()[0])


def test_state_goes_back() -> None:
    env = gymnasium.make("AFrameHeave-v0").unwrapped
    env.reset(seed=4)
    state = env.get_state()
    first = [env.step(np.array([1.0], dtype=np.float32))[1] for _ in range(10)] + [env.reset()[0][6]]
    env.set_state(state)
    again = [env.step(np.array([1.0], dtype=np.float32))[1] for _ in range(10)] + [env.reset()[0][6]]
    assert first == again


def test_sea_draws_do_not_depend_on_the_load() -> None:
    a = ScenarioDistribution().draw(np.random.default_rng(0))
    b = ScenarioDistribution(load_mass=5e4).draw(np.random.default_rng(0))
    assert a.motion.sea == b.motion.sea
    assert a.target_level == b.target_level
    assert b.load_mass == 5e4


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Scenario.paper(load_mass=-1.0), r"load_mass = -1.0 kg: must be in \[0.001"),
        (lambda: Scenario.paper(target_level=20.0), r"target_level = 20.0 m"),
        (lambda: ScenarioDistribution(rope_length=0.0), r"rope_length = 0.0 m"),
        (lambda: Sea(hs=1.0, tp=8.0, spectrum="flat"), r"spectrum = 'flat'"),
        (lambda: gymnasium.make("AFrameHeave-v0", model="x"), r"model = 'x'"),
        (lambda: gymnasium.make("AFrameHeave-v0", control_period=-1.0), r"control_period = -1.0 s"),
        (lambda: gymnasium.make("AFrameHeave-v0", observation="x"), r"observation = 'x'"),
    ],
)
def test_bad_input(make: object, message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        make()  # type: ignore[operator]


def test_bad_actions() -> None:
    env = gymnasium.make("AFrameHeave-v0").unwrapped
    env.reset(seed=0)
    with pytest.raises(InvalidValue, match="must be finite"):
        env.step(np.array([np.nan], dtype=np.float32))
    with pytest.raises(InvalidValue, match="shape"):
        env.step(np.zeros(2, dtype=np.float32))
    for action in ("left", ["x"], {"speed": 1.0}):
        with pytest.raises(InvalidValue, match=r"action = .*: must be an array of numbers, rad/s"):
            env.step(action)  # type: ignore[arg-type]
