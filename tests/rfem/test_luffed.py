"""A full model that luffs: a multibody program, cranes built anew, the rigid frame, and conservation of energy."""

import math
from dataclasses import replace

import numpy as np
import pytest

from aframe_env.rfem import simulate as runs
from aframe_env.rfem.energy import energy_balance
from aframe_env.rfem.model import frame_model
from aframe_env.rfem.rigid_frame import frame_forces
from aframe_env.rfem.servomotor_stroke import Stroke
from aframe_env.rfem.simulate import DynamicCase, simulate
from aframe_env.rfem.statics import LoadCase, static
from aframe_env.rfem.structure import Division
from aframe_env.scenario import Luffing, Scenario
from aframe_env.scenario.crane import Crane, Frame
from aframe_env.scenario.cross_sections import FrameStructure, Material, Servomotor
from aframe_env.scenario.motion import HarmonicMotion
from aframe_env.validation import InvalidValue
from train.verify.cases import dynamic_case, dynamic_columns
from train.verify.luffing_checks import COLUMNS, FRAME_COLUMNS, LITTLE_SECOND_ORDER, forces_at_rest, swing_run
from train.verify.run_checks import rough_sea

COARSE = Division(leg=5, beam=2)
INBOARD, OUTBOARD = math.radians(-20.0), math.radians(25.0)


def swinging(material: Material | None = None, duration: float = 8.0, **changes: object) -> Scenario:
    """From −20° to 25° between 0.5 s and 0.5 s + ``duration``."""
    frame = Frame(luffing_angle=INBOARD, structure=FrameStructure(material=material or Material()))
    luffing = Luffing.swing(INBOARD, OUTBOARD, 0.5, duration, max_speed=5.0, max_acceleration=5.0)
    return Scenario.paper(crane=Crane(frame=frame), luffing=luffing, **changes)


@pytest.mark.parametrize(
    ("stiffer", "second_order", "columns"),
    [(10.0, False, COLUMNS), (1.0, False, LITTLE_SECOND_ORDER), (1.0, True, COLUMNS)],
)
def test_swing_is_that_of_a_multibody_program(stiffer, second_order, columns):
    run = swing_run(stiffer, second_order)
    assert {column: run.error(column) for column in columns if run.error(column) > 0.01} == {}
    assert run.here["luffing_rad"] == pytest.approx(run.there["luffing_rad"], abs=1e-7)
    assert run.here["luffing_rad"][[0, -1]] == pytest.approx([INBOARD, OUTBOARD])


def test_what_the_linear_frame_leaves_out_of_a_swing_is_of_second_order():
    run = swing_run(1.0, False)
    rest = forces_at_rest(INBOARD, run.there["T_rope_N"][0], second_order=True)
    for column in FRAME_COLUMNS:
        exact = run.there[column][0]
        assert rest[column] == pytest.approx(exact, rel=1e-3), column
        assert abs(run.here[column][0] - exact) > 5.0 * abs(rest[column] - exact), column


def test_frame_that_holds_is_that_of_the_ordinary_model_by_the_modes_of_another_angle(monkeypatch):
    held = Luffing(points=((0.0, OUTBOARD), (1.0, OUTBOARD)))
    monkeypatch.setattr(runs, "angle_nodes", lambda luffing: np.array([OUTBOARD - math.radians(1.5)]))
    here, there = (
        dynamic_columns(simulate(DynamicCase(scenario=Scenario.paper(luffing=luffing), duration=2.0)))
        for luffing in (held, None)
    )
    for column in ("xL1_m", "xL3_m", "T_rope_N", "uS1_m", "uS3_m", "S_R_N", "RAR1_N", "RAR2_N", "RAL3_N"):
        gap = np.abs(here[column] - there[column]).max()
        assert 0.0 < gap < 1e-4 * np.ptp(there[column]), column


def test_frame_that_holds_has_the_geometric_stiffness_of_one_that_never_luffs():
    held = Luffing(points=((0.0, OUTBOARD), (1.0, OUTBOARD)))
    here, there, linear = (
        dynamic_columns(
            simulate(
                DynamicCase(scenario=Scenario.paper(luffing=luffing), duration=1.0, second_order=second),
                model=frame_model(Frame(), COARSE),
            )
        )
        for luffing, second in ((held, True), (None, True), (None, False))
    )
    for column in ("uS1_m", "uS3_m", "S_R_N", "RAR1_N", "RAR2_N", "RAL3_N"):
        gap, of_second_order = (np.abs(each[column] - there[column]).max() for each in (here, linear))
        assert gap < 1e-5 * of_second_order, column


