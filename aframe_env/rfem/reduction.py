"""The frame of the full model in modal coordinates, as runs and kernels step it and read it out.

q = Φ η, with Φ of the frame's natural modes (ΦᵀMΦ = 1, ΦᵀKΦ = diag ω²), so that a force at S and the deck's motion
reach each coordinate separately. With all modes the model is the full one, only in other coordinates. With fewer, the
static shapes of what acts on the frame stand beside the lowest modes: a force at S, a uniform field (own weight,
acceleration of the deck), angular acceleration of the deck, servomotors that change their length. The truncation then
costs nothing at rest and next to nothing below the highest mode that is kept; static shapes have no inertia, so that
what a shock would excite above it is left out.

Vectors are along {D}, the deck's axes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy

from aframe_env.rfem.banded import BandedCholesky
from aframe_env.rfem.beam import Array
from aframe_env.rfem.model import FrameModel, frame_model
from aframe_env.rfem.structure import Division
from aframe_env.scenario.crane import Frame

CARRIED_MODES = 8
"""Modes of a reduced frame whose own displacement feels the turning of the deck, E(W) q and E(2 Ω×) q̇; the lowest
ones."""
STATIC_SHAPES = 11
"""Most static shapes beside the modes of a reduced frame: a force at S, a uniform field, the deck's angular
acceleration, three each; the lengths of two servomotors."""
SWING_SHAPES = 2
"""Static shapes more of a frame that luffs: forces across its servomotors."""
ROUNDING = 1e-9
"""Share of the damping's diagonal up to which what lies off it is rounding."""
SPARSE = 600
"""Free coordinates above which the lowest modes are found by Lanczos iteration."""


@dataclass(frozen=True, kw_only=True)
class ModalFrame:
    """A frame of m modal coordinates η."""

    model: FrameModel
    natural: int
    """How many coordinates are of natural modes; static shapes follow them, which answer a force without inertia."""
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

    @property
    def couples(self) -> bool:
        """Whether the damping couples the modes (normal and tangential not in the ratio of E to G)."""
        diagonal = np.diag(self.damping)
        beside = np.max(np.abs(self.damping - np.diag(diagonal)))
        return bool(beside > ROUNDING * np.max(diagonal, initial=1e-300))

    def project(self, forces: Array) -> Array:
        """Generalised forces on η of those on q, (n, ...) → (m, ...)."""
        return np.tensordot(self.shape.T, forces, axes=1)

    def coordinates(self, position: Array) -> Array:
        """η, (m,), of q or of a velocity, (n,)."""
        return np.asarray(self.shape.T @ (self.model.mass @ position))


def natural_modes(model: FrameModel, count: int | None = None) -> tuple[Array, Array]:
    """ω², (k,), 1/s², and Φ, (n, k), of the ``count`` lowest natural modes, or of all; ΦᵀMΦ = 1."""
    stiffness, mass = model.reduced_stiffness, model.reduced(model.mass)
    size = len(mass)
    if count is None or 4 * count >= size:
        squares, vectors = scipy.linalg.eigh(stiffness, mass)
    elif size < SPARSE:
        squares, vectors = scipy.linalg.eigh(stiffness, mass, subset_by_index=[0, count - 1])
    else:
        pair = [scipy.sparse.csc_array(matrix) for matrix in (stiffness, mass)]
        # A start that does not change makes the same bits each time.
        squares, vectors = scipy.sparse.linalg.eigsh(pair[0], count, pair[1], sigma=0.0, v0=np.ones(size))
    return squares[:count], model.constraints.basis @ vectors[:, :count]


def modes_below(model: FrameModel, highest: float) -> tuple[Array, Array]:
    """Natural modes up to the angular frequency ``highest``, rad/s, as ``natural_modes`` gives them."""
    size, count = model.constraints.basis.shape[1], 32
    while True:
        squares, shapes = natural_modes(model, count)
        below = squares <= highest**2
        if not below.all() or squares.size == size:
            return squares[below], shapes[:, below]
        count = min(2 * count, size)


