"""What Gymnasium's ``make`` and ``EnvSpec`` do with the environment: JSON and back, lengths, names, missing extras."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import TimeAwareObservation
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv

from aframe_env import (
    Crane,
    InvalidValue,
    RecordedMotion,
    Rope,
    Scenario,
    ScenarioDistribution,
    Sea,
    SeaMotion,
    Sensors,
    TaskConfig,
    Vessel,
    Winch,
    scenario_text,
)
from aframe_env.rfem.structure import Division
from agents import AgentInterface

ROOT = Path(__file__).parents[1]
ID = "AFrameHeave-v0"
SENSORS = Sensors(delay=0.2, mass_told=False)


def rollout(env: Any, steps: int = 20, rows: int | None = None) -> list[bytes]:
    """Observations, rewards and information, to the last bit."""
    rng = np.random.default_rng(0)
    shape = (1,) if rows is None else (rows, 1)
    observation, info = env.reset(seed=5)
    met = [observation.tobytes()]
    for _ in range(steps):
        observation, reward, _, _, info = env.step(rng.uniform(-1.0, 1.0, shape).astype(np.float32))
        met += [observation.tobytes(), np.float64(reward).tobytes(), info["omega1"].tobytes()]
    return met


def record(path: Path) -> Path:
    """A recorded motion as CSV: heave of 1.3 m and 8 s."""
    times = np.arange(0.0, 70.0, 0.25)
    lines = [f"{t},0,0,{1.3 * math.sin(2.0 * math.pi * t / 8.0)!r},0,0,0" for t in times.tolist()]
    path.write_text("\n".join(["time_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg", *lines]))
    return path


CASES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "scenario": {"scenario": Scenario.paper(load_mass=6.0e4, rope_damping=1.0 / 3.0)},
    "sea": {"scenario": Scenario(motion=SeaMotion(sea=Sea(hs=2.0, tp=9.0, seed=2**53 - 1)), gravity=9.81)},
    "distribution": {"scenario": ScenarioDistribution(hs=(1.0, 2.0), gamma=3.3, crane=Crane(winch=Winch(lag=0.1)))},
    "vessel": {
        "scenario": ScenarioDistribution(vessel=Vessel.from_csv(Vessel.supply().path or "", deck_position=(-30, 1, 5)))
    },
    "sensors": {"observation": SENSORS},
    "config": {"config": TaskConfig(control_period=0.2, observation=SENSORS), "episode_duration": 30.0},
    "numbers": {"control_period": np.float32(0.2), "max_inner_step": 0.01},
    "full model": {"model": "rfem", "rfes": (2, 2), "rfem_modes": 3},
    "longer": {"max_episode_steps": 700},
}


@pytest.mark.parametrize("arguments", CASES.values(), ids=CASES.keys())
def test_a_spec_comes_back_from_json_with_the_same_task(arguments: dict[str, Any]) -> None:
    env = gymnasium.make(ID, **arguments)
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    assert rollout(again) == rollout(env)
    assert again.unwrapped.simulation.episode_steps == env.unwrapped.simulation.episode_steps
    assert json.loads(again.spec.to_json())["kwargs"] == json.loads(env.spec.to_json())["kwargs"]


@pytest.mark.parametrize("arguments", CASES.values(), ids=CASES.keys())
def test_a_vector_spec_comes_back_from_json_with_the_same_task(arguments: dict[str, Any]) -> None:
    envs = gymnasium.make_vec(ID, num_envs=3, autoreset_mode=AutoresetMode.SAME_STEP, **arguments)
    again = gymnasium.make_vec(EnvSpec.from_json(envs.spec.to_json()))
    assert rollout(again, rows=3) == rollout(envs, rows=3)
    assert again.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP


@pytest.mark.parametrize("kind", ["scenario", "distribution"])
def test_a_file_s_task_comes_back_wherever_the_json_is_read(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(tmp_path / "deck.csv")
    (tmp_path / "mine.toml").write_text(
        '[motion]\nkind = "recorded"\nfile = "deck.csv"\n'
        if kind == "scenario"
        else 'kind = "distribution"\nrecords = ["deck.csv"]\n'
    )
    monkeypatch.chdir(tmp_path)
    env = gymnasium.make(ID, scenario=Path("mine.toml"))
    written = env.spec.to_json()
    monkeypatch.chdir(ROOT)
    assert rollout(gymnasium.make(EnvSpec.from_json(written))) == rollout(env)


def test_wrappers_come_back_too() -> None:
    made = AgentInterface(gymnasium.make(ID, observation=SENSORS), reward_knee=math.inf, horizon=12.0)
    env = TimeAwareObservation(made)
    assert rollout(gymnasium.make(EnvSpec.from_json(env.spec.to_json()))) == rollout(env)


def test_a_record_without_a_file_makes_the_task_again_but_no_json() -> None:
    times = np.arange(0.0, 70.0, 0.25)
    motion = RecordedMotion(times=times, coordinates=np.sin(times)[:, None] * np.eye(6)[2])
    env = gymnasium.make(ID, scenario=Scenario(motion=motion))
    assert rollout(gymnasium.make(env.spec)) == rollout(env)
    with pytest.raises(TypeError, match="not JSON serializable"):
        env.spec.to_json()


def test_plain_arguments_go_where_gymnasium_keeps_them_as_they_are() -> None:
    config = TaskConfig(scenario=Scenario.paper(), observation=SENSORS)
    envs = gymnasium.make_vec(ID, num_envs=2, vectorization_mode="sync", **config.plain())
    again = gymnasium.make_vec(EnvSpec.from_json(envs.spec.to_json()))
    assert rollout(again, rows=2) == rollout(envs, rows=2)


def test_mappings_lists_and_paths_are_what_they_stand_for(tmp_path: Path) -> None:
    distribution = ScenarioDistribution(hs=(1.0, 3.0), records=())
    (tmp_path / "mine.toml").write_text(scenario_text(distribution))
    table = {"kind": "distribution", "hs": [1.0, 3.0]}
    for given in (
        distribution,
        tmp_path / "mine.toml",
        str(tmp_path / "mine.toml"),
        table,
        {**table, "hs": (1.0, 3.0)},
    ):
        assert TaskConfig(scenario=given).source == distribution
    found = TaskConfig(scenario={"motion": {"kind": "recorded", "file": record(tmp_path / "deck.csv")}}).source
    assert isinstance(found, Scenario)
    assert found.motion.duration == pytest.approx(69.75)
    assert TaskConfig(observation=asdict(SENSORS)).sensors == SENSORS
    mesh = TaskConfig(model="rfem", rfes=[4, 2]).mesh
    assert mesh is not None
    assert mesh.division == Division(leg=4, beam=2)
    given = {"control_period": 0.2, "observation": {"delay": 0.2}}
    env = gymnasium.make(ID, config=given, episode_duration=30.0).unwrapped
    assert env.simulation.config == TaskConfig(
        control_period=0.2, observation=Sensors(delay=0.2), episode_duration=30.0
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"observation": {"delays": 0.2}}, r"observation: unknown key 'delays'"),
        ({"observation": {"heave": {"noise": "big"}}}, r"observation: \[heave.noise\] 'big': must be a number"),
        ({"observation": {"heave": 0.1}}, r"observation: \[heave\] must be a table"),
        ({"scenario": {"motion": {"kind": "recorded", "file": 3}}}, r"\[motion.file\] 3: must be of type str"),
        ({"rfes": [4, 2]}, r'rfes = \(4, 2\): only with model="rfem"'),
        ({"max_episode_steps": 0}, r"max_episode_steps = 0: must be in \[1, 10000000\]"),
        ({"config": {"period": 0.2}}, "unexpected keyword argument 'period': must be one of control_period"),
        ({"frameskip": 4}, "unexpected keyword argument 'frameskip': must be one of control_period"),
    ],
)
def test_bad_arguments(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        gymnasium.make(ID, **arguments)


def test_an_argument_that_there_is_not_is_a_type_error_as_pythons_own() -> None:
    """TorchRL asks so whether an environment repeats frames by itself."""
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'"):
        gymnasium.make(ID, frameskip=4)


def length(env: Any) -> int:
    env.reset(seed=1)
    steps, done = 0, False
    while not done:
        done = bool(env.step(np.zeros(1, dtype=np.float32))[3])
        steps += 1
    return steps


@pytest.mark.parametrize(
    ("arguments", "steps"),
    [
        ({}, 600),
        ({"max_episode_steps": 1200}, 1200),
        ({"max_episode_steps": 30}, 30),
        ({"max_episode_steps": -1}, 600),
        ({"control_period": 0.2}, 300),
        ({"control_period": 0.2, "max_episode_steps": 400}, 400),
        ({"episode_duration": 90.0}, 900),
    ],
)
def test_an_episode_is_as_long_as_it_was_asked_for(arguments: dict[str, Any], steps: int) -> None:
    env = gymnasium.make(ID, **arguments)
    assert env.spec.max_episode_steps == steps
    assert TimeAwareObservation(env).max_timesteps == steps
    assert length(env) == steps
    assert length(gymnasium.make(EnvSpec.from_json(env.spec.to_json()))) == steps


def test_a_spec_s_own_length_holds() -> None:
    spec = gymnasium.spec(ID)
    assert length(EnvSpec(id=ID, entry_point=spec.entry_point, max_episode_steps=650).make()) == 650


def test_another_environment_s_length_is_not_taken_for_ours() -> None:
    class Outer(gymnasium.Wrapper[Any, Any, Any, Any]):
        def __init__(self) -> None:
            super().__init__(gymnasium.make(ID))

    env = gymnasium.make(EnvSpec(id="Outer-v0", entry_point=Outer), max_episode_steps=700, disable_env_checker=True)
    assert env.unwrapped.simulation.episode_steps == 600


def test_a_load_that_is_lost_is_charged_for_the_time_that_was_asked_for() -> None:
    """The same as in an environment of that duration, and more than in a shorter one."""
    costs = []
    for arguments in ({"max_episode_steps": 1200}, {"episode_duration": 120.0}, {}):
        scenario = Scenario.paper(crane=Crane(rope=Rope(breaking_load=1.0e6)))
        env = gymnasium.make(ID, scenario=scenario, **arguments)
        env.reset(seed=0)
        terminated = False
        while not terminated:
            _, _, terminated, truncated, info = env.step(np.array([-2.0], dtype=np.float32))
            assert not truncated
        costs.append(info["omega1"].item())
    assert costs[0] == costs[1] > 10.0 * costs[2] > 0.0


def test_information_is_arrays() -> None:
    """As TorchRL's reader and Minari's storage want it."""
    env = gymnasium.make(ID)
    _, info = env.reset(seed=0)
    assert {name: (value.shape, value.dtype.name) for name, value in info.items()} == {
        "time": ((), "float64"),
        "load_position": ((3,), "float64"),
        "rope_tension": ((), "float64"),
        "slack": ((), "bool"),
        "omega1": ((), "float64"),
        "omega2": ((), "float64"),
        "load_tension": ((), "float64"),
        "target_level": ((), "float64"),
        "contact_force": ((), "float64"),
        "landings": ((), "int64"),
        "lift_offs": ((), "int64"),
        "landing_speed": ((), "float64"),
        "pulley_position": ((3,), "float64"),
        "luffing_angle": ((), "float64"),
        "drive_torque": ((), "float64"),
        "drive_power": ((), "float64"),
    }
    before = info["time"].item()
    env.step(np.zeros(1, dtype=np.float32))
    assert info["time"] == before


def test_vectors_of_gymnasium_and_ours_have_the_same_information() -> None:
    ours = gymnasium.make_vec(ID, num_envs=2)
    theirs = gymnasium.make_vec(ID, num_envs=2, vectorization_mode="sync")
    (_, expected), (_, found) = ours.reset(seed=3), theirs.reset(seed=3)
    assert set(found) == set(expected)
    for name, value in expected.items():
        assert found[name].dtype == value.dtype
        np.testing.assert_array_equal(found[name], value)


def test_workers_find_the_environment_by_its_module() -> None:
    """A fresh process that imports nothing of ours by itself."""
    envs = make_vec_env(f"aframe_env:{ID}", n_envs=2, seed=0, vec_env_cls=SubprocVecEnv)
    try:
        expected = make_vec_env(ID, n_envs=2, seed=0)
        np.testing.assert_array_equal(envs.reset(), expected.reset())
        actions = np.full((2, 1), 0.5, dtype=np.float32)
        np.testing.assert_array_equal(envs.step(actions)[0], expected.step(actions)[0])
    finally:
        envs.close()


USER = """
from stable_baselines3.common.evaluation import evaluate_policy
import gymnasium
import numpy as np

