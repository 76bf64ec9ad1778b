"""Strip chart of the depth error and, beside it, of the pulley's heave or the depth error with the drum still."""

from __future__ import annotations

from typing import Final

import numpy as np

from aframe_env.rendering import palette
from aframe_env.rendering.canvas import Box, Canvas
from aframe_env.rendering.history import SPAN
from aframe_env.rendering.view import FloatArray, round_limit

_MARGINS: Final = (52.0, 34.0, 18.0, 24.0)
"""Margins from the card's left, top, right and bottom edges to the curves, pixels."""


def draw_chart(canvas: Canvas, box: Box, time: float, history: FloatArray, legend: tuple[str, str]) -> None:
    """Draw the card; ``history`` has lines of time [s] and of two curves [m], the depth error and what is beside it."""
    left, top, width, height = box
    canvas.box(box, palette.CARD, radius=8.0, edge=palette.EDGE)
    x, y = left + _MARGINS[0], top + _MARGINS[1]
    plot = (x, y, width - _MARGINS[0] - _MARGINS[2], height - _MARGINS[1] - _MARGINS[3])
    start = max(0.0, time - SPAN)
    shown = history[history[:, 0] >= start]
    # Beyond 100 m a lost load falls: the heave before that is what the chart is for.
    limit = min(round_limit(float(np.max(np.abs(shown[:, 1:]), initial=0.0))), 100.0)
    middle, tall = y + 0.5 * plot[3], 0.5 * plot[3] / limit

    _draw_legend(canvas, left, top, legend)
    for share in (-1.0, -0.5, 0.0, 0.5, 1.0):
        level = middle - share * limit * tall
        canvas.line([(x, level), (x + plot[2], level)], palette.EDGE if share == 0.0 else palette.GRID, 1.0)
        label = f"{share * limit:+.3g}" if share else "0"
        canvas.text(label, (x - 8.0, level), size=11, colour=palette.FADED, anchor="midright")
    canvas.text("m", (x - 8.0, y - 15.0), size=11, colour=palette.FADED, anchor="midright")
    for tick in np.arange(np.ceil(start / 10.0) * 10.0, start + SPAN + 1e-9, 10.0):
        place = x + plot[2] * (tick - start) / SPAN
        canvas.line([(place, y), (place, y + plot[3])], palette.GRID, 1.0)
        canvas.text(f"{tick:.0f} s", (place, y + plot[3] + 12.0), size=11, colour=palette.FADED, anchor="center")
    with canvas.within((x - 6.0, y - 2.0, plot[2] + 12.0, plot[3] + 4.0)):
        for column, colour, thickness in ((2, palette.HEAVE, 4.0), (1, palette.ERROR, 1.8)):
            curve = np.stack([x + plot[2] * (shown[:, 0] - start) / SPAN, middle - tall * shown[:, column]], axis=1)
            if len(curve):
                canvas.line(curve, colour, thickness)
                canvas.circle(curve[-1], thickness + 1.8, colour)


def _draw_legend(canvas: Canvas, left: float, top: float, legend: tuple[str, str]) -> None:
    place = left + _MARGINS[0]
    for text, colour, bold in zip(legend, (palette.ERROR, palette.HEAVE), (True, False), strict=True):
        canvas.line([(place, top + 17.0), (place + 18.0, top + 17.0)], colour, 2.5)
        place += 26.0 + canvas.text(text, (place + 26.0, top + 17.0), bold=bold) + 28.0
