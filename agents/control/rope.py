"""Linear sampled model of the load on its elastic rope, for the design of the feedback laws.

The state is z = (e, e', q, p): depth error e, its rate, q, where the load would come to rest if the upper end of the
rope stayed as it is, and p = q'. The pulley raises q and the drum, paying out, lowers it: p = s' - r φ'. The load
follows by e'' = ω² (q - e) + 2 ζ ω (p - e'). The input is the change of p, which the winch's acceleration limits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from agents.control.filters import FloatArray, Rows


@dataclass(frozen=True)
class RopeModel:
    """z(t + T) = A z(t) + B c of N rows, where c [m/s] is the change of p at the start of a control step T."""

    a: FloatArray
    """(N, 4, 4)."""
    b: FloatArray
    """(N, 4)."""

    @classmethod
    def of(
        cls,
        frequency: FloatArray,
        damping_ratio: float | FloatArray,
        period: float,
        drag: float | FloatArray = 0.0,
    ) -> RopeModel:
        """Model of loads that bob on their ropes at ``frequency`` (N,) rad/s, sampled every ``period`` s.

        ``damping_ratio``: share of critical; ``drag``: rate 1/s at which water slows the loads down. Both one for all
        or (N,).
        """
        rate = np.zeros((len(frequency), 4, 4))
        rate[:, 0, 1] = 1.0
        rate[:, 1, 0] = -(frequency**2)
        rate[:, 1, 1] = -2.0 * damping_ratio * frequency - drag
        rate[:, 1, 2] = frequency**2
        rate[:, 1, 3] = 2.0 * damping_ratio * frequency
        rate[:, 2, 3] = 1.0
        a = expm(rate * period)
        # A change of p at the start of the step is as good as a p that was there before it.
        return cls(a, a[:, :, 3].copy())

    def some(self, rows: Rows) -> RopeModel:
        """Model of these rows alone."""
        return RopeModel(self.a[rows], self.b[rows])

    def replace(self, rows: Rows, other: RopeModel) -> None:
        """Put the rows of another model in the place of these."""
        self.a[rows], self.b[rows] = other.a, other.b

    def advance(self, z: FloatArray, change: FloatArray) -> FloatArray:
        """State (N, 4) a control step after ``z`` (N, 4), p having changed by ``change`` (N,) m/s."""
        return np.asarray((self.a @ z[:, :, None])[:, :, 0] + self.b * change[:, None])

    def costs_to_go(self, effort: FloatArray) -> FloatArray:
        """P (N, 4, 4) of the cost to go zᵀ P z: least Σ e² + effort c² over an infinite horizon; efforts (N,) in s²."""
        weight = np.diag([1.0, 0.0, 0.0, 0.0])
        return np.stack(
            [
                solve_discrete_are(a, b[:, None], weight, np.array([[each]]))
                for a, b, each in zip(self.a, self.b, effort, strict=True)
            ]
        )

    def gains(self, effort: FloatArray) -> FloatArray:
        """K (N, 4) of the feedback c = -K z with the least Σ e² + effort c² (linear-quadratic regulator)."""
        return self.gains_for(self.costs_to_go(effort), effort)

    def gains_for(self, cost_to_go: FloatArray, effort: FloatArray) -> FloatArray:
        """The same, from the ``costs_to_go`` (N, 4, 4) of these efforts."""
        pb = (cost_to_go @ self.b[:, :, None])[:, :, 0]
        k = (pb[:, None, :] @ self.a)[:, 0, :]
        return np.asarray(k / (effort + (pb * self.b).sum(axis=1))[:, None])
