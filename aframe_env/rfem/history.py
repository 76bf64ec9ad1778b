"""Time series of the frame: deflections, reactions, section forces from the stored coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aframe_env.rfem.beam import Array
from aframe_env.rfem.luffed import LuffedFrame
from aframe_env.rfem.model import FrameModel
from aframe_env.rfem.section_forces import von_mises


@dataclass(frozen=True, kw_only=True)
class FrameHistory:
    """The frame at k times. Vectors are along {D}."""

    model: FrameModel
    time: Array
    """(k,), s."""
    position: Array
    """q, (k, n)."""
    velocity: Array
    """q̇, (k, n)."""
    force: Array
    """Generalised forces on the frame, inertial ones of the deck's motion included, (k, n)."""
    field: Array
    """Uniform acceleration field along {F}: gravity less the deck's acceleration, (k, 3), m/s²."""
    stroke: Array | None = None
    """Prescribed change of the lengths of S_R and S_L, its rate and acceleration, (3, k, 2), m, m/s, m/s²."""
    luffed: LuffedFrame | None = None
    """Its way where it luffs; the constraints of ``model`` are then those of the first luffing angle."""
    held: Array | None = None
    """The reactions where it luffs, (k, r)."""

    def displacement(self, name: str) -> Array:
        """(k, 3), m: displacement of a named point."""
        rows = self.model.structure.translation(name)
        if self.luffed is not None:
            return np.asarray(np.einsum("kij,kj->ki", self.luffed.to_deck, self.position @ rows.T))
        return np.asarray(self.position @ (self.model.to_deck @ rows).T)

    def reactions(self) -> Array:
        """(k, r): reactions in the order of the constraints' names."""
        if self.held is not None:
            return self.held
        model = self.model
        residual = self.position @ model.stiffness + self.velocity @ model.damping - self.force
        return model.reactions(residual, None if self.stroke is None else self.stroke[2])

    def feet(self) -> Array:
        """(k, 2, 3), N: force on the frame at A_R and A_L."""
        return self.model.foot_reactions(self.reactions(), None if self.luffed is None else self.luffed.to_deck)

    def servomotors(self) -> Array:
        """(k, 2), N: tension of S_R and S_L."""
        return self.model.servomotor_tensions(self.position, self.velocity, self.reactions())

    def constraint_rows(self, name: str) -> Array:
        """(k, n): of a servomotor "S_R" or "S_L" that luffs, its shortening by q."""
        assert self.luffed is not None
        return np.asarray(-self.luffed.line @ self.model.structure.translation(f"N_{name[-1]}"))

    def constraint_forces(self) -> Array:
        """(k, n): generalised forces of the reactions."""
        reactions, result = self.reactions(), np.zeros(self.position.shape)
        for index, name in enumerate(self.model.constraints.names):
            turns = self.luffed is not None and name in ("S_R", "S_L")
            rows = self.constraint_rows(name) if turns else self.model.constraints.matrix[index]
            result += reactions[:, index : index + 1] * rows
        return result

    def luffing_power(self) -> Array:
        """(k,), W: power of both servomotors together; negative where the frame drives them."""
        if self.luffed is None:
            return np.zeros(self.time.size)
        return np.asarray(-np.sum(self.servomotors(), axis=1) * self.luffed.length_rate)

    def spring_forces(self) -> Array:
        """(k, n_sde, 6): N, V2, V3 (N), T, M2, M3 (N m) at the sdes."""
        return self.model.spring_forces(self.position, self.velocity, self.field)

    def von_mises(self) -> Array:
        """(k, n_sde), Pa: largest von Mises stress of the section at every sde."""
        forces = self.spring_forces()
        springs = self.model.structure.springs
        return np.column_stack(
            [
                von_mises(spring.member.section_at(spring.position), forces[:, index])
                for index, spring in enumerate(springs)
            ]
        )

    def constraint_violation(self) -> float:
        """Largest movement of a foot from its pin or error of a rigid servomotor's length, m."""
        rows = [i for i, name in enumerate(self.model.constraints.names) if not name.startswith("J")]
        gap = self.position @ self.model.constraints.matrix[rows].T
        if self.luffed is not None:
            for column, name in enumerate(("S_R", "S_L")):
                gap[:, column] = np.sum(self.position * self.constraint_rows(name), axis=1)
        if self.stroke is not None:
            gap[:, :2] += self.stroke[0]
        return float(np.max(np.abs(gap)))
