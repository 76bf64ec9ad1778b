"""The environments on the full model: Gymnasium's checks, scalar against vector, states, information."""

from __future__ import annotations

import copy
import pickle
import warnings
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from aframe_env import InvalidValue, Scenario, SmallRotationWarning
from aframe_env.rfem.model import frame_model
from aframe_env.rfem.statics import LoadCase, static
from aframe_env.rfem.structure import Division
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.cross_sections import Material, Servomotor, reference_leg_section
from aframe_env.scenario.motion import HarmonicMotion

STILL = np.zeros(1, dtype=np.float32)
MESH = {"model": "rfem", "rfes": (5, 2)}
FRAME_KEYS = ("pulley_deflection", "foot_reactions", "servomotor_tensions", "utilisation")


def crane_with(**changes) -> Crane:
    frame = Crane().frame
    return Crane(frame=replace(frame, structure=replace(frame.structure, **changes)))


def stiffer(factor: float) -> Crane:
    return crane_with(material=Material(young_modulus=2.1e11 * factor, shear_modulus=8.1e10 * factor))


@pytest.mark.parametrize("arguments", [{}, {"rfem_modes": 6, "observation": "sensors"}])
def test_gymnasium_check(arguments):
    env = gymnasium.make("AFrameHeave-v0", **MESH, **arguments).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*symmetric and normalized.*")
        check_env(env, skip_render_check=True)


def test_spaces_are_those_of_the_simplified_model():
    flexible, rigid = gymnasium.make("AFrameHeave-v0", **MESH), gymnasium.make("AFrameHeave-v0")
    assert flexible.observation_space == rigid.observation_space
    assert flexible.action_space == rigid.action_space


def test_information_at_rest_is_that_of_statics():
    env = gymnasium.make("AFrameHeave-v0", scenario=Scenario.paper(motion=HarmonicMotion()), **MESH)
    _, info = env.reset(seed=0)
    for _ in range(20):
        _, _, _, _, info = env.step(STILL)
    to_drum = np.array(Crane().drum_position) - np.array(Crane().pulley_position) - info["pulley_deflection"]
    force = 981e3 * (to_drum / np.linalg.norm(to_drum) - np.array([0.0, 0.0, 1.0]))
    case = LoadCase(own_weight=True, forces={"S": tuple(force.tolist())})
    expected = static(Crane(), case, model=frame_model(Crane().frame, Division(leg=5, beam=2)))
    assert info["rope_tension"] == pytest.approx(981e3, rel=1e-9)
    assert info["pulley_deflection"] == pytest.approx(expected.displacement["S"], rel=1e-7, abs=1e-10)
    assert info["foot_reactions"][0] == pytest.approx(expected.reactions["A_R"], rel=1e-7)
    assert info["foot_reactions"][1] == pytest.approx(expected.reactions["A_L"], rel=1e-7)
    assert info["servomotor_tensions"] == pytest.approx([expected.servomotor_tension["R"]] * 2, rel=1e-7)


@pytest.mark.parametrize("rows", [2, 70])
def test_scalar_row_is_vector_row(rows):
    arguments = {"episode_duration": 2.0, **MESH}
    vector = gymnasium.make_vec("AFrameHeave-v0", num_envs=rows, vectorization_mode="vector_entry_point", **arguments)
    k = rows - 1
    scalar = gymnasium.make("AFrameHeave-v0", **arguments)
    observations, infos = vector.reset(seed=10)
    expected, info = scalar.reset(seed=10 + k)
    rng = np.random.default_rng(1)
    done = False
    for _ in range(45):
        actions = rng.uniform(-2.0, 2.0, (rows, 1)).astype(np.float32)
        np.testing.assert_array_equal(observations[k], expected)
        for key in FRAME_KEYS:
            np.testing.assert_array_equal(infos[key][k], info[key])
        observations, rewards, terminations, truncations, infos = vector.step(actions)
        if done:
            expected, info = scalar.reset()
            reward, terminated, truncated = 0.0, False, False
        else:
            expected, reward, terminated, truncated, info = scalar.step(actions[k])
        assert (rewards[k], terminations[k], truncations[k]) == (reward, terminated, truncated)
        done = terminated or truncated


