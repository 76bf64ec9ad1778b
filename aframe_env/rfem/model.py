"""The full model's constant matrices: everything that statics, modes and dynamics need of the frame.

M_F, K_F and L_F are constant, eqs. (14)–(22). A frame on a deck that turns or a frame that luffs adds inertial terms
e_F, which are linear in the deck's acceleration and in q, q̇: a point of {F} at ρ has the acceleration w + W ρ, w = RᵀP̈
and W = RᵀR̈ (R: {F} → inertial, P: origin), and its displacement u adds W u + 2 Ω× u̇. Over the frame's mass that is
e_F = E_0 w + E_1 W + E(W) q + E(2 Ω×) q̇ (:mod:`aframe_env.rfem.slices`).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
import scipy

from aframe_env.dynamics.flexible.readout import SMALL_ROTATION
from aframe_env.rfem.banded import BandedCholesky
from aframe_env.rfem.beam import Array
from aframe_env.rfem.constraints import Constraints, constrain, luffing_rotation, servomotor_across, servomotor_rows
from aframe_env.rfem.slices import Slices, slices_of
from aframe_env.rfem.structure import Division, Structure, one_chain, three_beams
from aframe_env.scenario.crane import GRAVITY, Frame
from aframe_env.validation import SmallRotationWarning, require_choice

Layout: TypeAlias = Literal["one_chain", "three_beams"]
"""One chain with shared corner rfes (the paper's model), or three beams joined by 12 more reactions (its
previous)."""

DOWN = np.array([0.0, 0.0, -1.0])


def warn_of_rotation(largest: float, stacklevel: int = 2) -> bool:
    """Warn with the figure when an rfe's rotation ``largest``, rad, is above SMALL_ROTATION; return whether it is."""
    if largest > SMALL_ROTATION:
        warnings.warn(
            f"an rfe turned by {largest:.3g} rad: rotations are small by assumption (10), up to {SMALL_ROTATION} rad",
            SmallRotationWarning,
            stacklevel=stacklevel + 1,
        )
    return largest > SMALL_ROTATION


