"""The renderer: pictures of a simulation's rows, as arrays or in a window."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pygame

from aframe_env.rendering.history import History
from aframe_env.rendering.painter import SIZE, FloatArray, Painter
from aframe_env.rendering.scene import Scene, scene_of
from aframe_env.simulation import Simulation


class Renderer:
    """Draws rows of one simulation and keeps the recent history that the pictures show."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._history = History(simulation.control_period)
        self._painter = Painter()
        self._window: pygame.Surface | None = None
        self._clock = pygame.time.Clock()
        self.record()

    def record(self) -> None:
        """Add the present to the history: to be called after every reset and step."""
        self._history.record(self._simulation)

    def frame(self, row: int = 0) -> npt.NDArray[np.uint8]:
        """Picture of a row, (height, width, 3)."""
        return self._painter.pixels(*self._scene(row))

    def show(self, frames_per_second: float, row: int = 0) -> None:
        """Show a row in the window, which opens at the first call, no sooner than the last one's time is over."""
        picture = self._painter.paint(*self._scene(row))
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

    def _scene(self, row: int) -> tuple[Scene, FloatArray]:
        return scene_of(self._simulation, row), self._history.of(row)
