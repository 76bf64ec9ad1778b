"""The frame of the full model in modal coordinates, as the compiled kernels step it and read it out.

q = Φ η, with Φ of the frame's natural modes (ΦᵀMΦ = 1, ΦᵀKΦ = diag ω²), so that a force at S and the deck's motion
reach each coordinate separately. With all modes the model is the full one, only in other coordinates. With fewer, the
static shapes of what acts on the frame stand beside the lowest modes: a force at S, a uniform field (own weight,
acceleration of the deck), angular acceleration of the deck. The truncation then costs nothing at rest, some 1e-4 of the
reactions in a sea; only what makes the frame ring (a sudden start) excites the modes that are left out.

Vectors are along {D}, the deck's axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from aframe_env.rfem.beam import Array
from aframe_env.rfem.model import CarriedInertia, FrameModel, apply_blocks, frame_model
from aframe_env.rfem.structure import Division
from aframe_env.scenario.crane import Frame

CARRIED_MODES = 8
"""Modes whose own displacement feels the turning of the deck, E(W) q and E(2 Ω×) q̇; the lowest ones."""
STATIC_SHAPES = 9
"""Static shapes beside the modes of a reduced frame: a force at S, a uniform field, the deck's angular acceleration,
three each."""


@dataclass(frozen=True, kw_only=True)
class ModalFrame:
    """A frame of m modal coordinates η."""

    model: FrameModel
    shape: Array
    """Φ, (n, m)."""
    square: Array
    """ω², (m,), 1/s²."""
    damping: Array
    """ΦᵀLΦ, (m, m), 1/s."""
    pulley: Array
    """Displacement of S by q, (3, n); its transpose takes a force at S to generalised forces."""
    uniform: Array
    """Generalised forces of a unit uniform field, (n, 3)."""
    turning: Array
    """Generalised inertial terms E_1 of the undeformed frame for W = α× + Ω×Ω×, (n, 3, 3)."""
    carried: Array
    """Inertial terms of the lowest c modes' displacement, E(W) Φ = Σ W_cd carried[:, :, c, d], (n, c, 3, 3)."""

    @property
    def count(self) -> int:
        """m."""
        return self.square.size

    @property
    def carried_count(self) -> int:
        """c."""
        return int(self.carried.shape[1])

    def project(self, forces: Array) -> Array:
        """Generalised forces on η of those on q, (n, ...) → (m, ...)."""
        return np.tensordot(self.shape.T, forces, axes=1)


def basis(model: FrameModel, modes: int | None, loads: Array) -> tuple[Array, Array]:
    """ω², (m,), and modes of the free coordinates, (n_z, m): all, or the lowest ``modes`` and static shapes.

    ``loads`` are the generalised forces (n, k) of the static shapes.
    """
    stiffness = model.reduced_stiffness
    squares, vectors = scipy.linalg.eigh(stiffness)
    if modes is None or modes + STATIC_SHAPES >= squares.size:
        return squares, vectors
    # A static shape less its share in the modes that are kept is a sum of the modes that are not.
    left = vectors[:, modes:]
    shapes = left @ ((left.T @ model.constraints.basis.T @ loads) / squares[modes:, None])
    directions, sizes, _ = np.linalg.svd(shapes / np.linalg.norm(shapes, axis=0), full_matrices=False)
    kept = np.hstack([vectors[:, :modes], directions[:, sizes > 1e-9]])
    reduced, mixed = scipy.linalg.eigh(kept.T @ stiffness @ kept)
    return reduced, kept @ mixed


@lru_cache(maxsize=8)
def modal_frame(frame: Frame, division: Division, modes: int | None) -> ModalFrame:
    """Modal form of a frame.

    Args:
        frame: Geometry, material, sections, servomotors.
        division: Primary elements of legs and beam.
        modes: Number of natural modes to keep beside the static shapes; None for all.
    """
    model = frame_model(frame, division)
    to_deck = model.to_deck
    inertia = CarriedInertia(model)
    # W of one entry along {D}, turned to {F}.
    units = {(c, d): np.outer(to_deck[c], to_deck[d]) for c in range(3) for d in range(3)}
    turning = np.zeros((model.structure.size, 3, 3))
    for (c, d), unit in units.items():
        turning[:, c, d] = inertia.constant(np.zeros(3), unit)
    pulley, uniform = to_deck @ model.pulley, model.uniform_field() @ to_deck.T
    spin_up = np.stack([turning[:, d, c] - turning[:, c, d] for c, d in ((1, 2), (2, 0), (0, 1))], axis=1)
    squares, vectors = basis(model, modes, np.hstack([pulley.T, uniform, spin_up]))
    shape = model.constraints.basis @ vectors
    carried = np.zeros((model.structure.size, min(CARRIED_MODES, squares.size), 3, 3))
    for (c, d), unit in units.items():
        blocks = inertia.blocks(unit)
        for mode in range(carried.shape[1]):
            carried[:, mode, c, d] = apply_blocks(blocks, shape[:, mode])
    return ModalFrame(
        model=model,
        shape=shape,
        square=squares,
        damping=shape.T @ model.damping @ shape,
        pulley=pulley,
        uniform=uniform,
        turning=turning,
        carried=carried,
    )
