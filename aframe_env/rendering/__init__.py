"""Pictures of the environment. Reads the simulation, has no physics; the only user of pygame (extra ``render``)."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from gymnasium.error import DependencyNotInstalled

if TYPE_CHECKING:
    from aframe_env.rendering.painter import Painter
    from aframe_env.rendering.renderer import Renderer
    from aframe_env.simulation import Simulation


def open_renderer(simulation: Simulation) -> Renderer:
    """Return a renderer of the simulation's rows, whose history begins now.

    Raises ``DependencyNotInstalled`` where pygame is missing.
    """
    _require_pygame()
    from aframe_env.rendering.renderer import Renderer

    return Renderer(simulation)


def open_painter(size: tuple[int, int], legend: tuple[str, str]) -> Painter:
    """Return a painter of scenes: of pictures ``size`` pixels wide and high, ``legend`` at the chart's two curves.

    Raises ``DependencyNotInstalled`` where pygame is missing.
    """
    _require_pygame()
    from aframe_env.rendering.painter import Painter

    return Painter(size, legend)


def _require_pygame() -> None:
    # A greeting on standard output at import has no place in the output of who imports us.
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame  # noqa: F401
    except ImportError as error:
        raise DependencyNotInstalled('pygame is not installed: pip install "aframe-heave[render]"') from error
