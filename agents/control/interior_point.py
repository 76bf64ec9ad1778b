"""Linear least squares over a horizon with limits on an input and a state: an interior point on the Riccati recursion.

For a trajectory of n control steps, find the changes w_k of its inputs that make

    Σ c_end (e_k+1 + x_k+1[0])² + c_mid (m_k + middle · x_k + β_k w_k)² + ρ w_k²  +  (x̄ + x_n)ᵀ P (x̄ + x_n)

least, where x_k+1 = A x_k + b_k w_k, x_0 = 0, with |u_k + w_k| ≤ U_k and |v_k + x_k+1[3]| ≤ V: e and m are the nominal
errors at the ends and in the middles of the steps, u the nominal inputs, v the nominal values of the limited state, x̄
the nominal last state, and ρ keeps the change short. Mehrotra's predictor and corrector (SIAM J. Optim. 2, 1992); the
normal equations are banded, and a backward and a forward pass solve them (Rao, Wright and Rawlings, J. Optim. Theory
Appl. 99, 1998): the time grows with n only. All problems of a batch are solved side by side over the cores.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from numba import prange

from aframe_env.dynamics.compiling import parallel_kernel, scalar

FloatArray = npt.NDArray[np.float64]

STATES: Final = 4
LIMITS: Final = 4
"""Slacks of a step: input above its least and below its greatest value, state likewise."""
MAX_ITERATIONS: Final = 60
TOLERANCE: Final = 1e-8
"""Complementarity gap at which a problem is solved, as a share of its nominal cost."""
TO_BOUNDARY: Final = 0.995
"""Share of the way to the nearest limit that a step goes at most."""


@dataclass(frozen=True, kw_only=True)
class BoundedTracking:
    """N problems of n steps."""

    a: FloatArray
    """(N, 4, 4) A."""
    b: FloatArray
    """(N, n, 4)."""
    middle: FloatArray
    """(N, 4): the error in the middle of a step, of the state at its start."""
    middle_input: FloatArray
    """(N, n) β: and of the input."""
    error: FloatArray
    """(N, n) e."""
    error_middle: FloatArray
    """(N, n) m."""
    weights: tuple[float, float, float]
    """c_end, c_mid, ρ."""
    inputs: FloatArray
    """(N, n) u."""
    state: FloatArray
    """(N, n) v."""
    input_limit: FloatArray
    """(N, n) U."""
    state_limit: FloatArray
    """(N,) V."""
    last_state: FloatArray | None = None
    """(N, 4) x̄; None where the last state costs nothing."""
    cost_to_go: FloatArray | None = None
    """(N, 4, 4) P."""

    def rows(self, which: npt.NDArray[np.int64]) -> BoundedTracking:
        """The problems of some rows."""
        arrays = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "weights"}
        chosen: dict[str, Any] = {k: None if v is None else v[which] for k, v in arrays.items()}
        return replace(self, **chosen)

    def solve(self) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Changes w (N, n) of the inputs, and how many iterations each problem took."""
        change = np.zeros_like(self.inputs)
        iterations = np.zeros(len(change), dtype=np.int64)
        count = len(change)
        last_state = np.zeros((count, STATES)) if self.last_state is None else self.last_state
        cost_to_go = np.zeros((count, STATES, STATES)) if self.cost_to_go is None else self.cost_to_go
        _kernel()(
            self.a,
            self.b,
            self.middle,
            self.middle_input,
            self.error,
            self.error_middle,
            np.array(self.weights),
            self.inputs,
            self.state,
            self.input_limit,
            self.state_limit,
            last_state,
            cost_to_go,
            change,
            iterations,
        )
        return change, iterations


