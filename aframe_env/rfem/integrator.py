"""Average acceleration (Newmark's β = 1/4, γ = 1/2) for the frame's free coordinates, factorised once.

The scheme is implicit in everything that is linear in the frame and is stable at any step, second order, and
conserves the energy of a linear undamped system.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from aframe_env.rfem.banded import BandedCholesky
from aframe_env.rfem.beam import Array
from aframe_env.rfem.model import FrameModel
from aframe_env.validation import require_number


class AverageAcceleration:
    """Integrator of z̈ + L ż + K z = F(t) with a fixed step.

    Args:
        model: The frame.
        step: h, s, above 0.

    Attributes:
        position, velocity, acceleration: z, ż, z̈ of the latest finished step, (n_z,).
        pulley: (3, n_z), displacement of S along {F}.
        response: (n_z, 3), acceleration z̈ at the end of the step for a unit force at S there.
    """

    def __init__(self, model: FrameModel, step: float) -> None:
        require_number("step", step, "s", low=0.0, low_open=True)
        self.step = step
        self._basis = model.constraints.basis
        self._stiffness = sp.csr_array(model.reduced_stiffness)
        self._damping = sp.csr_array(model.reduced_damping)
        self._damped = self._damping.nnz > 0
        size = self._basis.shape[1]
        system = np.eye(size) + 0.5 * step * model.reduced_damping + 0.25 * step**2 * model.reduced_stiffness
        self._factor = BandedCholesky(system)
        self.pulley = model.pulley @ self._basis
        self.response = np.ascontiguousarray(self._factor.solve(self.pulley.T))
        self.position, self.velocity, self.acceleration = (np.zeros(size) for _ in range(3))
        self._place, self._rate, self._elastic = (np.zeros(size) for _ in range(3))

    def reduce(self, force: Array) -> Array:
        """Generalised forces (n,) → (n_z,)."""
        return np.asarray(force @ self._basis)

    def elastic(self, position: Array, velocity: Array) -> Array:
        """K z + L ż."""
        force = self._stiffness @ position
        return np.asarray(force + self._damping @ velocity if self._damped else force)

    def start(self, position: Array, velocity: Array, force: Array) -> None:
        """Set z, ż and the z̈ that follows from F at the start."""
        self.position, self.velocity = position.copy(), velocity.copy()
        self.acceleration = force - self.elastic(position, velocity)

    def predict(self) -> tuple[Array, Array]:
        """Begin a step: z and ż at its end but for their share of the coming acceleration."""
        h = self.step
        self._rate = self.velocity + 0.5 * h * self.acceleration
        self._place = self.position + h * self.velocity + 0.25 * h**2 * self.acceleration
        self._elastic = self.elastic(self._place, self._rate)
        return self._place, self._rate

    def solve(self, force: Array) -> Array:
        """z̈ at the end of the step under F there."""
        return self._factor.solve(force - self._elastic)

    def ends(self, acceleration: Array) -> tuple[Array, Array]:
        """z, ż at the end of the step with that z̈."""
        h = self.step
        return self._place + 0.25 * h**2 * acceleration, self._rate + 0.5 * h * acceleration

    def finish(self, acceleration: Array) -> None:
        """End the step."""
        self.position, self.velocity = self.ends(acceleration)
        self.acceleration = acceleration
