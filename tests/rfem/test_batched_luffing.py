"""A full model that luffs behind the environment: the stand-alone one, frames that hold, the rigid frame, rows."""

import math
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from test_batched import COARSE, PERIOD, assert_like, run
from test_luffed import INBOARD, swinging

from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.env import AFrameHeaveEnv
from aframe_env.flexible_engine import Mesh
from aframe_env.rfem.model import frame_model
from aframe_env.rfem.simulate import DynamicCase, simulate
from aframe_env.scenario import Luffing, Scenario, TorqueDrive
from aframe_env.scenario.crane import Crane, Winch
from aframe_env.scenario.cross_sections import FrameStructure, Material, Servomotor
from aframe_env.validation import InvalidValue
from train.verify.run_checks import rough_sea

COUPLED = Material(normal_damping=2.1e8, tangential_damping=5e7)
MESH = {"model": "rfem", "rfes": (5, 2), "rfem_modes": 8}


@pytest.mark.parametrize(
    ("material", "modes", "step"), [(None, 8, None), (None, 8, 2.5e-3), (None, None, None), (COUPLED, 8, None)]
)
def test_swing_out_and_back_in_a_rough_sea_is_that_of_the_stand_alone_model(material, modes, step):
    scenario = swinging(material, 3.0, motion=rough_sea(), ramp=2.0, rope_damping=2e4)
    points = ((0.0, INBOARD), (2.0, math.radians(10.0)), (4.0, math.radians(-8.0)))
    scenario = replace(scenario, luffing=replace(scenario.luffing, points=points))
    case = DynamicCase(scenario=scenario, duration=4.0, step=5e-3)
    expected = simulate(case, model=frame_model(scenario.crane.frame, COARSE))
    assert_like(expected, run(scenario, 4.0, Mesh(COARSE, modes), step), 1e-3, 5e-3)


def test_frame_that_holds_is_that_of_a_scenario_without_luffing():
    held = Luffing(points=((0.0, INBOARD), (1.0, INBOARD)))
    crane = swinging().crane
    for changed in (crane, replace(crane, rope=replace(crane.rope, mass_per_length=20.0))):
        # A limit that is not met keeps both on the same scheme.
        limited = replace(changed, winch=Winch(max_power=1e9))
        luffs, holds = (Scenario.paper(crane=limited, luffing=luffing) for luffing in (held, None))
        for here, there in zip(*(run(each, 2.0, Mesh(COARSE, 8)) for each in (luffs, holds)), strict=True):
            assert here == pytest.approx(there, rel=1e-9, abs=1e-9 * np.abs(there).max())


@pytest.mark.parametrize(("mass_per_length", "drive"), [(0.0, None), (20.0, None), (20.0, TorqueDrive())])
def test_stiff_frame_is_the_simplified_model(mass_per_length, drive):
    scenario = swinging(Material(young_modulus=2.1e14, shear_modulus=8.1e13), motion=rough_sea())
    rope = replace(scenario.crane.rope, mass_per_length=mass_per_length)
    scenario = replace(scenario, crane=replace(scenario.crane, rope=rope, winch=Winch(drive=drive)))
    engine = Engine(1, PERIOD)
    engine.reset_row(0, scenario)
    rigid = []
    for _ in range(181):
        rigid.append(engine.read_many(at.LOAD_POSITION, 3)[0])
        engine.step(np.full(1, 0.5))
    assert np.abs(run(scenario, 9.0, Mesh(COARSE), command=0.5)[0] - np.array(rigid)).max() < 1e-4


def test_rows_that_luff_and_rows_that_hold_side_by_side():
    quick = swinging(None, 2.0, motion=rough_sea())
    heavy = replace(quick.crane, rope=replace(quick.crane.rope, mass_per_length=20.0))
    late = Luffing.swing(INBOARD, math.radians(-5.0), 1.0, 1.5, max_speed=5.0, max_acceleration=5.0)
    scenarios = [
        quick,
        Scenario.paper(),
        replace(quick, crane=heavy),
        replace(quick, luffing=late),
        replace(quick, luffing=None),
        Scenario.paper(crane=heavy),
    ]
    vector = gymnasium.make_vec("AFrameHeave-v0", num_envs=6, vectorization_mode="vector_entry_point", **MESH)
    vector.reset(seed=0, options={"scenario": scenarios})
    command = np.full((6, 1), 0.5, dtype=np.float32)
    together = [vector.step(command) for _ in range(20)]
    for k, scenario in enumerate(scenarios):
        scalar, other = (gymnasium.make("AFrameHeave-v0", **MESH).unwrapped for _ in range(2))
        scalar.reset(seed=k, options={"scenario": scenario})
        # This one has its tables in another order, and takes over in the middle of the way.
        other.reset(seed=0, options={"scenario": replace(quick, luffing=late)})
        for number, (observations, rewards, _, _, infos) in enumerate(together):
            if number == 12:
                other.set_state(scalar.get_state())
                scalar = other
            observation, reward, _, _, info = scalar.step(command[k])
            np.testing.assert_array_equal(observations[k], observation)
            assert rewards[k] == reward
            for key in ("rope_tension", "luffing_angle", "foot_reactions", "servomotor_tensions", "utilisation"):
                np.testing.assert_array_equal(infos[key][k], info[key])


def test_elastic_servomotors_do_not_luff():
    frame = replace(swinging().crane.frame, structure=FrameStructure(servomotor=Servomotor(stiffness=3e8)))
    scenario = replace(swinging(), crane=Crane(frame=frame))
    with pytest.raises(InvalidValue, match=r"stiffness = 300000000.0 N/m: must be None, rigid, with luffing"):
        AFrameHeaveEnv(scenario=scenario, model="rfem", rfes=(1, 2)).reset(seed=0)
