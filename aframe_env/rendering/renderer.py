"""The renderer: pictures of a simulation's rows, as arrays or in a window."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
import pygame

from aframe_env.rendering import palette
from aframe_env.rendering.canvas import Box, Canvas
from aframe_env.rendering.chart import draw_chart
from aframe_env.rendering.history import History
from aframe_env.rendering.instruments import draw_instruments
from aframe_env.rendering.load import draw_magnified
from aframe_env.rendering.scene import scene_of
from aframe_env.rendering.side_view import draw_side_view, scale_of
from aframe_env.simulation import Simulation

SIZE: Final = (960, 640)
"""Width and height of a picture, pixels."""
_SIDE_VIEW: Final[Box] = (12.0, 12.0, 602.0, 440.0)
_INSTRUMENTS: Final[Box] = (624.0, 12.0, 324.0, 160.0)
_MAGNIFIED: Final[Box] = (624.0, 182.0, 324.0, 270.0)
_CHART: Final[Box] = (12.0, 462.0, 936.0, 166.0)


class Renderer:
    """Draws rows of one simulation and keeps the recent history that the pictures show."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._history = History(simulation.control_period)
        self._canvas = Canvas(*SIZE)
        self._window: pygame.Surface | None = None
        self._clock = pygame.time.Clock()
        self.record()

    def record(self) -> None:
        """Add the present to the history: to be called after every reset and step."""
        self._history.record(self._simulation)

    def frame(self, row: int = 0) -> npt.NDArray[np.uint8]:
        """Picture of a row, (height, width, 3)."""
        pixels = pygame.image.tobytes(self._draw(row), "RGB")
        return np.frombuffer(pixels, dtype=np.uint8).reshape(SIZE[1], SIZE[0], 3).copy()

    def show(self, frames_per_second: float, row: int = 0) -> None:
        """Show a row in the window, which opens at the first call, no sooner than the last one's time is over."""
        picture = self._draw(row)
        if self._window is None:
            pygame.display.init()
            self._window = pygame.display.set_mode(SIZE)
            pygame.display.set_caption("AFrameHeave-v0")
        self._window.blit(picture, (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(frames_per_second)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            pygame.display.quit()
            self._window = None

    def _draw(self, row: int) -> pygame.Surface:
        scene, history, canvas = scene_of(self._simulation, row), self._history.of(row), self._canvas
        canvas.box((0.0, 0.0, *SIZE), palette.PAGE)
        x, y = draw_side_view(canvas, _SIDE_VIEW, scene)
        canvas.round_off(_SIDE_VIEW, palette.PAGE, 8.0)
        left, bottom = _MAGNIFIED[0], _MAGNIFIED[1] + _MAGNIFIED[3]
        lens = [(x + 18.0, y - 9.0), (left, bottom - 74.0), (left, bottom - 6.0), (x + 18.0, y + 9.0)]
        canvas.polygon(lens, palette.FAR_WATER, opacity=0.45)
        draw_magnified(canvas, _MAGNIFIED, scale_of(scene), scene, history)
        draw_instruments(canvas, _INSTRUMENTS, scene)
        draw_chart(canvas, _CHART, scene.time, history)
        return canvas.picture()
