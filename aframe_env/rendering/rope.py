"""The rope: taut, slack or parted; hundreds of metres of it are left out between two zigzag lines."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from aframe_env.rendering import palette
from aframe_env.rendering.canvas import Box, Canvas
from aframe_env.rendering.scene import Scene
from aframe_env.rendering.ship import drum_on_picture
from aframe_env.rendering.view import FloatArray, View

_WHEEL: Final = 0.55
"""Radius at which the pulley is drawn, m."""
_TOOTH: Final = 7.0
"""Width of half a tooth of the zigzag lines, pixels."""


def draw_hoist(canvas: Canvas, view: View, scene: Scene) -> None:
    """Draw the rope from the drum over the pulley, and the pulley."""
    centre, radius = drum_on_picture(view, scene)
    pulley = view.pixels(scene.pulley)
    wheel = _WHEEL * view.scale
    hub = pulley - np.array([wheel, 0.0])
    span = hub - centre
    along = math.atan2(-span[1], span[0])
    # The rope touches both circles on the side away from the ship's deck.
    side = along + math.acos((radius - wheel) / float(np.hypot(*span)))
    outward = np.array([math.cos(side), -math.sin(side)])
    over = np.linspace(side, 0.0, 8)
    wrap = hub + wheel * np.stack([np.cos(over), -np.sin(over)], axis=1)
    canvas.circle(hub, wheel - 0.5, palette.CHROME, edge=palette.MACHINE)
    canvas.circle(hub, 1.8, palette.MACHINE)
    _draw_rope(canvas, np.concatenate([[centre + radius * outward], wrap]), scene)


def draw_hanging(canvas: Canvas, top: FloatArray, bottom: FloatArray, scene: Scene) -> None:
    """Draw a straight piece of the rope between two pixels: wavy where the rope is slack, a stub where it parted."""
    if scene.parted:
        bottom = top + 0.12 * (bottom - top)
    points = np.stack([top, bottom])
    if scene.slack or scene.parted:
        share = np.linspace(0.0, 1.0, 80)
        points = top + share[:, None] * (bottom - top)
        waves = float(np.hypot(*(bottom - top))) / 34.0
        points[:, 0] += 5.0 * np.sqrt(np.abs(np.sin(math.pi * share))) * np.sin(2.0 * math.pi * waves * share)
    _draw_rope(canvas, points, scene)


def _draw_rope(canvas: Canvas, points: FloatArray, scene: Scene) -> None:
    canvas.line(points, palette.ROPE_EDGE, 3.6)
    canvas.line(points, palette.WARNING if scene.slack or scene.parted else palette.ROPE, 2.0)


def draw_gap(canvas: Canvas, box: Box, above: float, below: float, scene: Scene) -> None:
    """Draw the band that stands for the rope left out, with its length; the rope's pixels x are given."""
    left, top, width, height = box
    x = np.arange(left - _TOOTH, left + width + 2.0 * _TOOTH, _TOOTH)
    tooth = np.where(np.arange(len(x)) % 2 == 0, -2.5, 2.5)
    upper = np.stack([x, top + tooth], axis=1)
    lower = np.stack([x, top + height + tooth], axis=1)
    canvas.polygon(np.concatenate([upper, lower[::-1]]), palette.PAGE)
    canvas.line(upper, palette.FADED, 1.0)
    canvas.line(lower, palette.FADED, 1.0)
    text = f"{scene.rope_length:.1f} m of rope"
    middle = top + 0.5 * height
    canvas.text(text, (min(above, below) - 12.0, middle), size=11, bold=True, anchor="midright")
    for share in (0.25, 0.5, 0.75):
        canvas.circle((above + share * (below - above), top + share * height), 1.3, palette.INK)
