import math
from dataclasses import replace

import numpy as np
import pytest

from aframe_env.rfem.section_forces import von_mises
from aframe_env.scenario.cross_sections import (
    FrameStructure,
    GivenSection,
    ISection,
    Material,
    RectangularHollow,
    Servomotor,
    SolidRectangle,
    Tube,
    reference_beam_section,
    reference_leg_section,
)
from aframe_env.validation import InvalidValue


def test_box_reproduces_the_reference_constants():
    box, stated = RectangularHollow(side_2=0.6, side_3=1.0, wall=0.025).given(), reference_leg_section()
    for name in ("area", "torsion_constant", "second_moment_2", "second_moment_3"):
        assert getattr(box, name) == pytest.approx(getattr(stated, name), rel=1e-5)
    assert box.shear_factor_2 == pytest.approx(3.77, abs=0.005)
    assert box.shear_factor_3 == pytest.approx(1.76, abs=0.005)
    assert stated.rotary_moment == 0.0155322


def test_beam_section_is_the_leg_section_turned():
    leg, beam = reference_leg_section(), reference_beam_section()
    assert (beam.second_moment_2, beam.second_moment_3) == (leg.second_moment_3, leg.second_moment_2)
    assert (beam.shear_factor_2, beam.shear_factor_3) == (leg.shear_factor_3, leg.shear_factor_2)


def test_square_bar_has_the_classic_torsion_constant_and_stress():
    bar = SolidRectangle(side_2=1.0, side_3=1.0).given()
    assert bar.torsion_constant == pytest.approx(0.140577, rel=1e-4)
    assert max(point.torsion for point in bar.stress_points) == pytest.approx(1.0 / 0.2082, rel=2e-3)


def test_solid_round_bar():
    bar = Tube(diameter=2.0, wall=1.0).given()
    assert bar.area == pytest.approx(math.pi)
    assert bar.torsion_constant == pytest.approx(math.pi / 2)
    assert max(point.shear_3 for point in bar.stress_points) == pytest.approx(4.0 / 3.0 / math.pi)


def test_i_section_against_table_values_without_fillets():
    # HE 300 B without its root radius: I_y = 24 190 cm⁴, I_z = 8 553 cm⁴.
    beam = ISection(height=0.3, flange_width=0.3, web=0.011, flange=0.019).given()
    assert beam.second_moment_2 == pytest.approx(2.419e-4, rel=1e-3)
    assert beam.second_moment_3 == pytest.approx(8.553e-5, rel=1e-3)
    # Nearly all shear along the web goes through it.
    assert beam.shear_factor_3 == pytest.approx(beam.area / (0.281 * 0.011), rel=0.12)


def test_von_mises_of_bending_and_of_torsion():
    section = RectangularHollow(side_2=0.6, side_3=1.0, wall=0.025).given()
    bending = np.array([0.0, 0.0, 0.0, 0.0, 1e6, 0.0])
    assert von_mises(section, bending) == pytest.approx(1e6 * 0.5 / section.second_moment_2)
    torsion = np.array([0.0, 0.0, 0.0, 1e6, 0.0, 0.0])
    bredt = 1e6 / (2 * 0.575 * 0.975 * 0.025)
    assert von_mises(section, torsion) == pytest.approx(math.sqrt(3.0) * bredt)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: RectangularHollow(side_2=0.6, side_3=1.0, wall=0.3), "wall.*0.3.*m"),
        (lambda: Tube(diameter=1.0, wall=0.6), "wall"),
        (lambda: Material(young_modulus=-1.0), r"young_modulus.*\[1e\+06, 1e\+16\] Pa"),
        (lambda: Servomotor(damping=1.0), "rigid"),
        (lambda: FrameStructure(leg_section=()), "leg_section"),
        (
            lambda: GivenSection(
                area=1.0,
                torsion_constant=1.0,
                second_moment_2=1.0,
                second_moment_3=1.0,
                shear_factor_2=0.5,
                shear_factor_3=1.0,
            ),
            "shear_factor_2",
        ),
        (
            lambda: replace(RectangularHollow(side_2=0.6, side_3=1.0, wall=0.025).given(), second_moment_2=1e-12),
            r"second_moment_2 = 1e-12 m⁴ for area 0.0775 m².*\[7\.75e-10, 775\]",
        ),
    ],
)
def test_bad_input_is_named(build, words):
    with pytest.raises(InvalidValue, match=words):
        build()
