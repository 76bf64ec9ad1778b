"""Section forces along the frame, and their stress.

At an sde the section forces are its own forces. Anywhere inside an rfe they follow from the equilibrium of
the part of the rfe between the sde before it and the cut, under its distributed weight and the point forces
on it: exact, given the sde's forces.

Axes: 1 along the chain (A_R → B_R → B_L → A_L), 3 = x of {F}, 2 = 3 × 1. The forces are those that the part
behind the cut exerts on the part before it: N > 0 is tension.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aframe_env.rfem.beam import Array, Segment
from aframe_env.rfem.model import FrameModel
from aframe_env.scenario.cross_sections import GivenSection


@dataclass(frozen=True, kw_only=True)
class Cut:
    """A cut through the frame."""

    member: int
    """0 right leg, 1 top beam, 2 left leg."""
    position: float
    """Distance from the member's first end along the chain, m."""
    behind_point: bool = True
    """Side of a point force just there: cut behind it (True) or before it (False)."""


@dataclass(frozen=True, kw_only=True)
class PointForce:
    """A force on the frame at a place on a member's axis."""

    member: int
    position: float
    """Distance from the member's first end, m."""
    force: Array
    """Force in {F}, (3,), N."""


class SectionForces:
    """Section forces of a frame in static equilibrium.

    Args:
        model: The frame.
        position: q, (n,).
        point_forces: Every force and reaction at a point, in {F}.
        field: Acceleration field that makes the weight, along {F}, (3,), m/s².
    """

    def __init__(self, model: FrameModel, position: Array, point_forces: Sequence[PointForce], field: Array) -> None:
        self._model = model
        self._points = list(point_forces)
        self._field = field
        self._springs = model.spring_forces(position, field=field)
        self._before = {behind: index for index, (_, behind) in enumerate(model.structure.spring_bodies)}

    def at(self, cut: Cut) -> Array:
        """N, V2, V3 (N), T, M2, M3 (N m) at ``cut``; (6,)."""
        body, segments = self._part(cut)
        last = segments[-1]
        place = last.point(cut.position)
        force, moment = np.zeros(3), np.zeros(3)
        if body in self._before:
            spring = self._model.structure.springs[self._before[body]]
            axes = spring.member.axes
            values = self._springs[self._before[body]]
            force = axes @ values[:3]
            moment = axes @ values[3:] + np.cross(spring.place - place, force)
        for segment in segments:
            member_index = self._index(segment)
            high = cut.position if segment is last else segment.high
            for low, top, section in segment.member.pieces(segment.low, high):
                load = segment.member.material.density * section.area * (top - low) * self._field
                force = force - load
                moment = moment - np.cross(segment.point(0.5 * (low + top)) - place, load)
            for point in self._points:
                if point.member == member_index and self._acts(point, segment, cut, segment is last):
                    force = force - point.force
                    moment = moment - np.cross(segment.point(point.position) - place, point.force)
        axes = last.member.axes
        return np.concatenate([axes.T @ force, axes.T @ moment])

    def _index(self, segment: Segment) -> int:
        return ("right leg", "top beam", "left leg").index(segment.member.name)

    def _acts(self, point: PointForce, segment: Segment, cut: Cut, is_last: bool) -> bool:
        tiny = 1e-9 * segment.member.length
        # On the boundary of two rfes a point belongs to the first of them.
        first = segment.low - tiny if segment.low == 0.0 else segment.low + tiny
        if not first < point.position <= segment.high + tiny:
            return False
        if not is_last:
            return True
        limit = cut.position + tiny if cut.behind_point else cut.position - tiny
        return point.position <= limit

    def _part(self, cut: Cut) -> tuple[int, list[Segment]]:
        """Body that the cut goes through, and its segments from its beginning to the cut."""
        found: tuple[int, list[Segment]] | None = None
        for index, body in enumerate(self._model.structure.bodies):
            for number, segment in enumerate(body.segments):
                tiny = 1e-9 * segment.member.length
                inside = segment.low - tiny <= cut.position <= segment.high + tiny
                if self._index(segment) == cut.member and inside and found is None:
                    found = (index, list(body.segments[: number + 1]))
                    # What a joint holds together (three beams) is one rigid part.
                    for before, behind, _ in self._model.structure.joints:
                        if behind == index:
                            found = (before, [*self._model.structure.bodies[before].segments, *found[1]])
        if found is None:
            length = self._model.structure.springs[0].member.length
            raise ValueError(f"no rfe at {cut.position} m of member {cut.member} (right leg: 0 … {length} m)")
        return found


def von_mises(section: GivenSection, forces: Array) -> Array:
    """Largest von Mises stress over the section's stress points, (…,), Pa, of N, V2, V3, T, M2, M3, (…, 6).

    Normal stresses of N, M2 and M3, and shear stresses of V2, V3 and T, are each taken with the signs that
    add up: right for the worst of a point and its mirror images as to the normal stress, on the safe side as
    to shear. NaN for a section without stress points.
    """
    if not section.stress_points:
        return np.full(forces.shape[:-1], np.nan)
    normal, shear2, shear3, torque, moment2, moment3 = np.moveaxis(np.abs(forces), -1, 0)
    worst = np.zeros(forces.shape[:-1])
    for point in section.stress_points:
        sigma = (
            normal / section.area
            + moment2 * point.offset_3 / section.second_moment_2
            + moment3 * point.offset_2 / section.second_moment_3
        )
        tau = shear2 * point.shear_2 + shear3 * point.shear_3 + torque * point.torsion
        worst = np.maximum(worst, np.sqrt(sigma**2 + 3.0 * tau**2))
    return worst
