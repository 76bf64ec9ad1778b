"""The frame as a set of rfes and sdes: right leg, top beam and left leg, eqs. (8)–(22).

Every rfe has six generalised coordinates, eq. (9): the displacement of its centre of mass and a small
rotation, both along its own undeformed principal central axes (needed for the paper's mass matrix (14) to be
diagonal). The corner rfes, shared by a leg and the beam, are L-shaped, so their principal axes are turned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from aframe_env.rfem.beam import Array, Member, Segment, Spring, divide
from aframe_env.scenario.crane import Frame
from aframe_env.validation import InvalidValue, require_integer

OUT_OF_PLANE = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, kw_only=True)
class Division:
    """Numbers of primary elements of the members."""

    leg: int = 10
    """n of either leg, in [1, 10000]."""
    beam: int = 8
    """n of the top beam, even (the pulley S sits on its middle rfe), in [2, 10000]."""

    def __post_init__(self) -> None:
        require_integer("rfes (leg)", self.leg, low=1, high=10_000)
        require_integer("rfes (beam)", self.beam, low=2, high=10_000)
        if self.beam % 2:
            raise InvalidValue(f"rfes (beam) = {self.beam}: must be even, for S to lie on the middle rfe")


@dataclass(frozen=True, kw_only=True)
class Body:
    """One rigid finite element."""

    segments: tuple[Segment, ...]
    mass: float
    """kg."""
    centre: Array
    """Centre of mass in {F}, undeformed, (3,), m."""
    axes: Array
    """Columns: principal central axes in {F}, (3, 3), right-handed."""
    inertia: Array
    """Principal central moments of inertia, (3,), kg m²."""

    def displacement(self, place: Array) -> Array:
        """(3, 6): displacement in {F} of the body's point at ``place`` (in {F}, undeformed) by its
        coordinates."""
        arm = self.axes.T @ (place - self.centre)
        return np.hstack([self.axes, -self.axes @ cross_matrix(arm)])

    def rotation(self) -> Array:
        """(3, 6): small rotation in {F} by the coordinates."""
        return np.hstack([np.zeros((3, 3)), self.axes])


def cross_matrix(vector: Array) -> Array:
    """v× as a (3, 3) matrix."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def body_of(segments: Sequence[Segment]) -> Body:
    """Make one rfe of the given segments (two for a corner), in principal central axes."""
    parts = [segment.mass_properties() for segment in segments]
    mass = sum(part[0] for part in parts)
    centre = np.asarray(sum(part[0] * part[1] for part in parts)) / mass
    about_centre = sum(part[2] for part in parts) - mass * (float(centre @ centre) * np.eye(3))
    about_centre = about_centre + mass * np.outer(centre, centre)
    if len(segments) == 1:
        axes = segments[0].member.axes
    else:
        axes = np.linalg.eigh(about_centre)[1]
        axes[:, 2] *= np.sign(np.linalg.det(axes))
    return Body(
        segments=tuple(segments),
        mass=float(mass),
        centre=centre,
        axes=axes,
        inertia=np.diag(axes.T @ about_centre @ axes).copy(),
    )


@dataclass(frozen=True, kw_only=True)
class Structure:
    """Bodies, the springs between them, and the places that have a name."""

    bodies: tuple[Body, ...]
    springs: tuple[Spring, ...]
    spring_bodies: tuple[tuple[int, int], ...]
    """Bodies before and behind each spring along the chain."""
    joints: tuple[tuple[int, int, Array], ...]
    """Pairs of bodies that constraints hold rigidly together, with the place in {F}."""
    points: dict[str, tuple[int, Array]]
    """Named point → (index of the body it moves with, undeformed place in {F})."""
    corrected: bool
    """Whether the shear of the sdes is corrected, see :func:`aframe_env.rfem.beam.divide`."""

    @property
    def size(self) -> int:
        """Number of generalised coordinates of the frame, 6 a body."""
        return 6 * len(self.bodies)

    @property
    def elements(self) -> list[tuple[Spring, tuple[int, int]]]:
        """Every sde with the bodies before and behind it."""
        return list(zip(self.springs, self.spring_bodies, strict=True))

    def deformation(self) -> scipy.sparse.csr_array:
        """(6 n_sde, n): deformation of every sde along its member's axes (behind minus before)."""
        matrix = scipy.sparse.lil_array((6 * len(self.springs), self.size))
        for row, (spring, (before, behind)) in enumerate(self.elements):
            to_member = spring.member.axes.T
            for index, sign in ((before, -1.0), (behind, 1.0)):
                body = self.bodies[index]
                block = np.vstack([to_member @ body.displacement(spring.place), to_member @ body.rotation()])
                matrix[6 * row : 6 * row + 6, 6 * index : 6 * index + 6] = sign * block
        return scipy.sparse.csr_array(matrix)

    def stiffness(self) -> Array:
        """Diagonal of the sdes' stiffness, (6 n_sde,)."""
        return np.concatenate([spring.stiffness for spring in self.springs])

    def damping(self) -> Array:
        """Diagonal of the sdes' damping, (6 n_sde,)."""
        return np.concatenate([spring.damping for spring in self.springs])

    def translation(self, name: str) -> Array:
        """(3, n): displacement in {F} of a named point."""
        index, place = self.points[name]
        return self._spread(index, self.bodies[index].displacement(place))

    def rotation(self, name: str) -> Array:
        """(3, n): small rotation in {F} of the rfe that carries a named point."""
        index, _ = self.points[name]
        return self._spread(index, self.bodies[index].rotation())

    def _spread(self, index: int, block: Array) -> Array:
        matrix = np.zeros((block.shape[0], self.size))
        matrix[:, 6 * index : 6 * index + 6] = block
        return matrix