@scalar
def _factorise(
    a: Any, b: Any, middle: Any, beta: Any, weights: Any, cost_to_go: Any, barrier: Any, gain: Any, inverse: Any
) -> None:
    """Backward pass: feedback gains (n, 4) and inverses of the inputs' curvatures (n,) with the barrier's (n, 2)."""
    end, mid, rho = weights[0], weights[1], weights[2]
    p, closed, pc = np.zeros((STATES, STATES)), np.zeros((STATES, STATES)), np.zeros((STATES, STATES))
    pb, seen = np.zeros(STATES), np.zeros(STATES)
    for i in range(STATES):
        for j in range(STATES):
            p[i, j] = 2.0 * cost_to_go[i, j]
    for k in range(b.shape[0] - 1, -1, -1):
        p[0, 0] += 2.0 * end
        p[3, 3] += barrier[k, 1]
        own = 2.0 * rho + barrier[k, 0]
        curvature = own + 2.0 * mid * beta[k] * beta[k]
        for i in range(STATES):
            pb[i] = 0.0
            for j in range(STATES):
                pb[i] += p[i, j] * b[k, j]
            curvature += b[k, i] * pb[i]
        inverse[k] = 1.0 / curvature
        for j in range(STATES):
            gain[k, j] = 2.0 * mid * beta[k] * middle[j]
            for i in range(STATES):
                gain[k, j] += pb[i] * a[i, j]
            gain[k, j] *= inverse[k]
        # Joseph's form: a sum of squares, where the shorter one would lose its digits in a difference.
        for i in range(STATES):
            seen[i] = middle[i] - beta[k] * gain[k, i]
            for j in range(STATES):
                closed[i, j] = a[i, j] - b[k, i] * gain[k, j]
        for i in range(STATES):
            for j in range(STATES):
                pc[i, j] = 0.0
                for m in range(STATES):
                    pc[i, j] += p[i, m] * closed[m, j]
        for i in range(STATES):
            for j in range(i, STATES):
                p[i, j] = 2.0 * mid * seen[i] * seen[j] + own * gain[k, i] * gain[k, j]
                for m in range(STATES):
                    p[i, j] += closed[m, i] * pc[m, j]
            for j in range(i):
                p[i, j] = p[j, i]


@scalar
def _newton_step(
    a: Any,
    b: Any,
    middle: Any,
    beta: Any,
    error: Any,
    error_middle: Any,
    weights: Any,
    last_state: Any,
    cost_to_go: Any,
    x: Any,
    w: Any,
    push: Any,
    gain: Any,
    inverse: Any,
    feed: Any,
    dx: Any,
    dw: Any,
) -> None:
    """Backward pass for the gradient, forward pass for the step: dx (n + 1, 4) and dw (n,).

    ``push`` (n, 2): gradient of the barrier for input and state.
    """
    end, mid, rho = weights[0], weights[1], weights[2]
    costate, before = np.zeros(STATES), np.zeros(STATES)
    for i in range(STATES):
        for j in range(STATES):
            costate[i] += 2.0 * cost_to_go[i, j] * (last_state[j] + x[b.shape[0], j])
    for k in range(b.shape[0] - 1, -1, -1):
        costate[0] += 2.0 * end * (error[k] + x[k + 1, 0])
        costate[3] += push[k, 1]
        inner = error_middle[k] + beta[k] * w[k]
        for j in range(STATES):
            inner += middle[j] * x[k, j]
        slope = 2.0 * mid * inner
        h = push[k, 0] + 2.0 * rho * w[k] + slope * beta[k]
        for i in range(STATES):
            h += b[k, i] * costate[i]
        feed[k] = h * inverse[k]
        for j in range(STATES):
            before[j] = slope * middle[j] - gain[k, j] * h
            for i in range(STATES):
                before[j] += a[i, j] * costate[i]
        for j in range(STATES):
            costate[j] = before[j]
    for k in range(b.shape[0]):
        dw[k] = -feed[k]
        for j in range(STATES):
            dw[k] -= gain[k, j] * dx[k, j]
        for i in range(STATES):
            dx[k + 1, i] = b[k, i] * dw[k]
            for j in range(STATES):
                dx[k + 1, i] += a[i, j] * dx[k, j]