def with_static_shapes(model: FrameModel, modes: tuple[Array, Array], loads: Array) -> tuple[Array, Array]:
    """ω², (m,), and Φ, (n, m), of ``modes`` and of the static shapes of the generalised forces ``loads``, (n, k)."""
    squares, shapes = modes
    basis, mass = model.constraints.basis, model.mass
    static = basis @ BandedCholesky(model.reduced_stiffness).solve(basis.T @ loads)
    # A static shape less its share in the modes that are kept is a sum of the modes that are not.
    static -= shapes @ (shapes.T @ (mass @ static))
    static /= np.sqrt(np.sum(static * (mass @ static), axis=0))
    sizes, directions = scipy.linalg.eigh(static.T @ (mass @ static))
    static = static @ (directions[:, sizes > 1e-9] / np.sqrt(sizes[sizes > 1e-9]))
    square, mixed = scipy.linalg.eigh(static.T @ (model.stiffness @ static))
    return np.concatenate([squares, square]), np.hstack([shapes, static @ mixed])


@lru_cache(maxsize=8)
def modal_frame(frame: Frame, division: Division, modes: int | None) -> ModalFrame:
    """Modal form of a frame of corrected elements.

    Args:
        frame: Geometry, material, sections, servomotors.
        division: Primary elements of legs and beam.
        modes: Number of natural modes to keep beside the static shapes; None for all.
    """
    model = frame_model(frame, division)
    return modal_form(model, natural_modes(model, modes), CARRIED_MODES)


def modal_form(
    model: FrameModel, modes: tuple[Array, Array], carried_modes: int | None = None, *, luffs: bool = False
) -> ModalFrame:
    """Modal form of a model.

    Args:
        model: The frame.
        modes: Its natural modes, all or the lowest, see ``natural_modes``.
        carried_modes: The most whose own displacement is to feel the turning of the deck; None for all.
        luffs: Whether forces across the servomotors are to have static shapes.
    """
    to_deck, turning = model.to_deck, np.zeros((model.structure.size, 3, 3))
    for c, d, unit in _units(model):
        turning[:, c, d] = model.slices.of_field(unit)
    pulley, uniform = to_deck @ model.pulley, model.uniform_field() @ to_deck.T
    spin_up = np.stack([turning[:, d, c] - turning[:, c, d] for c, d in ((1, 2), (2, 0), (0, 1))], axis=1)
    rigid = model.frame.structure.servomotor.stiffness is None
    lengths = [model.mass @ model.lengthening] if rigid else []
    loads = np.hstack([pulley.T, uniform, spin_up, *lengths, *([model.across_servomotors.T] if luffs else [])])
    squares, shape = modes
    if squares.size + max(STATIC_SHAPES, loads.shape[1]) < model.constraints.basis.shape[1]:
        squares, shape = with_static_shapes(model, modes, loads)
    return ModalFrame(
        model=model,
        natural=modes[0].size,
        shape=shape,
        square=squares,
        damping=np.asarray(shape.T @ (model.damping @ shape)),
        pulley=pulley,
        uniform=uniform,
        turning=turning,
        carried=of_motion(model, shape[:, :carried_modes]),
    )


def resolved_form(model: FrameModel, step: float, *, luffs: bool = False) -> ModalFrame:
    """Modal form of a model with the modes that a ``step``, s, resolves: of a period of two steps or more.

    Damping that couples modes reaches those above too; a frame of few rfes keeps them all for it.
    """
    modal = modal_form(model, modes_below(model, math.pi / step), luffs=luffs)
    if modal.couples and modal.natural < model.constraints.basis.shape[1] < SPARSE:
        return modal_form(model, natural_modes(model), luffs=luffs)
    return modal


def of_motion(model: FrameModel, position: Array) -> Array:
    """Inertial terms by W along {D} of displacements q, (n, k): E(W) q = Σ W_cd result[:, :, c, d], (n, k, 3, 3)."""
    result = np.zeros((*position.shape, 3, 3))
    for c, d, unit in _units(model):
        result[:, :, c, d] = model.slices.of_motion(unit, position)
    return result


def _units(model: FrameModel) -> Iterator[tuple[int, int, Array]]:
    """Matrices of one entry along {D}, turned to {F}."""
    for c in range(3):
        for d in range(3):
            yield c, d, np.outer(model.to_deck[c], model.to_deck[d])
