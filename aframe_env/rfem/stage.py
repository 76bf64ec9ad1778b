"""The frame's modes in a stand-alone run, those of one luffing angle, and the forces on them beside the rope's."""

from __future__ import annotations

import numpy as np

from aframe_env.rfem.beam import Array
from aframe_env.rfem.carriage import Carriage
from aframe_env.rfem.constraints import servomotor_direction
from aframe_env.rfem.exact_step import exact_step
from aframe_env.rfem.luffed import LuffedFrame
from aframe_env.rfem.model import FrameModel
from aframe_env.rfem.reduction import ModalFrame, of_motion, resolved_form


class Stage:
    """Constants of the modes of one luffing angle. Keeps no model, whose basis is large."""

    def __init__(self, model: FrameModel, carriage: Carriage, luffed: LuffedFrame | None, step: float) -> None:
        modal = resolved_form(model, step, luffs=luffed is not None)
        self.count, self.shape, self.given = modal.count, modal.shape, model.lengthening
        """m, Φ (n, m), and q at rest for S_R or S_L longer by 1 m, (n, 2)."""
        self.exact = exact_step(modal, step)
        self.pulley, self.pulley_given = model.pulley @ self.shape, model.pulley @ self.given
        cubic, linear = (
            np.array([[self.pulley @ self.exact.times(part, self.pulley.T) for part in row] for row in factors])
            for factors in (self.exact.cubic, self.exact.linear)
        )
        self.answer = np.stack([cubic[:, 2], cubic[:, 3], linear[:, 1]], axis=1)
        """Place and rate of S by the rope's elastic force, its rate, and its damping force at the end: (2, 3, 3, 3)."""
        self.servomotors = None if luffed is None else TurningServomotors(modal, luffed)
        """None where the frame does not luff."""
        self.depends = carriage.turns or luffed is not None
        """Whether the forces depend on the state of the modes."""
        self._stiffness = model.stiffness
        # Forces on the modes, and what the servomotors' own constraints take of the same forces.
        rows = self.shape.T if luffed is None else np.vstack([self.shape.T, model.constraints.particular[:, :2].T])
        self._carriage, self._uniform = carriage, rows @ model.uniform_field()
        self._pulled = rows @ model.pulley.T
        self._carried = _Carried(carriage, modal, rows) if carriage.turns else None
        self._by_stroke = -self.shape.T @ np.hstack([model.damping @ self.given, model.mass @ self.given])
        self._to_modes, self._shortening = self.shape.T @ model.mass, model.servomotors

    def coordinates(self, position: Array, velocity: Array, stroke: Array) -> tuple[Array, Array]:
        """η and η̇, (m,), of q and q̇, (n,), and of a prescribed stroke and its rate, (2, 2)."""
        if self.servomotors is not None:
            stroke = -np.stack([self._shortening @ position, self._shortening @ velocity])
        place, rates = (
            self._to_modes @ (moved - self.given @ given)
            for moved, given in zip((position, velocity), stroke, strict=True)
        )
        return place, rates

    def forces(self, index: int, place: Array, rates: Array, stroke: Array, pull: Array) -> tuple[Array, Array]:
        """Forces on the modes beside the rope's, (m,), and of them those across servomotors that turn, (2,).

        Args:
            index: Of the time.
            place: η.
            rates: η̇.
            stroke: s, ṡ, s̈ of R and L, (3, 2); of a frame that luffs it is found here, and written.
            pull: The rope's force at S along {F}, (3,), N.
        """
        servomotors, count = self.servomotors, self.count
        if servomotors is not None:
            stroke[:2] = servomotors.stroke(index, place, rates)
        total, across = self._uniform @ self._carriage.field[index], np.zeros(2)
        if self._carried is not None:
            total -= self._carried.force(index, place, rates, stroke)
        if servomotors is not None:
            acting = total + self._pulled @ pull
            acting[:count] += self._by_stroke[:, :2] @ stroke[1]
            across, stroke[2] = servomotors.coupled(index, (place, rates), stroke, (acting[:count], acting[count:]))
            total = total[:count] + across @ servomotors.across_modes
        return total + self._by_stroke @ stroke[1:].ravel(), across

    def reactions(self, index: int, position: Array, others: Array, across: Array, bend: Array) -> Array:
        """All reactions on a frame that luffs, see ``TurningServomotors.reactions``, by q and L q̇ less the forces."""
        assert self.servomotors is not None
        return self.servomotors.reactions(index, self._stiffness @ position + others, across, bend)


