import math

import numpy as np
import pytest

from aframe_env.rfem.beam import Member, divide
from aframe_env.rfem.straight_beam import bending_frequencies
from aframe_env.scenario.cross_sections import Material, SolidRectangle
from train.verify.closed_forms import exact_frequencies
from train.verify.frame_checks import beam_frequencies, straight_member


def test_frequencies_are_as_good_as_the_table_and_second_order():
    check = beam_frequencies()
    assert check.passed, check.measured


def test_closed_forms_meet_euler_bernoulli_roots():
    member = straight_member()
    section, material = member.section_at(0.0), member.material
    unit = math.sqrt(material.young_modulus * section.second_moment_2 / (material.density * section.area)) / (
        2 * math.pi * member.length**2
    )
    pinned = exact_frequencies(member, ("pinned", "pinned"), 3, shear=False) / unit
    assert pinned == pytest.approx([math.pi**2, 4 * math.pi**2, 9 * math.pi**2], rel=1e-9)
    clamped = exact_frequencies(member, ("clamped", "free"), 3, shear=False) / unit
    assert clamped == pytest.approx([1.8751041**2, 4.6940911**2, 7.8547574**2], rel=1e-7)


def test_free_beam_moves_rigidly():
    frequencies = bending_frequencies(straight_member(), 8, ("free", "free"))
    assert np.all(frequencies[:2] < 1e-3 * frequencies[2])


def test_spring_stiffness_and_damping_are_the_papers():
    material = Material(normal_damping=3e6, tangential_damping=2e6)
    member = Member(
        name="bar",
        start=np.zeros(3),
        end=np.array([0.0, 4.0, 0.0]),
        out_of_plane=np.array([1.0, 0.0, 0.0]),
        section=SolidRectangle(side_2=0.2, side_3=0.4),
        material=material,
    )
    _, springs = divide(member, 5, corrected_shear=False)
    s, size = member.section_at(0.0), 0.8
    moduli = np.array([s.area, s.area / 1.2, s.area / 1.2, s.torsion_constant, s.second_moment_2, s.second_moment_3])
    elastic = np.array([2.1e11, 8.1e10, 8.1e10, 8.1e10, 2.1e11, 2.1e11])
    viscous = np.array([3e6, 2e6, 2e6, 2e6, 3e6, 3e6])
    for spring in springs:
        assert spring.stiffness == pytest.approx(moduli * elastic / size, rel=1e-12)
        assert spring.damping == pytest.approx(moduli * viscous / size, rel=1e-12)


@pytest.mark.parametrize("elements", [1, 2, 7])
def test_stepped_member_keeps_its_mass_and_axial_compliance(elements):
    thick, thin = SolidRectangle(side_2=0.4, side_3=0.4), SolidRectangle(side_2=0.2, side_3=0.3)
    member = Member(
        name="stepped",
        start=np.zeros(3),
        end=np.array([0.0, 0.0, 3.0]),
        out_of_plane=np.array([1.0, 0.0, 0.0]),
        section=(thick, thin),
        material=Material(),
    )
    segments, springs = divide(member, elements)
    assert sum(part.mass_properties()[0] for part in segments) == pytest.approx(7850 * 1.5 * (0.16 + 0.06))
    compliance = sum(1.0 / spring.stiffness[0] for spring in springs)
    assert compliance == pytest.approx(1.5 / 2.1e11 * (1 / 0.16 + 1 / 0.06))
