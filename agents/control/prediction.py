"""Short-term prediction of the pulley's heave rate: a Kalman filter on a bank of oscillators.

The motion of a ship in waves is a sum of slowly changing harmonics. The bank holds one lightly damped oscillator for
each band of the waves' frequencies; the filter follows their amplitudes and phases, and lets them run on. After
Küchler, Mahl, Neupert, Schneider, Sawodny, Active control for an offshore crane using prediction of the vessel's motion
(IEEE/ASME Transactions on Mechatronics, 2011), with fixed bands in place of modes that are identified on line.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, solve_discrete_are

from agents.estimation import Estimate, FloatArray, Rows


@dataclass(frozen=True, kw_only=True)
class Bank:
    """The oscillators, and what the filter counts on."""

    lowest: float = 0.3
    """rad/s."""
    highest: float = 1.6
    """rad/s."""
    bands: int = 40
    damping: float = 0.002
    """Rate at which an oscillator forgets, 1/s; its inverse bounds how far the filter looks back."""
    variance: float = 0.25
    """Of the heave rate, spread evenly over the bands, m²/s²."""
    noise: float = 0.015
    """Standard deviation of a reading of the heave rate, m/s."""


class BankPredictor:
    """Foretells the pulley's motion of N rows from a bank of oscillators."""

    def __init__(self, rows: int, control_period: float, bank: Bank | None = None) -> None:
        bank = bank or Bank()
        frequency = np.linspace(bank.lowest, bank.highest, bank.bands)
        damping = bank.damping
        self._exponent = -damping + 1j * frequency
        self._turn = np.exp(self._exponent * control_period)
        a = block_diag(*(np.array([[t.real, -t.imag], [t.imag, t.real]]) for t in self._turn))
        stir = bank.variance / bank.bands * (1.0 - np.exp(-2.0 * damping * control_period))
        c = np.tile([1.0, 0.0], bank.bands)[:, None]
        p = solve_discrete_are(a.T, c, stir * np.eye(len(a)), np.array([[bank.noise**2]]))
        gain = (p @ c)[:, 0] / ((c.T @ p @ c)[0, 0] + bank.noise**2)
        self._gain = gain[::2] + 1j * gain[1::2]
        self._state = np.zeros((rows, bank.bands), dtype=np.complex128)
        """The heave rate is the sum of the real parts, m/s."""

    def start(self, heave_rate: FloatArray, estimate: Estimate, rows: Rows) -> None:
        """Begin in these rows with a first reading (n,) m/s: the ship has been at rest."""
        self._state[rows] = heave_rate[:, None] * self._gain

    def advance(self, heave_rate: FloatArray, estimate: Estimate) -> None:
        """Take a reading (N,) m/s of the heave rate, a control step later."""
        self._state = self._state * self._turn
        miss = heave_rate - self._state.real.sum(axis=1)
        self._state = self._state + miss[:, None] * self._gain

    def rate(self, times: FloatArray) -> FloatArray:
        """Velocity (T, N) m/s of the pulley, ``times`` (T,) s after the moment that the reading speaks of."""
        return self._sum(np.exp(np.outer(times, self._exponent)))

    def path(self, times: FloatArray) -> FloatArray:
        """Rise (T, N) m of the pulley since that moment."""
        return self._sum(np.expm1(np.outer(times, self._exponent)) / self._exponent)

    def _sum(self, factors: np.ndarray[tuple[int, ...], np.dtype[np.complex128]]) -> FloatArray:
        # Row by row in the same order, whatever the batch: a sum, not a matrix product.
        return np.asarray((factors[:, None, :] * self._state[None]).real.sum(axis=2))
