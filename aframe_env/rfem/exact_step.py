"""Exact step of modal coordinates: η̈ + ΦᵀLΦ η̇ + ω² η = f(t), with f a polynomial over the step.

The frame is linear between events, so that its own vibration is exact at any step; only the forces are interpolated:
linearly what the deck does to it, cubically (by values and rates at both ends) the rope's elastic pull.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from aframe_env.rfem.beam import Array
from aframe_env.rfem.reduction import ModalFrame

POWERS = 4
"""Powers of time in a cubic."""
RELAXATION = 0.02
"""Time in which a static shape follows a force on it, in steps."""


@dataclass(frozen=True, kw_only=True)
class ExactStep:
    """Place (row 0) and rate (row 1) at the end of a step, by what multiplies each array.

    The last axes are (m,), or (m, m) where the damping couples the modes.
    """

    step: float
    """Its length, s."""
    free: Array
    """(2, 2, …): η and η̇ at the start."""
    linear: Array
    """(2, 2, …): a force that goes linearly from its value at the start to that at the end."""
    cubic: Array
    """(2, 4, …): a force that goes along a cubic: value and rate at the start, value and rate at the end."""

    @property
    def couples(self) -> bool:
        """Whether the damping couples the modes."""
        return self.free.ndim == 4

    def times(self, factor: Array, values: Array) -> Array:
        """One of the factors times modal values (m,) or (m, k)."""
        if self.couples:
            return np.asarray(factor @ values)
        return np.asarray(factor * values if values.ndim == 1 else factor[:, None] * values)


def exact_step(modal: ModalFrame, step: float) -> ExactStep:
    """Factors of a step of length ``step``, s."""
    kept = modal.natural
    if modal.couples:
        factors = _by_powers(np.diag(modal.square), modal.damping, kept, step)
    else:
        square, damping = (values[:, None, None] for values in (modal.square, np.diag(modal.damping)))
        single = [
            _by_powers(square[part], damping[part], natural, step)
            for part, natural in ((slice(kept), 1), (slice(kept, None), 0))
        ]
        factors = np.moveaxis(np.concatenate(single)[:, :, :, 0, 0], 0, -1)
    one, first, second, third = np.moveaxis(factors[:, 2:], 1, 0)
    return ExactStep(
        step=step,
        free=factors[:, :2],
        linear=np.stack([one - first, first], axis=1),
        cubic=np.stack(
            [
                one - 3.0 * second + 2.0 * third,
                step * (first - 2.0 * second + third),
                3.0 * second - 2.0 * third,
                step * (third - second),
            ],
            axis=1,
        ),
    )


def _by_powers(square: Array, damping: Array, natural: int, step: float) -> Array:
    """Place and rate after a step by η, η̇ and forces (t/h)^k, k = 0 … 3: (…, 2, 6, s, s) for (…, s, s).

    The first ``natural`` coordinates have inertia; the rest follow what acts on them in RELAXATION of a step, or as
    their own damping lets them.
    """
    size = square.shape[-1]
    mode, shape = slice(0, natural), slice(natural, size)
    loose = damping[..., shape, shape] + RELAXATION * step * square[..., shape, shape]
    states = 2 + POWERS
    matrix = np.zeros((*square.shape[:-2], states, size, states, size))
    # In t/h, with h η̇ for the rate; the powers of time feed one another, the first feeds the coordinates.
    for power in range(POWERS - 1):
        matrix[..., 2 + power, :, 3 + power, :] = np.eye(size)
    matrix[..., 0, mode, 1, mode] = np.eye(natural)
    # What moves a static shape: [its place, the modes' rates, the force on it].
    matrix[..., 0, shape, 0, shape] = -step * np.linalg.solve(loose, square[..., shape, shape])
    matrix[..., 0, shape, 1, mode] = -np.linalg.solve(loose, damping[..., shape, mode])
    matrix[..., 0, shape, 2, shape] = step * np.linalg.inv(loose)
    matrix[..., 1, mode, 0, mode] = -(step**2) * square[..., mode, mode]
    matrix[..., 1, mode, 1, mode] = -step * damping[..., mode, mode]
    matrix[..., 1, mode, 2, mode] = step**2 * np.eye(natural)
    matrix[..., 1, mode, :, :] -= np.einsum(
        "...ms,...skn->...mkn", step * damping[..., mode, shape], matrix[..., 0, shape, :, :]
    )
    flat = matrix.reshape(*square.shape[:-2], states * size, states * size)
    grown = scipy.linalg.expm(flat).reshape(matrix.shape)
    # The rates of static shapes at the end follow from the state there, where every power of time is one.
    state = grown[..., :2, :, :, :].copy()
    state[..., 1, shape, :, :] = np.einsum(
        "...skm,...kmjn->...sjn", matrix[..., 0, shape, :2, :], grown[..., :2, :, :, :]
    )
    for power in range(POWERS):
        ended = matrix[..., 0, shape, 2, :] / math.factorial(power)
        state[..., 1, shape, 2 + power, :] += ended
    result = np.moveaxis(state, -2, -3) * np.array([1.0, step, 1.0, 1.0, 2.0, 6.0])[:, None, None]
    result[..., 1, :, :, :] /= step
    return np.asarray(result)