def members_of(frame: Frame) -> tuple[Member, Member, Member]:
    """Right leg (A_R to B_R), top beam (B_R to B_L), left leg (B_L to A_L) in {F}."""
    width, height, made_of = frame.half_width, frame.height, frame.structure
    places = [(-width, 0.0), (-width, height), (width, height), (width, 0.0)]
    foot_r, corner_r, corner_l, foot_l = (np.array([0.0, y, z]) for y, z in places)
    leg = made_of.leg_section
    # Given from foot to corner, but the left leg runs the other way.
    leg_down = leg[::-1] if isinstance(leg, tuple) else leg

    def member(name: str, start: Array, end: Array, beam: bool, down: bool) -> Member:
        section = made_of.beam_section if beam else (leg_down if down else leg)
        return Member(
            name=name,
            start=start,
            end=end,
            out_of_plane=OUT_OF_PLANE,
            section=section,
            material=made_of.material,
        )

    return (
        member("right leg", foot_r, corner_r, False, False),
        member("top beam", corner_r, corner_l, True, False),
        member("left leg", corner_l, foot_l, False, True),
    )


def divided_members(
    frame: Frame, division: Division, corrected_shear: bool
) -> list[tuple[list[Segment], list[Spring]]]:
    """Segments and sdes of right leg, top beam and left leg, each along the chain."""
    counts = (division.leg, division.beam, division.leg)
    return [
        divide(member, count, corrected_shear=corrected_shear)
        for member, count in zip(members_of(frame), counts, strict=True)
    ]


def _carrier(bodies: Sequence[Body], first: int, last: int, place: Array) -> int:
    """Index of the body among first … last that has ``place`` on one of its segments."""

    def gap(index: int) -> float:
        gaps = []
        for segment in bodies[index].segments:
            along = float(segment.member.axes[:, 0] @ (place - segment.member.start))
            nearest = segment.point(min(max(along, segment.low), segment.high))
            gaps.append(float(np.linalg.norm(place - nearest)))
        return min(gaps)

    return min(range(first, last + 1), key=lambda index: (round(gap(index), 9), index))


def named_points(
    frame: Frame, bodies: Sequence[Body], legs: tuple[int, int], beam: tuple[int, int]
) -> dict[str, tuple[int, Array]]:
    """The paper's points. ``legs``: last body of the right leg, first of the left; ``beam``: its first and
    last."""
    width, height, servomotor = frame.half_width, frame.height, frame.servomotor_height
    last = len(bodies) - 1
    places = {
        "A_R": (0, 0, -width, 0.0),
        "N_R": (0, legs[0], -width, servomotor),
        "B_R": (legs[0], legs[0], -width, height),
        "S": (beam[0], beam[1], 0.0, height),
        "B_L": (legs[1], legs[1], width, height),
        "N_L": (legs[1], last, width, servomotor),
        "A_L": (last, last, width, 0.0),
    }
    points = {}
    for name, (low, high, y, z) in places.items():
        place = np.array([0.0, y, z])
        points[name] = (_carrier(bodies, low, high, place), place)
    return points


def one_chain(frame: Frame, division: Division, *, corrected_shear: bool = True) -> Structure:
    """Build the paper's new model: one beam of n_1 + n_2 + n_3 + 1 rfes, the corner ones shared."""
    segments: list[tuple[Segment, ...]] = []
    springs: list[Spring] = []
    for index, (pieces, joined) in enumerate(divided_members(frame, division, corrected_shear)):
        if index:
            segments[-1] = (*segments[-1], pieces[0])
            pieces = pieces[1:]
        segments += [(piece,) for piece in pieces]
        springs += joined
    bodies = tuple(body_of(group) for group in segments)
    corners = (division.leg, division.leg + division.beam)
    return Structure(
        bodies=bodies,
        springs=tuple(springs),
        spring_bodies=tuple((index, index + 1) for index in range(len(springs))),
        joints=(),
        corrected=corrected_shear,
        points=named_points(frame, bodies, corners, corners),
    )


def three_beams(frame: Frame, division: Division, *, corrected_shear: bool = True) -> Structure:
    """Build the paper's previous model: right leg, top beam and left leg, each a beam of its own with n + 1 rfes.

    It has the same sdes as ``one_chain``; the corner rfes are split in two halves that a rigid joint at B_R and B_L
    (six reactions each) holds together.
    """
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
        corrected=corrected_shear,
        points=named_points(frame, bodies, (leg_end, beam_end + 1), (leg_end + 1, beam_end)),
    )
