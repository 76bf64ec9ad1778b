"""The whole picture: side view, magnified load, instruments and chart, of one scene."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
import pygame

from aframe_env.rendering import palette
from aframe_env.rendering.canvas import Box, Canvas
from aframe_env.rendering.chart import draw_chart
from aframe_env.rendering.instruments import draw_instruments
from aframe_env.rendering.load import draw_magnified
from aframe_env.rendering.scene import Scene
from aframe_env.rendering.side_view import draw_side_view, scale_of

FloatArray = npt.NDArray[np.float64]

SIZE: Final = (960, 640)
"""Width and height of a picture, pixels."""
_SIDE_VIEW: Final[Box] = (12.0, 12.0, 602.0, 440.0)
_INSTRUMENTS: Final[Box] = (624.0, 12.0, 324.0, 160.0)
_MAGNIFIED: Final[Box] = (624.0, 182.0, 324.0, 270.0)
_CHART: Final[Box] = (12.0, 462.0, 936.0, 166.0)


class Painter:
    """Draws scenes, each with the history before it.

    A history has lines of time [s] and the chart's two curves [m], the depth error first. Beside ``still``, the scene
    with the drum still, the second curve is the depth error there.
    """

    def __init__(
        self,
        size: tuple[int, int] = SIZE,
        legend: tuple[str, str] = ("Depth error of the load", "Heave of the pulley"),
    ) -> None:
        """Make pictures ``size`` pixels wide and high; ``legend`` names the chart's curves."""
        self._size, self._legend = size, legend
        self._canvas = Canvas(*SIZE)

    def paint(self, scene: Scene, history: FloatArray, still: Scene | None = None) -> pygame.Surface:
        """Draw the picture."""
        canvas = self._canvas
        canvas.box((0.0, 0.0, *SIZE), palette.PAGE)
        x, y = draw_side_view(canvas, _SIDE_VIEW, scene, still)
        canvas.round_off(_SIDE_VIEW, palette.PAGE, 8.0)
        left, bottom = _MAGNIFIED[0], _MAGNIFIED[1] + _MAGNIFIED[3]
        into = min(max(y - 34.0, _MAGNIFIED[1] + 40.0), bottom - 74.0)
        lens = [(x + 18.0, y - 9.0), (left, into), (left, into + 68.0), (x + 18.0, y + 9.0)]
        canvas.polygon(lens, palette.FAR_WATER, opacity=0.45)
        draw_magnified(canvas, _MAGNIFIED, scale_of(scene), scene, history, still)
        draw_instruments(canvas, _INSTRUMENTS, scene)
        draw_chart(canvas, _CHART, scene.time, history, self._legend)
        return canvas.picture(self._size)

    def pixels(self, scene: Scene, history: FloatArray, still: Scene | None = None) -> npt.NDArray[np.uint8]:
        """Draw the picture; return it as an array (height, width, 3)."""
        picture = self.paint(scene, history, still)
        data = np.frombuffer(pygame.image.tobytes(picture, "RGB"), dtype=np.uint8)
        return data.reshape(picture.get_height(), picture.get_width(), 3).copy()
