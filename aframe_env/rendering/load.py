"""The load: at the ship's scale, and magnified with its depth error."""

from __future__ import annotations

from typing import Final

import numpy as np

from aframe_env.rendering import palette
from aframe_env.rendering.canvas import Box, Canvas
from aframe_env.rendering.scene import Scene
from aframe_env.rendering.view import FloatArray, View, round_limit

MEMORY: Final = 10.0
"""The magnification suits the depth errors of this time past, s."""
_RULER: Final = 46.0
"""Room for the ruler, pixels."""
_MARGIN: Final = 26.0
"""Margin from the ruler's ends to the edges, pixels."""


def draw_load(canvas: Canvas, place: FloatArray, width: float) -> None:
    """Draw the load as a crate about the pixel ``place``."""
    height = 0.56 * width
    left, top = float(place[0]) - 0.5 * width, float(place[1]) - 0.5 * height
    canvas.box((left, top, width, height), palette.LOAD, radius=0.06 * width, edge=palette.LOAD_SHADE)
    for share in (0.25, 0.75):
        x = left + share * width
        canvas.line([(x, top + 2.0), (x, top + height - 2.0)], palette.LOAD_SHADE, max(1.0, 0.03 * width))


def draw_ghost(canvas: Canvas, place: FloatArray, width: float) -> None:
    """Draw the load of the drum that stands still, as an outline about the pixel ``place``."""
    across, up = 0.5 * width, 0.28 * width
    corners = np.asarray(place) + np.array([[-across, -up], [across, -up], [across, up], [-across, up]])
    canvas.polygon(corners, palette.HEAVE, opacity=0.25)
    canvas.line([*corners, corners[0]], palette.HEAVE, max(1.2, 0.022 * width))


def draw_magnified(
    canvas: Canvas, box: Box, ship_scale: float, scene: Scene, history: FloatArray, still: Scene | None = None
) -> None:
    """Draw a card with the load, its target level and a ruler; ``ship_scale`` is the ship's, pixels per metre."""
    left, top, width, height = box
    canvas.box(box, palette.CARD, radius=8.0, edge=palette.EDGE)
    error = scene.depth_error
    canvas.text(
        f"{error:+.3f} m" if abs(error) < 10.0 else f"{error:+.1f} m",
        (left + width - 14.0, top + 17.0),
        size=13,
        bold=True,
        colour=palette.ERROR,
        anchor="midright",
    )
    sea = (left + 10.0, top + 34.0, width - 20.0, height - 44.0)
    surface = scene.water.heights(scene.load[:1], float(scene.load[1]), scene.time)[0]
    if scene.load[2] > surface:
        canvas.gradient(sea, palette.HIGH_AIR, palette.LOW_AIR)
    else:
        canvas.gradient(sea, palette.NEAR_WATER, palette.DEEP_WATER)
    recent = history[history[:, 0] >= scene.time - MEMORY, 1]
    # Beside the load with the drum still there is one scale for all the time that the chart has: it hardly changes.
    shown = recent if still is None else history[:, 1:].ravel()
    limit = min(round_limit(float(np.max(np.abs([*shown, error])))), 100.0)
    view = View((sea[0] + 0.5 * (sea[2] + _RULER), sea[1] + 0.5 * sea[3]), (0.5 * sea[3] - _MARGIN) / limit)
    with canvas.within(sea):
        if still is None:
            _draw_range(canvas, view, sea, recent, limit)
        _draw_ruler(canvas, view, sea, limit)
        if still is not None:
            _draw_still(canvas, view, sea, still, limit)
        _draw_error(canvas, view, sea, scene, limit)
    written = canvas.text("Load", (left + 14.0, top + 17.0), size=13, bold=True)
    times = view.scale / ship_scale
    magnification = f"{times:.0f}" if times >= 10.0 else f"{times:.2g}"
    canvas.text(
        f"{magnification} × the ship's scale", (left + 22.0 + written, top + 17.0), size=11, colour=palette.FADED
    )


def _draw_range(canvas: Canvas, view: View, sea: Box, recent: FloatArray, limit: float) -> None:
    """Draw a bar over the depth errors of the last seconds."""
    if len(recent) < 2:
        return
    ends = np.clip([np.max(recent), np.min(recent)], -1.2 * limit, 1.2 * limit)
    (_, high), (_, low) = view.pixels([[0.0, 0.0, end] for end in ends])
    x = sea[0] + _RULER + 4.0
    corners = [(x, high - 1.0), (x + 7.0, high - 1.0), (x + 7.0, low + 1.0), (x, low + 1.0)]
    canvas.polygon(corners, palette.LOAD, opacity=0.75)
    canvas.text(f"last {MEMORY:.0f} s", (x, sea[1] + 11.0), size=10, colour=palette.FOAM)


def _draw_ruler(canvas: Canvas, view: View, sea: Box, limit: float) -> None:
    x = sea[0] + _RULER
    ends = view.pixels([[0.0, 0.0, limit], [0.0, 0.0, -limit]])[:, 1]
    canvas.line([(x, ends[0]), (x, ends[1])], palette.FOAM, 1.2)
    for tick in range(-10, 11):
        level = 0.1 * tick * limit
        y = float(view.pixels([0.0, 0.0, level])[1])
        labelled = tick % 5 == 0
        canvas.line([(x - (7.0 if labelled else 4.0), y), (x, y)], palette.FOAM, 1.0)
        if labelled:
            canvas.text(
                f"{level:+.3g}" if tick else "0", (x - 10.0, y), size=10, colour=palette.FOAM, anchor="midright"
            )
    canvas.text("m", (x - 10.0, sea[1] + 11.0), size=10, colour=palette.FOAM, anchor="midright")


def _draw_still(canvas: Canvas, view: View, sea: Box, still: Scene, limit: float) -> None:
    place = view.pixels([0.0, 0.0, max(-1.12 * limit, min(still.depth_error, 1.12 * limit))])
    canvas.line([(place[0], sea[1] - 4.0), (place[0], place[1] - 0.28 * 92.0)], palette.HEAVE, 1.5)
    draw_ghost(canvas, place, 92.0)
    canvas.text("drum still", (place[0] - 54.0, place[1]), size=11, colour=palette.HEAVE, anchor="midright")


def _draw_error(canvas: Canvas, view: View, sea: Box, scene: Scene, limit: float) -> None:
    right = sea[0] + sea[2]
    target = float(view.pixels([0.0, 0.0, 0.0])[1])
    shown = max(-1.12 * limit, min(scene.depth_error, 1.12 * limit))
    place = view.pixels([0.0, 0.0, shown])
    top = np.array([place[0], sea[1] - 4.0])
    if not scene.parted:
        canvas.line([top, place], palette.ROPE_EDGE, 6.0)
        canvas.line([top, place], palette.WARNING if scene.slack else palette.ROPE, 4.0)
    draw_load(canvas, place, 92.0)
    canvas.dashes((sea[0] + _RULER, target), (right, target), palette.TARGET, 1.6)
    canvas.text("target", (right - 8.0, target - 9.0), size=11, colour=palette.TARGET, anchor="midright", bold=True)
    x = float(place[0]) + 64.0
    if abs(target - float(place[1])) > 3.0:
        canvas.line([(x, target), (x, float(place[1]))], palette.FOAM, 1.6)
    canvas.line([(float(place[0]) + 48.0, float(place[1])), (x + 5.0, float(place[1]))], palette.FOAM, 1.2)
    if abs(scene.depth_error) > 1.12 * limit:
        canvas.text("▼" if scene.depth_error < 0.0 else "▲", (x + 16.0, place[1]), size=12, colour=palette.FOAM)