def test_rows_may_have_different_cranes_and_ropes():
    scenarios = [
        Scenario.paper(initial="rest"),
        Scenario.paper(initial="rest", crane=stiffer(3.0)),
        Scenario.paper(initial="rest", target_level=-20.0, load_mass=3e3),
        Scenario.paper(initial="rest", crane=crane_with(servomotor=Servomotor(stiffness=3e8, damping=1e5))),
        Scenario.paper(initial="rest", crane=crane_with(material=Material(tangential_damping=1e8))),
        # The damper of a load at rest pulls more than the rope can bear before the first step, and no more after it.
        Scenario(load_mass=14.0, rope_damping=4e6, initial="rest"),
    ]
    rows = len(scenarios)
    vector = gymnasium.make_vec("AFrameHeave-v0", num_envs=rows, vectorization_mode="vector_entry_point", **MESH)
    vector.reset(seed=0, options={"scenario": scenarios})
    command = np.full((rows, 1), 0.5, dtype=np.float32)
    together = [vector.step(command) for _ in range(5)]
    for k, scenario in enumerate(scenarios):
        scalar = gymnasium.make("AFrameHeave-v0", **MESH)
        scalar.reset(seed=k, options={"scenario": scenario})
        for observations, rewards, terminations, _, infos in together:
            observation, reward, terminated, _, info = scalar.step(command[k])
            np.testing.assert_array_equal(observations[k], observation)
            assert (rewards[k], terminations[k]) == (reward, terminated)
            for key in ("rope_tension", "slack", "foot_reactions"):
                np.testing.assert_array_equal(infos[key][k], info[key])


