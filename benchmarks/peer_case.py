"""A scenario of the full model as plain data, for programs that share nothing with ours."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from aframe_env import InvalidValue, Scenario
from aframe_env.rfem.constraints import luffing_rotation
from aframe_env.rfem.structure import members_of
from aframe_env.scenario.motion import COORDINATES, HarmonicMotion


def case_of(scenario: Scenario, mesh: tuple[int, int], duration: float, interval: float) -> dict[str, Any]:
    """The case as data for another program: SI units, along {D} at rest, sections' axes as columns.

    Args:
        scenario: Crane, ship motion (harmonic), load, rope, start.
        mesh: Elements of a leg and of the top beam.
        duration: s.
        interval: Between outputs, s.
    """
    crane, frame = scenario.crane, scenario.crane.frame
    material = frame.structure.material
    if not isinstance(scenario.motion, HarmonicMotion) or scenario.ramp:
        raise InvalidValue("scenario: must have a harmonic motion without a ramp")
    if any(harmonic.coordinate in COORDINATES[3:] for harmonic in scenario.motion.harmonics):
        raise InvalidValue("scenario: must have a deck that does not turn")
    if frame.structure.servomotor.stiffness is not None or material.normal_damping or material.tangential_damping:
        raise InvalidValue("scenario: must have an undamped frame with rigid servomotors")
    to_deck = luffing_rotation(frame.luffing_angle)
    members = []
    for member, count in zip(members_of(frame), (mesh[0], mesh[1], mesh[0]), strict=True):
        section = member.section_at(0.5 * member.length)
        e, g, density = material.young_modulus, material.shear_modulus, material.density
        members.append(
            {
                "start": (to_deck @ member.start).tolist(),
                "end": (to_deck @ member.end).tolist(),
                "axes": (to_deck @ member.axes).tolist(),
                "elements": count,
                "stiffness": [
                    e * section.area,
                    g * section.area / section.shear_factor_2,
                    g * section.area / section.shear_factor_3,
                    g * section.torsion_constant,
                    e * section.second_moment_2,
                    e * section.second_moment_3,
                ],
                "mass_per_length": density * section.area,
                "inertia_per_length": [
                    density * moment
                    for moment in (section.rotary_moment, section.second_moment_2, section.second_moment_3)
                ],
            }
        )
    sides = (-frame.half_width, frame.half_width)
    pulley = crane.pulley_position
    return {
        "gravity": scenario.gravity,
        "duration": duration,
        "output_interval": interval,
        "initial": scenario.initial,
        "motion": [asdict(harmonic) for harmonic in scenario.motion.harmonics],
        "members": members,
        "feet": [[0.0, y, 0.0] for y in sides],
        "servomotors": [
            {
                "leg": (to_deck @ np.array([0.0, y, frame.servomotor_height])).tolist(),
                "deck": [frame.servomotor_deck_x, y, 0.0],
            }
            for y in sides
        ],
        "pulley": list(pulley),
        "drum": list(crane.drum_position),
        "load": {"mass": scenario.load_mass, "place": [*pulley[:2], scenario.target_level]},
        "rope": {
            "axial_stiffness": crane.rope.axial_stiffness,
            "unstretched_length": scenario.free_length,
            "damping": scenario.rope_damping,
        },
    }
