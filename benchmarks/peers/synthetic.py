"""A motion of the deck of 32 components by formula, which the package and its peers are given alike."""

from __future__ import annotations

import numpy as np

COMPONENTS = 32


def components() -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (32,) rad/s and complex amplitudes (32, 6), m and rad: a metre of heave and 2° of roll at most.

    In the first minute, when they are out of step, it is some centimetres: what a step costs does not depend on it, but
    an adaptive integrator has it easier than in a sea.
    """
    k = np.arange(COMPONENTS)
    frequency = 0.35 + 0.04 * k
    size = np.exp(-(((frequency - 0.7) / 0.25) ** 2))
    coordinate = np.arange(6)
    phase = 2.4 * k[:, None] ** 2 + 1.1 * coordinate  # linear in k the components would be one pulse, soon gone
    scale = np.array([0.2, 0.2, 0.4, 0.012, 0.006, 0.003])
    return frequency, scale * size[:, None] * np.exp(1j * phase)