def test_a_frame_that_turns_too_far_warns_once_with_the_figure():
    soft = Scenario.paper(crane=stiffer(0.05))
    frame = frame_model(soft.crane.frame, Division(leg=5, beam=2))
    deflection = np.zeros(3)
    for _ in range(10):  # The rope to the drum turns as S gives way.
        to_drum = np.array(soft.crane.drum_position) - np.array(soft.crane.pulley_position) - deflection
        force = 981e3 * (to_drum / np.linalg.norm(to_drum) - np.array([0.0, 0.0, 1.0]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SmallRotationWarning)
            result = static(soft.crane, LoadCase(forces={"S": tuple(force.tolist())}), model=frame)
        deflection = result.displacement["S"]
    largest = np.linalg.norm(result.position.reshape(-1, 6)[:, 3:], axis=1).max()
    scalar = gymnasium.make("AFrameHeave-v0", scenario=soft, **MESH)
    with pytest.warns(SmallRotationWarning, match=r"turned by 0\.\d+ rad") as caught:
        scalar.reset(seed=0)
    for _ in range(5):
        scalar.step(STILL)  # A second warning would be an error.
    figure = float(str(caught[0].message).split("turned by ")[1].split()[0])
    assert figure == pytest.approx(largest, rel=0.01)
    vector = gymnasium.make_vec("AFrameHeave-v0", num_envs=3, vectorization_mode="vector_entry_point", **MESH)
    vector.reset(seed=0)
    with pytest.warns(SmallRotationWarning) as caught:
        vector.reset(options={"scenario": [Scenario.paper(), soft, soft]})
    assert len(caught) == 1
    vector.step(np.zeros((3, 1), dtype=np.float32))


def test_a_section_without_stress_points_has_no_utilisation():
    legs = replace(reference_leg_section(), stress_points=())
    env = gymnasium.make("AFrameHeave-v0", scenario=Scenario.paper(crane=crane_with(leg_section=legs)), **MESH)
    _, info = env.reset(seed=0)
    assert np.isnan(info["utilisation"])
    assert np.isfinite(info["foot_reactions"]).all()


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_go_on_identically(clone):
    env = gymnasium.make("AFrameHeave-v0", observation="sensors", **MESH).unwrapped
    env.reset(seed=4)
    for _ in range(20):
        env.step(np.array([0.3], dtype=np.float32))
    twin = clone(env)
    for _ in range(20):
        np.testing.assert_array_equal(env.step(STILL)[0], twin.step(STILL)[0])
    np.testing.assert_array_equal(env.reset()[0], twin.reset()[0])


def test_state_goes_to_another_environment():
    # The other has met another crane before: its tables are in another order.
    env, other = (gymnasium.make("AFrameHeave-v0", **MESH).unwrapped for _ in range(2))
    env.reset(seed=4)
    other.reset(seed=5, options={"scenario": Scenario.paper(crane=stiffer(2.0))})
    env.reset(options={"scenario": Scenario.paper(crane=stiffer(5.0))})
    for _ in range(3):
        env.step(STILL)
    other.set_state(env.get_state())
    for _ in range(10):
        one, two = env.step(STILL), other.step(STILL)
        np.testing.assert_array_equal(one[0], two[0])
        np.testing.assert_array_equal(one[4]["foot_reactions"], two[4]["foot_reactions"])


class Table:
    """The paper's motion, recorded."""

    def __init__(self, phase: float) -> None:
        self.phase = phase

    duration = 1e6

    def table(self, period: float) -> np.ndarray:
        return (
            HarmonicMotion.paper()
            .components()
            .at(period * np.arange(200) + self.phase)
            .transpose(1, 0, 2)
            .reshape(-1, 18)
        )


def test_recorded_motion_is_that_of_its_components():
    runs = []
    for motion in (HarmonicMotion.paper(), Table(0.0)):
        env = gymnasium.make("AFrameHeave-v0", scenario=Scenario.paper(motion=motion), **MESH)
        env.reset(seed=0)
        runs.append([env.step(STILL)[4]["load_position"] for _ in range(50)])
    np.testing.assert_allclose(runs[0], runs[1], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("mesh", [{}, MESH])
def test_state_takes_its_record_along(mesh):
    env, other = (gymnasium.make("AFrameHeave-v0", **mesh).unwrapped for _ in range(2))
    other.reset(seed=0, options={"scenario": Scenario.paper(motion=Table(2.0))})
    env.reset(seed=0, options={"scenario": Scenario.paper(motion=Table(0.0))})
    other.set_state(env.get_state())
    for _ in range(10):
        np.testing.assert_array_equal(env.step(STILL)[0], other.step(STILL)[0])


def test_state_of_another_model_is_refused():
    env = gymnasium.make("AFrameHeave-v0", **MESH).unwrapped
    env.reset(seed=0)
    for arguments in ({}, {"model": "rfem", "rfes": (5, 4)}, {**MESH, "rfem_modes": 5}):
        other = gymnasium.make("AFrameHeave-v0", **arguments).unwrapped
        other.reset(seed=0)
        with pytest.raises(InvalidValue, match="another model"):
            other.set_state(env.get_state())


def test_last_information_of_rows_that_are_reset():
    vector = gymnasium.make_vec(
        "AFrameHeave-v0",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        episode_duration=0.3,
        autoreset_mode="SameStep",
        **MESH,
    )
    vector.reset(seed=0)
    for _ in range(3):
        infos = vector.step(np.zeros((2, 1), dtype=np.float32))[4]
    assert infos["final_info"]["foot_reactions"].shape == (2, 2, 3)
    assert not np.array_equal(infos["final_info"]["foot_reactions"], infos["foot_reactions"])


def test_return_is_minus_omega1():
    env = gymnasium.make("AFrameHeave-v0", episode_duration=10.0, **MESH)
    env.reset(seed=3)
    rng = np.random.default_rng(0)
    total, done = 0.0, False
    while not done:
        _, reward, terminated, truncated, info = env.step(rng.uniform(-1.0, 1.0, 1).astype(np.float32))
        total += float(reward)
        done = terminated or truncated
    assert total == pytest.approx(-info["omega1"], rel=1e-12)


def test_a_rope_that_parts_ends_the_episode():
    rope = replace(Crane().rope, breaking_load=1.0e6)
    env = gymnasium.make("AFrameHeave-v0", scenario=Scenario.paper(crane=Crane(rope=rope)), **MESH)
    env.reset(seed=0)
    terminated, reward = False, 0.0
    for _ in range(100):
        _, reward, terminated, _, info = env.step(STILL)
        if terminated:
            break
    assert terminated
    assert info["rope_tension"] == 0.0
    assert reward < -1e6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rfes": (10, 8)}, r"rfes = \(10, 8\): only with model=\"rfem\""),
        ({"rfem_modes": 5}, r"rfem_modes = 5: only with"),
        ({"model": "rfem", "rfes": (10, 7)}, r"rfes = \(10, 7\): the beam's number must be even"),
        ({"model": "rfem", "rfes": 10}, "rfes = 10: must be a tuple of two integers"),
        ({"model": "rfem", "rfes": (0, 2)}, r"rfes \(leg\) = 0"),
        ({"model": "rfem", "rfem_modes": 0}, r"rfem_modes = 0"),
    ],
)
def test_bad_input(arguments, message):
    with pytest.raises(InvalidValue, match=message):
        gymnasium.make("AFrameHeave-v0", **arguments)
