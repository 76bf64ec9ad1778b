"""Random numbers addressed by (seed, index), for compiled code: no state to carry, the same in every batch."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from aframe_env.dynamics.compiling import kernel, scalar


@scalar
def uniform(seed: Any, index: Any) -> float:
    """Uniform number in [0, 1) (splitmix64, Steele et al. 2014)."""
    z = np.uint64(seed) + np.uint64(0x9E3779B97F4A7C15) * (np.uint64(index) + np.uint64(1))
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) / 9007199254740992.0


@scalar
def draw_seed(seed: int, index: int) -> int:
    """Seed for further draws, in [0, 2^53)."""
    return int(uniform(seed, index) * 9007199254740992.0)


@kernel
def episode_uniforms(seed: int, row: int, episode: int, numbers: Any) -> None:
    """Fill ``numbers`` (n,) with uniform numbers of a row's ``episode``, the same whatever the other rows draw."""
    own, size = draw_seed(seed, row), numbers.shape[0]
    for k in range(size):
        numbers[k] = uniform(own, size * episode + k)


@scalar
def normal(seed: Any, index: Any) -> float:
    """Standard normal number (Box-Muller)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(seed, 2 * index)))
    return radius * math.cos(2.0 * math.pi * uniform(seed, 2 * index + 1))
