"""Symmetric banded matrices: the frame's matrices are block tridiagonal, so work grows linearly with the
rfes."""

from __future__ import annotations

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dpbtrs

from aframe_env.rfem.beam import Array


def bandwidth(matrix: Array) -> int:
    """Number of diagonals above the main one that hold anything."""
    rows, columns = np.nonzero(matrix)
    return int(np.max(np.abs(rows - columns), initial=0))


class BandedCholesky:
    """Cholesky factor of a symmetric positive definite banded matrix.

    Args:
        matrix: The matrix in full, (n, n).

    Raises:
        numpy.linalg.LinAlgError: The matrix is not positive definite (a mechanism, not a structure).
    """

    def __init__(self, matrix: Array) -> None:
        width = bandwidth(matrix)
        size = matrix.shape[0]
        band = np.zeros((width + 1, size))
        for offset in range(width + 1):
            band[width - offset, offset:] = np.diagonal(matrix, offset)
        self._factor = np.asfortranarray(cholesky_banded(band))

    def solve(self, right: Array) -> Array:
        """x of A x = ``right``, (n,) or (n, k)."""
        solution, info = dpbtrs(self._factor, right)
        if info:
            raise ValueError(f"dpbtrs: info = {info}, right-hand side of shape {right.shape}")
        return np.asarray(solution, dtype=np.float64)
