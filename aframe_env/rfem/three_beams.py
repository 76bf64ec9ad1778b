"""The paper's previous model: three separate beams, joined at B_R and B_L by twelve more reactions.

It has the same sdes; the corner rfes are split in two halves that a rigid joint (six reactions) holds
together.
"""

from __future__ import annotations

from aframe_env.rfem.beam import Spring
from aframe_env.rfem.structure import Body, Division, Structure, body_of, divided_members, named_points
from aframe_env.scenario.crane import Frame


def three_beams(frame: Frame, division: Division, *, corrected_shear: bool = False) -> Structure:
    """Right leg, top beam and left leg, each a beam of its own with n + 1 rfes."""
    bodies: list[Body] = []
    springs: list[Spring] = []
    pairs: list[tuple[int, int]] = []
    for segments, joined in divided_members(frame, division, corrected_shear):
        first = len(bodies)
        bodies += [body_of((segment,)) for segment in segments]
        springs += joined
        pairs += [(first + index, first + index + 1) for index in range(len(joined))]
    leg_end, beam_end = division.leg, division.leg + division.beam + 1
    joints = [(end, end + 1, bodies[end + 1].segments[0].point(0.0)) for end in (leg_end, beam_end)]
    return Structure(
        bodies=tuple(bodies),
        springs=tuple(springs),
        spring_bodies=tuple(pairs),
        joints=tuple(joints),
        points=named_points(frame, bodies, (leg_end, beam_end + 1), (leg_end + 1, beam_end)),
    )
