"""What the linear frame leaves out: second order in the displacements, of chain, servomotors and rope.

A rigid finite element that turns by θ takes a point at r from its centre by u + θ× r + ½ θ×(θ× r); a spring between two
is deformed as seen from their mean orientation. The quadratic part d₂ of a deformation times the force f that acts in
it is the geometric stiffness (P–Δ): f·d₂ = ½ qᵀ K_G q. Frames that sway under load are softer for it, ropes and tight
servomotors that turn with them hold them back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from aframe_env.rfem.beam import Array
from aframe_env.rfem.constraints import servomotor_direction, servomotor_length
from aframe_env.rfem.model import FrameModel
from aframe_env.rfem.structure import cross_matrix


@dataclass(frozen=True)
class _Pair:
    """A spring and its bodies: what turns and what deforms it, by q, along {F}."""

    before: slice
    """Of q."""
    behind: slice
    arms: tuple[Array, Array]
    """From the bodies' centres to the spring, m."""
    turns: tuple[Array, Array]
    """Rotations by the bodies' own coordinates, (3, 6) each."""
    moves: tuple[Array, Array]
    """Displacements of their points at the spring, (3, 6) each."""
    axes: Array
    """Of the member, columns."""


class Geometry:
    """Quadratic kinematics of a frame."""

    def __init__(self, model: FrameModel) -> None:
        self.model = model

    @cached_property
    def _pairs(self) -> list[_Pair]:
        structure = self.model.structure
        pairs = []
        for spring, indices in structure.elements:
            bodies = [structure.bodies[index] for index in indices]
            pairs.append(
                _Pair(
                    before=slice(6 * indices[0], 6 * indices[0] + 6),
                    behind=slice(6 * indices[1], 6 * indices[1] + 6),
                    arms=(spring.place - bodies[0].centre, spring.place - bodies[1].centre),
                    turns=(bodies[0].rotation(), bodies[1].rotation()),
                    moves=(bodies[0].displacement(spring.place), bodies[1].displacement(spring.place)),
                    axes=spring.member.axes,
                )
            )
        return pairs

    def deformations(self, position: Array) -> Array:
        """d₂ of the springs along their members' axes, (n_sde, 6), of q, (n,)."""
        result = np.zeros((len(self._pairs), 6))
        for row, pair in zip(result, self._pairs, strict=True):
            own = position[pair.before], position[pair.behind]
            first, second = (turn @ q for turn, q in zip(pair.turns, own, strict=True))
            gap = pair.moves[1] @ own[1] - pair.moves[0] @ own[0]
            bent = 0.5 * np.cross(second, np.cross(second, pair.arms[1]))
            bent -= 0.5 * np.cross(first, np.cross(first, pair.arms[0]))
            row[:3] = pair.axes.T @ (bent - np.cross(0.5 * (first + second), gap))
            row[3:] = pair.axes.T @ (-0.5 * np.cross(first, second))
        return result

    def lengthening(self, position: Array) -> Array:
        """Second-order lengthening of S_R and S_L by q, (2,), m."""
        return np.array([0.5 * position @ (stiffness @ position) for stiffness in self._of_servomotors])

    @cached_property
    def _of_servomotors(self) -> list[sp.csr_array]:
        """Geometric stiffness of S_R and S_L by unit tension, (n, n) each."""
        structure, found = self.model.structure, []
        for side in ("R", "L"):
            along = servomotor_direction(self.model.frame, side)
            across = np.eye(3) - np.outer(along, along)
            moved = sp.csr_array(structure.translation(f"N_{side}"))
            held = moved.T @ (across / servomotor_length(self.model.frame)) @ moved
            found.append(sp.csr_array(held + self._of_force(f"N_{side}", -along)))
        return found

    def _of_force(self, point: str, force: Array) -> sp.csr_array:
        """Geometric stiffness of a dead force along {F} at a named point."""
        index, place = self.model.structure.points[point]
        body = self.model.structure.bodies[index]
        turn = sp.csr_array(self.model.structure.rotation(point))
        return sp.csr_array(-(turn.T @ _arm_stiffness(force, place - body.centre) @ turn))

    def stiffness(self, springs: Array, tensions: Array, forces: Mapping[str, Array]) -> sp.csr_array:
        """K_G, (n, n).

        Args:
            springs: Section forces at the sdes, (n_sde, 6).
            tensions: Of S_R and S_L, (2,), N.
            forces: Dead forces on the frame along {F} at named points, N.
        """
        size = self.model.structure.size
        rows, columns, values = [], [], []
        for pair, section in zip(self._pairs, springs, strict=True):
            force, moment = pair.axes @ section[:3], pair.axes @ section[3:]
            first, second = pair.turns
            skew = cross_matrix(force)
            block = np.zeros((12, 12))
            block[:6, :6] -= first.T @ _arm_stiffness(force, pair.arms[0]) @ first
            block[6:, 6:] += second.T @ _arm_stiffness(force, pair.arms[1]) @ second
            mean, gap = 0.5 * np.hstack([first, second]), np.hstack([-pair.moves[0], pair.moves[1]])
            block += mean.T @ skew @ gap + (mean.T @ skew @ gap).T
            twisted = 0.5 * first.T @ cross_matrix(moment) @ second
            block[:6, 6:] += twisted
            block[6:, :6] += twisted.T
            places = np.r_[pair.before, pair.behind]
            rows.append(np.repeat(places, 12))
            columns.append(np.tile(places, 12))
            values.append(block.ravel())
        of_springs = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        total = sp.csr_array(of_springs, shape=(size, size))
        for tension, unit in zip(tensions, self._of_servomotors, strict=True):
            total = total + float(tension) * unit
        for point, force in forces.items():
            total = total + self._of_force(point, force)
        return sp.csr_array(total)

    def of_rope(self, tension: float, to_drum: Array) -> sp.csr_array:
        """Geometric stiffness of a rope of that tension, N, from S along ``to_drum`` in {F}, (3,), m, which turns as S
        moves."""
        length = float(np.linalg.norm(to_drum))
        along = to_drum / length
        moved = sp.csr_array(self.model.pulley)
        return sp.csr_array(moved.T @ (tension / length * (np.eye(3) - np.outer(along, along))) @ moved)


def _arm_stiffness(force: Array, arm: Array) -> Array:
    """H of ``force``·½ θ×(θ× ``arm``) = ½ θᵀ H θ, (3, 3)."""
    both = np.outer(force, arm)
    return np.asarray(0.5 * (both + both.T) - float(force @ arm) * np.eye(3))


def stiffened(model: FrameModel, geometric: sp.csr_array) -> FrameModel:
    """The model with that geometric stiffness."""
    return model.changed(geometric=geometric)