@scalar
def _solve(
    a: Any,
    b: Any,
    middle: Any,
    beta: Any,
    error: Any,
    error_middle: Any,
    weights: Any,
    u: Any,
    v: Any,
    u_limit: Any,
    v_limit: float,
    last_state: Any,
    cost_to_go: Any,
    w: Any,
) -> int:
    """Solve one problem into ``w`` (n,); return the number of iterations."""
    n = b.shape[0]
    x, dx = np.zeros((n + 1, STATES)), np.zeros((n + 1, STATES))
    dw, feed, inverse, gain = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((n, STATES))
    slack, dual = np.zeros((n, LIMITS)), np.zeros((n, LIMITS))
    dslack, ddual = np.zeros((n, LIMITS)), np.zeros((n, LIMITS))
    residual, corrector = np.zeros((n, LIMITS)), np.zeros((n, LIMITS))
    barrier, push = np.zeros((n, 2)), np.zeros((n, 2))
    cost = 0.0
    for k in range(n):
        cost += weights[0] * error[k] * error[k] + weights[1] * error_middle[k] * error_middle[k]
    for i in range(STATES):
        for j in range(STATES):
            cost += last_state[i] * cost_to_go[i, j] * last_state[j]
    start = 0.1 * max(cost / n, 1e-12)
    for k in range(n):
        slack[k, 0] = max(u[k] + u_limit[k], 0.1 * u_limit[k])
        slack[k, 1] = max(u_limit[k] - u[k], 0.1 * u_limit[k])
        slack[k, 2] = max(v[k] + v_limit, 0.04 * v_limit)
        slack[k, 3] = max(v_limit - v[k], 0.04 * v_limit)
        for i in range(LIMITS):
            dual[k, i] = start / slack[k, i]
    # A step of size s leaves 1 - s of what the gradient lacked of being balanced by the limits.
    unbalanced = 1.0
    for iteration in range(MAX_ITERATIONS):
        gap, worst = 0.0, 0.0
        for k in range(n):
            residual[k, 0] = u[k] + w[k] + u_limit[k] - slack[k, 0]
            residual[k, 1] = u_limit[k] - u[k] - w[k] - slack[k, 1]
            residual[k, 2] = v[k] + x[k + 1, 3] + v_limit - slack[k, 2]
            residual[k, 3] = v_limit - v[k] - x[k + 1, 3] - slack[k, 3]
            for i in range(LIMITS):
                gap += dual[k, i] * slack[k, i]
                worst = max(worst, abs(residual[k, i]))
            barrier[k, 0] = dual[k, 0] / slack[k, 0] + dual[k, 1] / slack[k, 1]
            barrier[k, 1] = dual[k, 2] / slack[k, 2] + dual[k, 3] / slack[k, 3]
        if gap < TOLERANCE * cost + 1e-14 and worst < 1e-9 and unbalanced < TOLERANCE:
            return iteration
        _factorise(a, b, middle, beta, weights, cost_to_go, barrier, gain, inverse)
        target = 0.0
        for phase in range(2):
            for k in range(n):
                for i in range(LIMITS):
                    corrector[k, i] = target - dslack[k, i] * ddual[k, i] if phase == 1 else 0.0
                push[k, 0] = (dual[k, 0] * residual[k, 0] - corrector[k, 0]) / slack[k, 0]
                push[k, 0] -= (dual[k, 1] * residual[k, 1] - corrector[k, 1]) / slack[k, 1]
                push[k, 1] = (dual[k, 2] * residual[k, 2] - corrector[k, 2]) / slack[k, 2]
                push[k, 1] -= (dual[k, 3] * residual[k, 3] - corrector[k, 3]) / slack[k, 3]
            _newton_step(
                a,
                b,
                middle,
                beta,
                error,
                error_middle,
                weights,
                last_state,
                cost_to_go,
                x,
                w,
                push,
                gain,
                inverse,
                feed,
                dx,
                dw,
            )
            primal, adjoint = 1.0, 1.0
            for k in range(n):
                dslack[k, 0] = dw[k] + residual[k, 0]
                dslack[k, 1] = -dw[k] + residual[k, 1]
                dslack[k, 2] = dx[k + 1, 3] + residual[k, 2]
                dslack[k, 3] = -dx[k + 1, 3] + residual[k, 3]
                for i in range(LIMITS):
                    ddual[k, i] = (corrector[k, i] - dual[k, i] * dslack[k, i]) / slack[k, i] - dual[k, i]
                    if dslack[k, i] < 0.0:
                        primal = min(primal, -slack[k, i] / dslack[k, i])
                    if ddual[k, i] < 0.0:
                        adjoint = min(adjoint, -dual[k, i] / ddual[k, i])
            if phase == 0:
                after = 0.0
                for k in range(n):
                    for i in range(LIMITS):
                        after += (slack[k, i] + primal * dslack[k, i]) * (dual[k, i] + adjoint * ddual[k, i])
                target = (after / gap) ** 3 * gap / (LIMITS * n)
        size = min(1.0, TO_BOUNDARY * min(primal, adjoint))
        unbalanced *= 1.0 - size
        for k in range(n):
            w[k] += size * dw[k]
            for j in range(STATES):
                x[k + 1, j] += size * dx[k + 1, j]
            for i in range(LIMITS):
                slack[k, i] += size * dslack[k, i]
                dual[k, i] += size * ddual[k, i]
    return MAX_ITERATIONS


@cache
def _kernel() -> Callable[..., None]:
    @parallel_kernel
    def solve(  # type: ignore[no-untyped-def]
        a,
        b,
        middle,
        beta,
        error,
        error_middle,
        weights,
        u,
        v,
        u_limit,
        v_limit,
        last_state,
        cost_to_go,
        change,
        iterations,
    ):
        for i in prange(b.shape[0]):
            iterations[i] = _solve(
                a[i],
                b[i],
                middle[i],
                beta[i],
                error[i],
                error_middle[i],
                weights,
                u[i],
                v[i],
                u_limit[i],
                v_limit[i],
                last_state[i],
                cost_to_go[i],
                change[i],
            )

    return solve
