"""Views: from metres to pixels of the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Pixel = tuple[float, float]


@dataclass(frozen=True)
class View:
    """An oblique view along +y: x to the right, z up, what lies farther away a little to the right and up."""

    origin: Pixel
    """Pixel at which (0, 0, 0) is seen; pixels count to the right and downwards."""
    scale: float
    """Pixels per metre."""
    recession: tuple[float, float] = (0.0, 0.0)
    """Metres to the right and up that one metre of y is seen as."""

    def pixels(self, points: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of points (..., 3) in m."""
        p = np.asarray(points, dtype=np.float64)
        right = p[..., 0] + self.recession[0] * p[..., 1]
        up = p[..., 2] + self.recession[1] * p[..., 1]
        return np.stack([self.origin[0] + self.scale * right, self.origin[1] - self.scale * up], axis=-1)

    def metres(self, pixels: npt.ArrayLike, y: float = 0.0) -> FloatArray:
        """Points (..., 3) in m of the plane at ``y`` [m] that are seen at pixels (..., 2)."""
        p = np.asarray(pixels, dtype=np.float64)
        x = (p[..., 0] - self.origin[0]) / self.scale - self.recession[0] * y
        z = (self.origin[1] - p[..., 1]) / self.scale - self.recession[1] * y
        return np.stack([x, np.full_like(x, y), z], axis=-1)


def round_limit(value: float) -> float:
    """Smallest of 0.06, 0.1, 0.2, 0.3, 0.4, 0.6, 1, 2, 3, 4, 6, ... that is not below ``value``."""
    decade = 0.01
    while True:
        for factor in (1.0, 2.0, 3.0, 4.0, 6.0):
            limit = factor * decade
            if limit >= max(value, 0.06) * (1.0 - 1e-9):
                return limit
        decade *= 10.0
