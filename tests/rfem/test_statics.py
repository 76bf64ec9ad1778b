import math
from dataclasses import replace

import numpy as np
import pytest

from aframe_env.rfem.model import SmallRotationWarning, frame_model
from aframe_env.rfem.reference import static_cases
from aframe_env.rfem.section_forces import Cut
from aframe_env.rfem.statics import LoadCase, static
from aframe_env.rfem.structure import Division
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.cross_sections import Servomotor
from aframe_env.validation import InvalidValue
from train.verify import frame_checks
from train.verify.frame_checks import CASES, DETERMINATE, flat, model


@pytest.fixture(scope="module")
def fine():
    return model(20, 16, corrected_shear=False)


def test_mass_and_counts_of_unknowns():
    chain = frame_model(Crane().frame, Division(leg=10, beam=8))
    field = chain.uniform_field()
    rigid = chain.structure.translation("S")  # rows pick the body of S: only its own share of a shift
    assert rigid.shape == (3, 174)
    assert sum(body.mass for body in chain.structure.bodies) == pytest.approx(20684.75, abs=1e-6)
    assert np.linalg.norm(field[:, 0].reshape(-1, 6)[:, :3], axis=1).sum() == pytest.approx(20684.75)
    assert chain.unknowns == {"frame coordinates": 174, "n_q": 178, "n_R": 8, "free coordinates": 166}
    beams = frame_model(Crane().frame, Division(leg=10, beam=8), layout="three_beams")
    assert beams.unknowns == {"frame coordinates": 186, "n_q": 190, "n_R": 20, "free coordinates": 166}


@pytest.mark.parametrize("name", ["G", "V", "L1"])
def test_determinate_reactions(name, fine):
    here = flat(static(Crane(), CASES[name], model=fine).reference_case())
    target = flat(static_cases()[name])
    assert list(here) == list(target)
    for key in DETERMINATE:
        assert here[key] == pytest.approx(target[key], rel=1e-6)


@pytest.mark.parametrize("name", ["G", "V", "L1"])
def test_deflections_rotations_and_moments(name, fine):
    errors = frame_checks.static_errors(fine, name)
    assert max(errors.values()) <= 5e-3, errors
    corrected = frame_checks.static_errors(model(5, 2, corrected_shear=True), name)
    assert max(corrected.values()) <= 1e-3, corrected


def test_section_forces_either_side_of_points(fine):
    for name, case in CASES.items():
        here, target = static(Crane(), case, model=fine).reference_case(), static_cases()[name]
        scale = max(abs(item["N"]) for key, item in target.items() if key.startswith("sec_"))
        for key in (key for key in target if key.startswith("sec_")):
            for component in ("N", "Vy", "Vz", "T"):
                assert here[key][component] == pytest.approx(target[key][component], abs=5e-4 * scale)


def test_static_convergence_is_second_order():
    check = frame_checks.static_frame()[-1]
    assert check.passed, check.measured


def test_three_beams_give_the_same():
    check = frame_checks.previous_model()
    assert check.passed, check.measured


def test_section_forces_end_at_the_feet_with_the_reactions(fine):
    result = static(Crane(), CASES["L1"], model=fine)
    stations = result.along()
    to_frame = fine.to_deck.T
    right, left = to_frame @ result.reactions["A_R"], to_frame @ result.reactions["A_L"]
    assert stations[0].forces[0] == pytest.approx(-right[2], rel=1e-9)
    assert stations[-1].forces[0] == pytest.approx(-left[2], rel=1e-9)
    assert np.abs(stations[0].forces[3:]).max() < 1.0
    assert np.abs(stations[-1].forces[3:]).max() < 1.0
    assert all(station.von_mises > 0.0 for station in stations)


def test_cut_equals_the_spring_it_goes_through(fine):
    result = static(Crane(), CASES["L1"], model=fine)
    forces = fine.spring_forces(result.position)
    for index in (0, 13, 19, 20, 27, 36, 55):
        spring = fine.structure.springs[index]
        member = ("right leg", "top beam", "left leg").index(spring.member.name)
        for nudge in (-1e-7, 1e-7):
            cut = result.section_forces.at(Cut(member=member, position=spring.position + nudge))
            assert cut == pytest.approx(forces[index], rel=1e-5, abs=1.0)


def test_elastic_servomotor_keeps_its_force_and_gives_way():
    frame = Crane().frame
    elastic = replace(frame, structure=replace(frame.structure, servomotor=Servomotor(stiffness=2e8)))
    crane = Crane(frame=elastic)
    soft, rigid = static(crane, CASES["V"]), static(Crane(), CASES["V"])
    assert soft.servomotor_tension["R"] == pytest.approx(rigid.servomotor_tension["R"], rel=1e-9)
    angle = math.radians(25.0)
    link = np.array([4.8 * math.sin(angle) + 5.0, 0.0, 4.8 * math.cos(angle)])
    along = link / np.linalg.norm(link)
    longer = along @ (soft.displacement["N_R"] - rigid.displacement["N_R"])
    assert longer == pytest.approx(soft.servomotor_tension["R"] / 2e8, rel=1e-6)
    assert np.linalg.norm(soft.displacement["S"]) > np.linalg.norm(rigid.displacement["S"])


def test_linear_and_mirror_symmetric():
    crane = Crane()
    one = static(crane, LoadCase(own_weight=False, forces={"N_R": (1e4, 2e4, -3e4)}))
    two = static(crane, LoadCase(own_weight=False, forces={"N_R": (2e4, 4e4, -6e4)}))
    mirrored = static(crane, LoadCase(own_weight=False, forces={"N_L": (1e4, -2e4, -3e4)}))
    assert two.displacement["S"] == pytest.approx(2.0 * one.displacement["S"], rel=1e-9)
    assert mirrored.displacement["S"] == pytest.approx(one.displacement["S"] * [1, -1, 1], rel=1e-6)


def test_tapered_legs_are_built_alike_on_both_sides():
    frame = Crane().frame
    leg = frame.structure.leg_section
    stronger = replace(leg, second_moment_2=2 * leg.second_moment_2, area=2 * leg.area)
    tapered = replace(frame, structure=replace(frame.structure, leg_section=(stronger, leg)))
    result = static(Crane(frame=tapered), LoadCase(rope_tension=981e3))
    assert result.reactions["A_R"] == pytest.approx(result.reactions["A_L"] * [1, -1, 1], rel=1e-8)
    assert abs(result.displacement["S"][1]) < 1e-12


def test_large_rotation_warns_with_the_figure():
    with pytest.warns(SmallRotationWarning, match=r"0\.\d+ rad"):
        static(Crane(), LoadCase(rope_tension=3e7))


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: LoadCase(rope_tension=-1.0), "rope_tension.*N"),
        (lambda: LoadCase(forces={"X": (0, 0, 1)}), "forces.*'N_R'"),
        (lambda: LoadCase(forces={"S": (0, 0)}), "forces.S"),
        (lambda: Division(leg=10, beam=7), r"rfes \(beam\) = 7: must be even"),
        (lambda: Division(leg=0, beam=8), r"rfes \(leg\) = 0"),
    ],
)
def test_bad_input_is_named(build, words):
    with pytest.raises(InvalidValue, match=words):
        build()
