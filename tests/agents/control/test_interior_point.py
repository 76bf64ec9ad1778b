"""The bounded least-squares problem against another program and against the unbounded closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import osqp
import pytest
from scipy import sparse

from agents.control.interior_point import BoundedTracking

N = 40
WEIGHTS = (0.03, 0.06, 1e-6)


def problem(
    seed: int, rows: int = 3, input_limit: float = 0.2, state_limit: float = 0.8, *, last: bool = False
) -> BoundedTracking:
    """Random stable dynamics whose fourth state sums the inputs, and a nominal trajectory within the limits.

    ``last``: whether the last state costs something, and the limit of the input is another in every step.
    """
    rng = np.random.default_rng(seed)
    a = np.zeros((rows, 4, 4))
    for each in a:
        frequency, period = rng.uniform(1.0, 8.0), 0.1
        s, c = np.sin(frequency * period), np.cos(frequency * period)
        each[:2, :2] = 0.99 * np.array([[c, s / frequency], [-s * frequency, c]])
        each[:2, 2:] = rng.normal(0.0, 0.1, (2, 2))
        each[2] = 0.0, 0.0, 1.0, -period
        each[3, 3] = 1.0
    b = np.repeat(a[:, None, :, 3], N, axis=1) * rng.uniform(0.5, 1.0, (rows, N, 1))
    b[:, :, 3] = 1.0
    limits = input_limit * (rng.uniform(0.5, 1.5, (rows, N)) if last else np.ones((rows, N)))
    inputs = np.clip(rng.normal(0.0, 0.5 * input_limit, (rows, N)), -limits, limits)
    root = rng.normal(0.0, 0.5, (rows, 4, 4))
    state = np.clip(np.cumsum(inputs, axis=1), -state_limit, state_limit)
    return BoundedTracking(
        a=a,
        b=b,
        middle=rng.normal(0.0, 1.0, (rows, 4)),
        middle_input=rng.normal(0.0, 0.05, (rows, N)),
        error=rng.normal(0.0, 1.0, (rows, N)),
        error_middle=rng.normal(0.0, 1.0, (rows, N)),
        weights=WEIGHTS,
        inputs=np.diff(state, axis=1, prepend=0.0),
        state=state,
        input_limit=limits,
        state_limit=np.full(rows, state_limit),
        last_state=rng.normal(0.0, 1.0, (rows, 4)) if last else None,
        cost_to_go=root @ root.transpose(0, 2, 1) if last else None,
    )


def dense(p: BoundedTracking, row: int) -> tuple[Any, Any, Any]:
    """Residuals J w + r with their weights taken in, and the fourth state's dependence on w (N, N)."""
    x = np.zeros((N + 1, 4, N))
    for k in range(N):
        x[k + 1] = p.a[row] @ x[k]
        x[k + 1, :, k] += p.b[row, k]
    end, mid, rho = np.sqrt(p.weights)
    middle = np.einsum("j,kjn->kn", p.middle[row], x[:-1]) + np.diag(p.middle_input[row])
    j = np.concatenate([end * x[1:, 0], mid * middle, rho * np.eye(N)])
    r = np.concatenate([end * p.error[row], mid * p.error_middle[row], np.zeros(N)])
    if p.last_state is not None and p.cost_to_go is not None:
        values, vectors = np.linalg.eigh(p.cost_to_go[row])
        root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        j, r = np.concatenate([j, root @ x[-1]]), np.concatenate([r, root @ p.last_state[row]])
    return j, r, x[1:, 3]


def cost(p: BoundedTracking, row: int, w: npt.NDArray[np.float64]) -> float:
    j, r, _ = dense(p, row)
    return float(np.sum((j @ w + r) ** 2))


@pytest.mark.parametrize("last", [False, True], ids=["steps alone", "last state and limits of each step"])
@pytest.mark.parametrize("seed", range(4))
def test_another_program_finds_nothing_better(seed: int, last: bool) -> None:
    p = problem(seed, last=last)
    found, iterations = p.solve()
    assert iterations.max() < 40
    for row in range(len(found)):
        j, r, speeds = dense(p, row)
        limits = sparse.csc_matrix(np.concatenate([np.eye(N), speeds]))
        nominal = np.concatenate([p.inputs[row], p.state[row]])
        bound = np.concatenate([p.input_limit[row], np.full(N, p.state_limit[row])])
        solver = osqp.OSQP()
        solver.setup(
            sparse.csc_matrix(2.0 * j.T @ j),
            2.0 * j.T @ r,
            limits,
            -bound - nominal,
            bound - nominal,
            verbose=False,
            eps_abs=1e-10,
            eps_rel=1e-10,
            max_iter=200_000,
            polishing=True,
        )
        other = solver.solve(raise_error=True).x
        assert cost(p, row, found[row]) <= cost(p, row, other) * (1.0 + 1e-6)
        assert cost(p, row, found[row]) == pytest.approx(cost(p, row, other), rel=1e-5)
        assert np.all(abs(p.inputs[row] + found[row]) <= p.input_limit[row] + 1e-8)
        assert np.all(abs(p.state[row] + speeds @ found[row]) <= p.state_limit[row] + 1e-8)
        assert np.isclose(abs(p.inputs[row] + found[row]), p.input_limit[row], atol=1e-5).sum() > 5


@pytest.mark.parametrize("last", [False, True])
def test_far_from_the_limits_it_is_least_squares(last: bool) -> None:
    p = replace(problem(7, last=last), input_limit=np.full((3, N), 1e4), state_limit=np.full(3, 1e5))
    found, _ = p.solve()
    for row in range(len(found)):
        j, r, _ = dense(p, row)
        best = np.linalg.lstsq(j, -r, rcond=None)[0]
        assert cost(p, row, found[row]) == pytest.approx(cost(p, row, best), rel=1e-6)


def test_some_rows_alone_are_solved_as_among_the_others() -> None:
    p = problem(5, rows=4, last=True)
    together, _ = p.solve()
    np.testing.assert_array_equal(p.rows(np.array([3, 1])).solve()[0], together[[3, 1]])
