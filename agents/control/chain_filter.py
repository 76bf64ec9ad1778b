"""``RopeFilter`` for a load on a rope with mass, in water: it reckons with waves in the rope and with drag."""

from __future__ import annotations

import numpy as np

from agents.control.chain import STATE, Chains
from agents.control.filters import ALL, FloatArray, Rows
from agents.control.rope_filter import ACCELERATION_NOISE

BIAS = STATE
"""Place of the bias of a reading of the stretch."""


class ChainFilter:
    """Extended Kalman filter of N rows: the state of ``Chains`` and the bias of a reading of the stretch.

    As in ``RopeFilter`` depth error and rope's end are dead-reckoned and drift; only their difference is of use.
    """

    def __init__(self, rows: int, rate_noise: float) -> None:
        """``rate_noise``: standard deviation of a reading of the heave rate, m/s."""
        self._rate_noise = rate_noise
        self.chains = Chains(np.zeros((rows, STATE, STATE + 1)), *np.zeros((2, rows, STATE)))
        self._read, self.state = np.zeros((2, rows, STATE))
        self._process_noise, self._covariance = np.zeros((2, rows, STATE + 1, STATE + 1))
        self._noise, self._bias = np.ones((2, rows))

    def start(self, chains: Chains, period: float, softness: FloatArray, noise: FloatArray, rows: Rows = ALL) -> None:
        """Begin in these rows with loads at rest.

        ``softness`` (n,) m/N: what a reading of the tension is read for; ``noise`` (n,) m of the stretch that it tells.
        """
        self._tune(chains, period, softness, noise, rows)
        covariance = np.zeros((len(noise), STATE + 1, STATE + 1))
        covariance[:, range(3), range(3)], covariance[:, BIAS, BIAS] = 1e-4, noise**2
        self._covariance[rows] = covariance
        self.state[rows], self._bias[rows] = 0.0, 0.0

    def retune(
        self, chains: Chains, period: float, softness: FloatArray, noise: FloatArray, longer: FloatArray
    ) -> None:
        """Go on with other ropes, ``longer`` (N,) by that factor."""
        self._tune(chains, period, softness, noise, ALL)
        self._bias *= longer
        self._covariance[:, BIAS, :] *= longer[:, None]
        self._covariance[:, :, BIAS] *= longer[:, None]

    def _tune(self, chains: Chains, period: float, softness: FloatArray, noise: FloatArray, rows: Rows) -> None:
        self.chains.replace(rows, chains)
        self._read[rows] = softness[:, None] * chains.pull
        b = chains.transition[:, :, -1]
        stirred = np.zeros((len(noise), STATE + 1, STATE + 1))
        stirred[:, :BIAS, :BIAS] = self._rate_noise**2 * b[:, :, None] * b[:, None, :]
        stirred[:, 1, 1] += (ACCELERATION_NOISE * period) ** 2
        self._process_noise[rows], self._noise[rows] = stirred, noise**2

    def advance(self, speed: FloatArray, stretch: FloatArray) -> None:
        """Take the mean speed (N,) m/s of the rope's end over a control step, and the stretch (N,) m at its end."""
        chains, state = self.chains, self.state
        a = np.zeros_like(self._covariance)
        a[:, :BIAS, :BIAS], a[:, BIAS, BIAS] = chains.transition[:, :, :-1], 1.0
        a[:, :BIAS, 1] += 2.0 * abs(state[:, 1:2]) * chains.drag
        foretold = chains.advance(state, speed)
        p = a @ self._covariance @ a.transpose(0, 2, 1) + self._process_noise
        row = np.column_stack([self._read, np.ones(len(speed))])
        cross = (p @ row[:, :, None])[:, :, 0]
        gain = cross / ((row * cross).sum(axis=1) + self._noise)[:, None]
        missed = stretch - (self._read * foretold).sum(axis=1) - self._bias
        self.state = foretold + gain[:, :BIAS] * missed[:, None]
        self._bias = self._bias + gain[:, BIAS] * missed
        self._covariance = p - gain[:, :, None] * cross[:, None, :]

    @property
    def stretch(self) -> FloatArray:
        """How far the load hangs below where it would at rest on its rope's end, (N,) m."""
        return np.asarray(self.state[:, 2] - self.state[:, 0])

    @property
    def load_velocity(self) -> FloatArray:
        """Vertical velocity of the load, (N,) m/s."""
        return np.asarray(self.state[:, 1])

    def carried(self, depth_error: FloatArray, speeds: FloatArray) -> FloatArray:
        """Depth error, its rate and the rope's end (N, 3) later, at these mean ``speeds`` (k, N) m/s in k steps.

        ``depth_error`` (N,) m: what it is now.
        """
        state = self.state.copy()
        state[:, (0, 2)] += (depth_error - state[:, 0])[:, None]
        for speed in speeds:
            state = self.chains.advance(state, speed)
        return state[:, :3]