def test_slow_frame_is_in_the_equilibrium_of_a_crane_built_anew():
    angles = [math.radians(angle) for angle in (-20.0, 4.0, 25.0)]
    points = ((0.0, angles[0]), (6.0, angles[1]), (7.5, angles[1]), (14.0, angles[2]))
    lossy = Material(normal_damping=6.3e8, tangential_damping=2.43e8)
    scenario = swinging(lossy, motion=HarmonicMotion(), rope_damping=1e5)
    scenario = replace(scenario, luffing=replace(scenario.luffing, points=points))
    result = simulate(
        DynamicCase(scenario=scenario, duration=15.5, step=0.01), model=frame_model(scenario.crane.frame, COARSE)
    )
    history = result.frame
    for time, angle in zip((0.0, 7.4, 15.5), angles, strict=True):
        now = round(time / 0.05)
        crane = replace(scenario.crane, frame=replace(scenario.crane.frame, luffing_angle=angle))
        pulley = np.array(crane.pulley_position) + history.displacement("S")[now]
        lines = result.load[now] - pulley, np.array(crane.drum_position) - pulley
        pull = result.tension[now] * sum(line / np.linalg.norm(line) for line in lines)
        rest = static(crane, LoadCase(forces={"S": tuple(pull)}), model=frame_model(crane.frame, COARSE))
        for found, expected in (
            (history.displacement("S")[now], rest.displacement["S"]),
            (history.displacement("N_L")[now], rest.displacement["N_L"]),
            (history.feet()[now, 0], rest.reactions["A_R"]),
            (history.feet()[now, 1], rest.reactions["A_L"]),
            (history.servomotors()[now], [rest.servomotor_tension[side] for side in "RL"]),
        ):
            assert found == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def test_stiff_frame_has_the_forces_of_the_rigid_one():
    # From rest: what a start with a jerk excites, nothing damps.
    sea = {"motion": rough_sea(), "ramp": 2.0, "rope_damping": 2e4}
    scenario = swinging(Material(young_modulus=2.1e14, shear_modulus=8.1e13), **sea)
    result = simulate(
        DynamicCase(scenario=scenario, duration=9.0, step=2.5e-3), model=frame_model(scenario.crane.frame, COARSE)
    )
    rigid = frame_forces(scenario, 0.05, result.load, result.tension)
    tensions, feet = result.frame.servomotors().sum(axis=1), result.frame.feet().sum(axis=1)
    power = result.frame.luffing_power() - rigid.luffing_power
    assert np.abs(tensions + rigid.servomotor_force).max() < 1e-3 * np.ptp(tensions)
    assert np.abs(feet - rigid.foot_reaction).max() < 1e-3 * np.ptp(feet)
    assert np.abs(power).max() < 1e-3 * np.ptp(rigid.luffing_power)


@pytest.mark.parametrize("sea", [False, True])
def test_energy_balance_with_the_work_of_the_servomotors(sea):
    lossy = Material(normal_damping=2.1e8, tangential_damping=5e7)
    scenario = swinging(lossy, 5.0, motion=rough_sea() if sea else HarmonicMotion(), rope_damping=2e4)
    case = DynamicCase(scenario=scenario, duration=6.0, step=2.5e-3, output_interval=2.5e-3)
    result = simulate(case, model=frame_model(scenario.crane.frame, COARSE))
    balance = energy_balance(result)
    assert balance.error < 1e-5
    assert np.abs(balance.input).max() > 1e6
    assert result.frame.constraint_violation() < 1e-12


def test_files_have_luffing():
    data = {
        "rfes": [3, 2],
        "duration": 1.0,
        "step": 0.01,
        "crane": {"frame": {"luffing_angle": 0.0}},
        "luffing": {"points": [[0.0, 0.0], [1.0, 1.0]], "max_acceleration": 1.0},
    }
    columns = dynamic_case(data)
    assert columns["luffing_rad"][-1] == pytest.approx(math.radians(1.0))
    assert columns["P_luffing_W"][10] != 0.0


def test_what_cannot_luff_is_named():
    elastic = FrameStructure(servomotor=Servomotor(stiffness=3e8))
    crane = Crane(frame=Frame(luffing_angle=INBOARD, structure=elastic))
    with pytest.raises(InvalidValue, match=r"stiffness = 300000000.0 N/m: must be None"):
        DynamicCase(scenario=replace(swinging(), crane=crane))
    with pytest.raises(InvalidValue, match="strokes: must be None with luffing"):
        DynamicCase(scenario=swinging(), strokes=(Stroke.smooth(0.01, 1.0),) * 2)
    case = DynamicCase(scenario=swinging(), duration=0.1, step=0.01, output_interval=0.01, second_order=True)
    result = simulate(case, model=frame_model(swinging().crane.frame, COARSE))
    with pytest.raises(InvalidValue, match="second_order = True: must be False for a balance with luffing"):
        energy_balance(result)
