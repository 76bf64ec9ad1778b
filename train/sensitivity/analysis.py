"""One-at-a-time curves and Sobol indices of the heave that a policy leaves."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue
from agents.policy import FloatArray, Knowledge, Policy
from agents.rollout import run
from train.sensitivity.factors import FACTORS, NOMINAL, Factor, altered
from train.sensitivity.misinformed import Misinformed

CHUNK = 4096  # rows that run in step


@dataclass(frozen=True)
class Curve:
    """A policy along one factor, the others as assumed."""

    factor: str
    values: tuple[float, ...]
    left: tuple[tuple[float, ...], ...]
    """[value][assumed scenario] RMS depth error over that with the drum still in the assumed scenario."""


@dataclass(frozen=True)
class Index:
    """Sobol indices of one factor: shares of the variance, with half-widths of their 95 % intervals."""

    factor: str
    first: float
    first_interval: float
    total: float
    total_interval: float


@dataclass(frozen=True)
class Sensitivity:
    """Sensitivity of one policy."""

    policy: str
    knows: str
    curves: tuple[Curve, ...]
    indices: tuple[Index, ...]
    """Indices of the mean, over the assumed scenarios, of the decimal logarithm of the heave left."""
    median: float
    """Heave left over the whole ranges of all factors together, and in every assumed scenario: median,"""
    high: float
    """95 % quantile,"""
    worst: float
    """and worst."""


def leftover(
    policy: Policy, assumed: Sequence[Scenario], still: FloatArray, config: TaskConfig, values: FloatArray
) -> FloatArray:
    """RMS depth error over ``still`` (K,) for every row of ``values`` (N, factors) and assumed scenario: (N, K).

    ``still`` is the RMS with the drum still in the K assumed scenarios [m], ``config`` the task.
    """
    pairs = [(row, k) for row in range(len(values)) for k in range(len(assumed))]
    left = np.empty(len(pairs))
    for begin in range(0, len(pairs), CHUNK):
        part = pairs[begin : begin + CHUNK]
        truth = [altered(assumed[k], values[row]) for row, k in part]
        which = np.array([k for _, k in part])
        misinformed = Misinformed(policy, assumed, which)
        seen = config.replaced(observation="state" if policy.knows is Knowledge.STATE else "sensors")
        left[begin : begin + len(part)] = run(misinformed, truth, seen).rms / still[which]
    return left.reshape(len(values), len(assumed))


def curves(evaluate: Callable[[FloatArray], FloatArray], points: int) -> tuple[Curve, ...]:
    """Vary one factor at a time over ``points`` values of its range; ``evaluate`` is (N, factors) → (N, K)."""
    grids = [np.linspace(factor.low, factor.high, points) for factor in FACTORS]
    values = np.tile(NOMINAL, (points * len(FACTORS), 1))
    for i, grid in enumerate(grids):
        values[i * points : (i + 1) * points, i] = grid
    left = evaluate(values).reshape(len(FACTORS), points, -1)
    return tuple(
        Curve(factor.name, tuple(grid.tolist()), tuple(map(tuple, each.tolist())))
        for factor, grid, each in zip(FACTORS, grids, left, strict=True)
    )


def sobol_indices(
    factors: Sequence[Factor], evaluate: Callable[[FloatArray], FloatArray], samples: int, seed: int
) -> tuple[tuple[Index, ...], FloatArray]:
    """First-order and total Sobol indices of ``evaluate`` (N, factors) → (N,), and the outputs behind them.

    ``samples`` is a power of two; ``samples`` (factors + 2) evaluations are made, all in one call.
    """
    try:
        from SALib.analyze import sobol as analysis
        from SALib.sample import sobol as sampling
    except ImportError:
        raise InvalidValue('SALib is not installed: pip install "aframe-heave[sensitivity]"') from None
    problem = {
        "num_vars": len(factors),
        "names": [factor.name for factor in factors],
        "bounds": [[factor.low, factor.high] for factor in factors],
    }
    values = sampling.sample(problem, samples, calc_second_order=False, seed=seed)
    output = np.asarray(evaluate(values), dtype=np.float64)
    if np.ptp(output) <= 1e-9 * abs(output.mean()):
        return tuple(Index(factor.name, 0.0, 0.0, 0.0, 0.0) for factor in factors), output
    # A generator, since SALib takes the seed 0 for none.
    rng = np.random.default_rng(seed)
    found = analysis.analyze(problem, output, calc_second_order=False, num_resamples=400, seed=rng)
    columns = [np.asarray(found[key], dtype=np.float64).tolist() for key in ("S1", "S1_conf", "ST", "ST_conf")]
    return tuple(Index(factor.name, *row) for factor, *row in zip(factors, *columns, strict=True)), output


def analyse(
    policy: Policy,
    assumed: Sequence[Scenario],
    still: FloatArray,
    config: TaskConfig,
    points: int,
    samples: int,
    seed: int,
) -> Sensitivity:
    """Analyse one policy."""

    joint = np.empty((0, len(assumed)))

    def evaluate(values: FloatArray) -> FloatArray:
        return leftover(policy, assumed, still, config, values)

    def order(values: FloatArray) -> FloatArray:
        nonlocal joint
        joint = evaluate(values)
        # A rope that is thrown about, or parts, leaves a hundred times the heave: one such row would be all variance.
        return np.asarray(np.log10(joint).mean(axis=1))

    indices, _ = sobol_indices(FACTORS, order, samples, seed)
    median, high = np.quantile(joint, [0.5, 0.95]).tolist()
    return Sensitivity(
        policy.name, policy.knows.value, curves(evaluate, points), indices, median, high, float(joint.max())
    )