class TurningServomotors:
    """Servomotors whose line turns in {F}, beside that of the luffing angle of some modes."""

    def __init__(self, modal: ModalFrame, luffed: LuffedFrame) -> None:
        model, natural = modal.model, slice(0, modal.natural)
        shapes = np.hstack([modal.shape, model.lengthening])
        self._luffed = luffed
        x, _, z = servomotor_direction(model.frame, "R")
        self._line, self._across_line = np.array([x, 0.0, z]), np.array([-z, 0.0, x])
        self._across = model.across_servomotors
        self._moved = self._across @ shapes
        self.across_modes = self._moved[:, :-2]
        """n·u_N of R and L by η, (2, m)."""
        self._particular = model.constraints.particular
        held = self._particular[:, :2].T
        self._by_place, self._by_rate = (held @ (matrix @ shapes) for matrix in (model.stiffness, model.damping))
        self._fed_back = held @ self._across.T
        self._weight = model.constraints.weight[:2]
        self._square, self._damping = modal.square[natural], modal.damping[natural]
        self._carried = modal.shape[:, natural].T @ (model.mass @ model.lengthening)

    def _slope(self, index: int) -> tuple[float, float, float]:
        """τ at time ``index``, its rate and acceleration."""
        slope = float(self._luffed.line[index] @ self._across_line) / self._share(index)
        turning, harder = self._luffed.turning[index].tolist()
        faster = (1.0 + slope**2) * turning
        return slope, faster, 2.0 * slope * faster * turning + (1.0 + slope**2) * harder

    def _share(self, index: int) -> float:
        """e·e_0."""
        return float(self._luffed.line[index] @ self._line)

    def _freed(self, slope: float) -> Array:
        """What of a displacement across the line is left after the stroke that it makes, (2, 2)."""
        return np.asarray(np.linalg.inv(np.eye(2) + slope * self._moved[:, -2:]))

    def stroke(self, index: int, place: Array, rates: Array) -> Array:
        """s and ṡ of R and L at time ``index`` by η and η̇, (2, 2)."""
        slope, faster, _ = self._slope(index)
        freed = self._freed(slope)
        stroke = -slope * (freed @ (self.across_modes @ place))
        moved = self._moved @ np.concatenate([place, stroke])
        return np.stack([stroke, -freed @ (slope * (self.across_modes @ rates) + faster * moved)])

    def coupled(
        self, index: int, modes: tuple[Array, Array], stroke: Array, acting: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        """Forces −τ μ across the line and s̈ of R and L, (2,) each, which depend on one another by η̈.

        Args:
            index: Of the time.
            modes: η and η̇.
            stroke: s and ṡ in its first two rows.
            acting: All other forces but elastic and damping ones: on the modes, (m,), and what μ takes of them, (2,).
        """
        slope, faster, harder = self._slope(index)
        place, rates = (np.concatenate([part, given]) for part, given in zip(modes, stroke[:2], strict=True))
        count = self._square.size
        across, weight = self.across_modes[:, :count], self._weight[:, :2]
        own = np.linalg.inv(np.eye(2) - slope * self._fed_back)
        rest = own @ (self._by_place @ place + self._by_rate @ rates - acting[1])
        free = acting[0][:count] - self._square * place[:count] - self._damping @ modes[1] - slope * (rest @ across)
        known = slope * (across @ free) + 2.0 * faster * (self._moved @ rates) + harder * (self._moved @ place)
        loop = slope * (across @ across.T) @ own @ weight - across @ self._carried
        freed = self._freed(slope)
        bend = np.linalg.solve(np.eye(2) + slope * freed @ loop, -freed @ known)
        return -slope * (rest - own @ (weight @ bend)), bend

    def reactions(self, index: int, residual: Array, across: Array, bend: Array) -> Array:
        """All reactions at time ``index``, the tensions of S_R and S_L first, (r,), N and N m.

        Args:
            index: Of the time.
            residual: K q + L q̇ less all forces on the frame but those of the servomotors, (n,).
            across: Their forces across the line, (2,), N.
            bend: s̈, (2,), m/s².
        """
        result = (residual - across @ self._across) @ self._particular - bend @ self._weight
        result[:2] /= self._share(index)
        return np.asarray(result)


class _Carried:
    """Forces that the turning of {F} takes beyond the uniform field: E_1 W + E(W) q + E(2 Ω×) q̇."""

    def __init__(self, carriage: Carriage, modal: ModalFrame, rows: Array) -> None:
        """``rows``: (r, n), take generalised forces on q to those that are wanted, as Φᵀ does."""
        self._turning, self._coriolis = (part.reshape(-1, 9) for part in (carriage.turning, carriage.coriolis))
        # W along {F}; the tables of the modal form have it along {D} at its luffing angle.
        to_deck = modal.model.to_deck
        own = np.concatenate([modal.carried, of_motion(modal.model, modal.model.lengthening)], axis=1)
        fixed, own = (
            np.tensordot(rows, np.einsum("...cd,ca,db->...ab", table, to_deck, to_deck, optimize=True), axes=1)
            for table in (modal.turning, own)
        )
        self._fixed = fixed.reshape(len(rows), 9)
        self._own = np.ascontiguousarray(own.reshape(len(rows), -1, 9).transpose(2, 0, 1))

    def force(self, index: int, place: Array, rates: Array, stroke: Array) -> Array:
        """At time ``index``, of η, η̇ and the stroke with its rate: (r,)."""
        moved, moving = np.concatenate([place, stroke[0]]), np.concatenate([rates, stroke[1]])
        own = self._turning[index] @ (self._own @ moved) + self._coriolis[index] @ (self._own @ moving)
        return np.asarray(self._fixed @ self._turning[index] + own)
