"""Random numbers addressed by seed and index: their distribution, and their independence across both."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy.stats import kstest

from aframe_env.dynamics.random import normal, uniform


def numbers(seed: int, count: int = 20_000) -> npt.NDArray[np.float64]:
    """Uniform and normal numbers (count, 2)."""
    return np.array([(uniform(seed, i), normal(seed, i)) for i in range(count)])


def test_numbers_have_their_distributions() -> None:
    for seed in (0, 1, 2**62):
        values = numbers(seed)
        assert kstest(values[:, 0], "uniform").pvalue > 1e-4
        assert kstest(values[:, 1], "norm").pvalue > 1e-4
        assert (values[:, 0] >= 0.0).all()
        assert (values[:, 0] < 1.0).all()


def test_successive_numbers_and_seeds_are_independent() -> None:
    bound = 4.0 / math.sqrt(20_000)
    one, other = numbers(1), numbers(2)
    for lag in (1, 2, 3):
        assert abs(np.corrcoef(one[lag:, 0], one[:-lag, 0])[0, 1]) < bound
        assert abs(np.corrcoef(one[lag:, 1], one[:-lag, 1])[0, 1]) < bound
    assert abs(np.corrcoef(one[:, 0], other[:, 0])[0, 1]) < bound


def test_splitmix64_reference_numbers() -> None:
    """The published generator's first outputs from state 0 (Steele, Lea, Flood 2014)."""
    known = [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]
    np.testing.assert_array_equal(numbers(0, 3)[:, 0], [(value >> 11) / 2.0**53 for value in known])