import agents
from aframe_env import InvalidValue, Scenario, ScenarioDistribution, Sensors, TaskConfig
from aframe_env.env import AFrameHeaveEnv

config = TaskConfig(scenario=ScenarioDistribution(hs=(1.0, 2.0)), observation=Sensors(delay=0.2))
env = AFrameHeaveEnv(config)
agent: agents.FeaturePolicy = agents.FeaturePolicy(lambda features: np.zeros(len(features)))
agent.crane = Scenario.paper().crane
observation, info = env.reset(seed=0)
action, state = agent.predict(observation)
action, state = agent.predict(observation, state, np.array([False]))
evaluate_policy(agent, env, n_eval_episodes=1)
wrapped = agents.AgentInterface(env, horizon=20.0)
reveal_type(action)
reveal_type(agents.load)
"""


MYPY = """
[mypy]
strict = true
[mypy-torch.*,tensordict.*,matplotlib.*,pandas.*,numba.*,scipy.*]
follow_imports = skip
"""
# What those say of themselves takes mypy minutes, and the user's code has none of it.


def test_user_code_is_typed(tmp_path: Path) -> None:
    """mypy finds the packages as installed ones, which are typed by their py.typed alone."""
    mypy = pytest.importorskip("mypy")
    site = tmp_path / "venv/lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv"], check=True)
    packages = Path(mypy.__file__).parents[1]
    (site / "theirs.pth").write_text(f"{packages}\n")
    for name in ("aframe_env", "agents", "train"):
        (site / name).symlink_to(ROOT / name)
    (tmp_path / "user.py").write_text(USER)
    (tmp_path / "mypy.ini").write_text(MYPY)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--python-executable", tmp_path / "venv/bin/python", "user.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    action, load = (line for line in done.stdout.splitlines() if "Revealed type" in line)
    assert "numpy.ndarray[" in action
    assert "LearnedPolicy" in load
