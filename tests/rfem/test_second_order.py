"""Second order of the frame, against a multibody program with geometrically exact beams."""

from dataclasses import replace

import numpy as np
import pytest

from aframe_env.rfem.modes import frame_modes
from aframe_env.rfem.reference import second_order_cases
from aframe_env.rfem.simulate import DynamicCase, simulate
from aframe_env.rfem.statics import LoadCase, static
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.cross_sections import Servomotor
from aframe_env.scenario.motion import HarmonicMotion
from aframe_env.validation import InvalidValue
from train.verify.frame_checks import model

SIDE = (0.0, 1e5, 0.0)


@pytest.mark.parametrize("target", second_order_cases(), ids=lambda case: case["name"])
@pytest.mark.parametrize("division", [(20, 16), (40, 40)])
def test_deflection_and_servomotors_are_those_of_exact_beams(target, division):
    forces = {"S": (0.0, target["side_force"], 0.0)}
    case = LoadCase(rope_tension=981e3, forces=forces, second_order=True, rope_follows=target["rope_follows"])
    frame = model(*division)
    result = static(Crane(), case, model=frame)
    linear = static(Crane(), replace(case, second_order=False, rope_follows=False), model=frame)
    expected = np.array(target["u_S_D"])
    assert result.displacement["S"] == pytest.approx(expected, abs=1e-3 * np.abs(expected).max())
    assert [*result.servomotor_tension.values()] == pytest.approx(target["servomotors"], rel=1e-3)
    gap, left = (np.abs(each.displacement["S"] - expected).max() for each in (linear, result))
    assert gap > 5.0 * left


def test_a_loaded_frame_swings_slower_and_starts_from_the_same_place():
    scenario = Scenario.paper(motion=HarmonicMotion(), initial="rest")
    linear, second = (
        simulate(DynamicCase(scenario=scenario, second_order=flag, duration=1.0), model=model(10, 8))
        for flag in (False, True)
    )
    assert second.frame.displacement("S")[0] == pytest.approx(linear.frame.displacement("S")[0], rel=0.03)
    found, expected = (frame_modes(Crane(), 3, model=each.frame.model).frequency for each in (second, linear))
    assert (found < expected).all()
    assert found == pytest.approx(expected, rel=0.05)


def test_elastic_servomotors_as_stiff_as_rigid_ones():
    crane = Crane()
    elastic = replace(crane.frame.structure, servomotor=Servomotor(stiffness=1e14))
    stiff = Crane(frame=replace(crane.frame, structure=elastic))
    case = LoadCase(rope_tension=981e3, forces={"S": SIDE}, second_order=True)
    both = [static(each, case).displacement["S"] for each in (crane, stiff)]
    assert both[0] == pytest.approx(both[1], abs=2e-4 * np.abs(both[0]).max())


def test_a_frame_beyond_its_buckling_load_is_named():
    with pytest.raises(InvalidValue, match="the frame buckles"):
        static(Crane(), LoadCase(forces={"S": (0.0, 1e3, -2e9)}, second_order=True), model=model(10, 8))


def test_rope_follows_with_second_order_only():
    with pytest.raises(InvalidValue, match="rope_follows = True: only with second_order"):
        LoadCase(rope_follows=True)