@dataclass(frozen=True)
class FrameModel:
    """The frame as rfes and sdes with its constraints eliminated: q = Z z + P b.

    Build it with :func:`frame_model`.
    """

    frame: Frame
    division: Division
    structure: Structure
    constraints: Constraints
    geometric: scipy.sparse.csr_array | None = None
    """Geometric stiffness K_G, (n, n), of the state about which it is linear, see
    :mod:`aframe_env.rfem.second_order`; None: of the undeformed and unloaded frame."""

    def changed(self, **changes: Any) -> FrameModel:
        """A copy with some fields changed that leave mass and damping as they are; these it takes over."""
        result = replace(self, **changes)
        for name in ("slices", "mass", "deformation", "damping"):
            result.__dict__[name] = getattr(self, name)
        return result

    @cached_property
    def slices(self) -> Slices:
        """Its mass and how q moves it."""
        return slices_of(self.structure)

    @cached_property
    def mass(self) -> scipy.sparse.csr_array:
        """M_F, (n, n), kg and kg m²; diagonal with the paper's elements, eq. (14)."""
        return self.slices.mass_matrix()

    @cached_property
    def deformation(self) -> scipy.sparse.csr_array:
        """(6 n_sde, n): deformations of the sdes."""
        return self.structure.deformation()

    @cached_property
    def stiffness(self) -> scipy.sparse.csr_array:
        """K_F with that of elastic servomotors and K_G, (n, n), N/m and N m/rad."""
        servomotor = self.frame.structure.servomotor.stiffness or 0.0
        total = self._assembled(self.structure.stiffness(), servomotor)
        return total if self.geometric is None else scipy.sparse.csr_array(total + self.geometric)

    @cached_property
    def damping(self) -> scipy.sparse.csr_array:
        """L_F with that of elastic servomotors, (n, n), N s/m and N m s/rad."""
        return self._assembled(self.structure.damping(), self.frame.structure.servomotor.damping)

    def _assembled(self, diagonal: Array, servomotor: float) -> scipy.sparse.csr_array:
        spread, rows = self.deformation, scipy.sparse.csr_array(self.servomotors)
        total = spread.T @ scipy.sparse.diags_array(diagonal) @ spread + servomotor * (rows.T @ rows)
        return scipy.sparse.csr_array(total)

    @cached_property
    def servomotors(self) -> Array:
        """(2, n): shortening of S_R and S_L."""
        return servomotor_rows(self.frame, self.structure)

    @cached_property
    def across_servomotors(self) -> Array:
        """(2, n): displacement of N_R and N_L across the servomotors, in the plane of leg and servomotor."""
        return servomotor_across(self.frame, self.structure)

    @cached_property
    def lengthening(self) -> Array:
        """(n, 2): q at rest and unloaded for S_R or S_L longer by 1 m; zero where they are elastic."""
        if self.frame.structure.servomotor.stiffness is not None:
            return np.zeros((self.structure.size, 2))
        given, basis = -self.constraints.particular[:, :2], self.constraints.basis
        bent = BandedCholesky(self.reduced_stiffness).solve(basis.T @ (self.stiffness @ given))
        return np.asarray(given - basis @ bent)

    @cached_property
    def pulley(self) -> Array:
        """(3, n): displacement of S in {F}; its transpose takes a force at S to generalised forces."""
        return self.structure.translation("S")

    @cached_property
    def to_deck(self) -> Array:
        """{F} → {D}, (3, 3)."""
        return luffing_rotation(self.frame.luffing_angle)

    @cached_property
    def reduced_stiffness(self) -> Array:
        """ZᵀKZ, (n_z, n_z)."""
        return self.reduced(self.stiffness)

    def reduced(self, matrix: Array | scipy.sparse.csr_array) -> Array:
        """ZᵀAZ, (n_z, n_z), of a symmetric matrix A, (n, n)."""
        basis = scipy.sparse.csr_array(self.constraints.basis)
        reduced = (basis.T @ scipy.sparse.csr_array(matrix) @ basis).toarray()
        return np.asarray(0.5 * (reduced + reduced.T), dtype=np.float64)

    @property
    def unknowns(self) -> dict[str, int]:
        """Counts: coordinates of the frame, with load and drum (the paper's n_q), reactions, free
        coordinates."""
        size, reactions = self.structure.size, len(self.constraints.names)
        return {
            "frame coordinates": size,
            "n_q": size + 4,
            "n_R": reactions,
            "free coordinates": size - reactions,
        }

    def weight(self, gravity: float = GRAVITY) -> Array:
        """Generalised forces of the frame's own weight with the deck level, eq. (22), (n,)."""
        down = self.to_deck.T @ DOWN
        return np.asarray(gravity * self.uniform_field() @ down, dtype=np.float64)

    def uniform_field(self) -> Array:
        """(n, 3): generalised forces per unit of a uniform acceleration field along the axes of {F}."""
        return self.slices.uniform()

    @cached_property
    def fixed_end_forces(self) -> Array:
        """Section forces at the sdes by a unit uniform field along {F}, the elements' ends held, (n_sde, 6, 3)."""
        return np.array([spring.fixed_end_forces for spring in self.structure.springs])

    def reactions(self, residual: Array, lengthening: Array | None = None) -> Array:
        """R, (…, r), of ``residual`` K q + L q̇ − f, (…, n), and s̈ of rigid servomotors, (…, 2), m/s²: Pᵀ(K q +
        L q̇ − f) + (CM⁻¹Cᵀ)⁻¹ b̈."""
        result = residual @ self.constraints.particular
        return np.asarray(result if lengthening is None else result - lengthening @ self.constraints.weight[:2])

    def servomotor_tensions(self, position: Array, velocity: Array, reactions: Array) -> Array:
        """Tension of S_R and S_L, (…, 2), N, from the reactions (rigid) or the springs (elastic)."""
        servomotor = self.frame.structure.servomotor
        if servomotor.stiffness is None:
            return reactions[..., :2]
        springs = servomotor.stiffness * position + servomotor.damping * velocity
        return np.asarray(-springs @ self.servomotors.T)

    def foot_reactions(self, reactions: Array, to_deck: Array | None = None) -> Array:
        """Forces on the frame at A_R and A_L along {D}, (…, 2, 3), N; ``to_deck``: {F} → {D} where the frame has
        luffed, (…, 3, 3)."""
        first = self.constraints.names.index("R_AR1")
        feet = reactions[..., first : first + 6].reshape(*reactions.shape[:-1], 2, 3)
        return np.asarray(feet @ (self.to_deck if to_deck is None else to_deck).swapaxes(-1, -2))

    def spring_forces(self, position: Array, velocity: Array | None = None, field: Array | None = None) -> Array:
        """Section forces N, V2, V3, T, M2, M3 at the sdes, (…, n_sde, 6), N and N m (N tension positive).

        Args:
            position: q, (…, n).
            velocity: q̇, (…, n); needed where there is damping.
            field: Uniform acceleration field along {F} (gravity less the deck's acceleration), (…, 3), m/s²;
                needed with corrected shear.
        """
        forces = (self.deformation @ position.T).T * self.structure.stiffness()
        if velocity is not None:
            forces = forces + (self.deformation @ velocity.T).T * self.structure.damping()
        result = np.asarray(forces).reshape(*position.shape[:-1], -1, 6)
        return result if field is None else result + np.einsum("sij,...j->...si", self.fixed_end_forces, field)

    def warn_of_rotation(self, position: Array) -> float:
        """Largest rotation of an rfe, rad; warn with the figure when it passes 0.05 rad."""
        angles = position.reshape(-1, 6)[:, 3:]
        largest = float(np.sqrt(np.max(np.sum(angles**2, axis=1))))
        warn_of_rotation(largest, stacklevel=3)
        return largest


def frame_model(
    frame: Frame,
    division: Division | None = None,
    *,
    layout: Layout = "one_chain",
    corrected_shear: bool = True,
) -> FrameModel:
    """Build the full model of ``frame``.

    Args:
        frame: Geometry, material, sections, servomotors.
        division: Primary elements of legs and beam; default 10 and 8.
        layout: ``"one_chain"`` (the paper's model) or ``"three_beams"`` (its previous one). Same results.
        corrected_shear: Correct the shear of the sdes, see :func:`aframe_env.rfem.beam.divide`, and take the mass that
            is consistent with it, see :mod:`aframe_env.rfem.slices`. False: the paper's elements, eqs. (2)–(7), (14).
    """
    require_choice("layout", layout, ("one_chain", "three_beams"))
    cut = division or Division()
    build = one_chain if layout == "one_chain" else three_beams
    structure = build(frame, cut, corrected_shear=corrected_shear)
    mass = slices_of(structure).mass_matrix()
    return FrameModel(frame, cut, structure, constrain(frame, structure, mass))
