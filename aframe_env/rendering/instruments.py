"""Instruments: drum speed, rope tension, and the load on the rope."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from aframe_env.rendering import palette
from aframe_env.rendering.canvas import Box, Canvas
from aframe_env.rendering.palette import Colour
from aframe_env.rendering.scene import Scene
from aframe_env.rendering.ship import draw_wheel

_SWEEP: Final = math.radians(125.0)
"""Angle from standstill, at the top of the dial, to the greatest speed."""


def draw_instruments(canvas: Canvas, box: Box, scene: Scene) -> None:
    """Draw the card with all instruments."""
    left, top, width, _ = box
    canvas.box(box, palette.CARD, radius=8.0, edge=palette.EDGE)
    _draw_dial(canvas, np.array([left + 88.0, top + 92.0]), scene)
    canvas.text("Winch drum", (left + 14.0, top + 17.0), size=13, bold=True)
    canvas.text("command", (left + 14.0, top + 34.0), size=10, colour=palette.ERROR)
    x, right = left + 174.0, left + width - 14.0
    _draw_tension(canvas, (x, top + 17.0, right - x, 56.0), scene)
    for y, name, value in (
        (100.0, "Rope breaks", f"{scene.crane.rope.breaking_load / 1e3:.0f} kN"),
        (120.0, "Load", f"{scene.load_mass / 1e3:.1f} t"),
        (140.0, "Drum angle", f"{scene.drum_angle:+.1f} rad"),
    ):
        canvas.text(name, (x, top + y), colour=palette.FADED)
        canvas.text(value, (right, top + y), anchor="midright")


def _draw_dial(canvas: Canvas, centre: np.ndarray, scene: Scene) -> None:
    radius = 50.0
    greatest = scene.crane.winch.max_speed
    upright = 0.5 * math.pi

    def angle(speed: float) -> float:
        return upright - _SWEEP * max(-1.0, min(speed / greatest, 1.0))

    def on_dial(speed: float, distance: float) -> np.ndarray:
        turn = angle(speed)
        return centre + distance * np.array([math.cos(turn), -math.sin(turn)])

    canvas.arc(centre, radius, (upright - _SWEEP, upright + _SWEEP), palette.GRID, 9.0)
    if abs(scene.drum_speed) > 1e-3 * greatest:
        canvas.arc(centre, radius, (upright, angle(scene.drum_speed)), palette.HEAVE, 9.0)
    canvas.line([on_dial(0.0, radius - 7.0), on_dial(0.0, radius + 7.0)], palette.INK, 1.5)
    canvas.line(
        [on_dial(scene.drum_command, radius - 9.0), on_dial(scene.drum_command, radius + 9.0)], palette.ERROR, 2.5
    )
    draw_wheel(canvas, centre, 33.0, scene.drum_angle)
    canvas.text(f"{scene.drum_speed:+.2f} rad/s", (centre[0], centre[1] + 55.0), bold=True, anchor="center")
    canvas.text("in", (centre[0] - 62.0, centre[1] + 38.0), size=10, colour=palette.FADED, anchor="center")
    canvas.text("out", (centre[0] + 63.0, centre[1] + 38.0), size=10, colour=palette.FADED, anchor="center")


def _draw_tension(canvas: Canvas, box: Box, scene: Scene) -> None:
    """Draw the rope's tension on a scale from nothing to the breaking load, with a mark at the load's weight."""
    left, top, width, _ = box
    breaking = scene.crane.rope.breaking_load
    state, colour = _state(scene)
    canvas.text("Rope tension", (left, top), size=12, bold=True)
    canvas.text(
        f"{scene.tension / 1e3:.0f} kN", (left + width, top + 21.0), bold=True, anchor="midright", colour=colour
    )
    canvas.text(state, (left, top + 21.0), colour=colour)
    bar = (left, top + 34.0, width, 11.0)
    canvas.box(bar, palette.GRID, radius=3.0)
    share = max(0.0, min(scene.tension / breaking, 1.0))
    canvas.box((left, bar[1], share * width, bar[3]), colour, radius=3.0)
    weight = left + width * min(scene.weight / breaking, 1.0)
    canvas.line([(weight, bar[1] - 3.0), (weight, bar[1] + bar[3] + 3.0)], palette.INK, 1.5)
    canvas.text("weight", (weight, bar[1] + 22.0), size=10, colour=palette.FADED, anchor="center")


def _state(scene: Scene) -> tuple[str, Colour]:
    if scene.parted:
        return "parted", palette.WARNING
    return ("slack", palette.WARNING) if scene.slack else ("taut", palette.GOOD)
