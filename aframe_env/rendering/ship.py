"""The ship's stern with the A-frame, the servomotors and the drum."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from aframe_env.rendering import palette
from aframe_env.rendering.canvas import Canvas
from aframe_env.rendering.scene import Scene
from aframe_env.rendering.view import FloatArray, View

# A supply ship's stern in the deck frame, m: drawn, not computed with.
_STERN, _BOW_SIDE, _HALF_BEAM = 1.6, -75.0, 9.0
_WATERLINE, _RAIL = -5.0, 0.35
_SIDE: Final = ((_BOW_SIDE, _RAIL), (_STERN, _RAIL), (_STERN, _WATERLINE), (_BOW_SIDE, _WATERLINE))
_UNDERWATER: Final = (
    (_BOW_SIDE, _WATERLINE),
    (_STERN, _WATERLINE),
    (_STERN - 0.3, -6.2),
    (-3.0, -7.6),
    (-9.0, -9.9),
    (-14.0, -11.0),
    (_BOW_SIDE, -11.0),
)
_HOUSE_AFT, _HOUSE_TOP = -27.0, 4.6
_BRIDGE_AFT, _BRIDGE_TOP = -32.0, 8.6


def draw_ship(canvas: Canvas, view: View, scene: Scene) -> None:
    """Draw hull, deck and house."""

    def side(points: tuple[tuple[float, float], ...], y: float) -> FloatArray:
        return view.pixels(scene.on_deck([(x, y, z) for x, z in points]))

    near, far = -_HALF_BEAM, _HALF_BEAM
    deck = [(_BOW_SIDE, near, 0.0), (_STERN, near, 0.0), (_STERN, far, 0.0), (_BOW_SIDE, far, 0.0)]
    canvas.polygon(side((*_SIDE[:2], (_STERN, 0.0), (_BOW_SIDE, 0.0)), far), palette.HULL)
    canvas.polygon(view.pixels(scene.on_deck(deck)), palette.DECK)
    _draw_house(canvas, view, scene)
    canvas.polygon(side(_UNDERWATER, near), palette.BOTTOM)
    canvas.polygon(side(_SIDE, near), palette.HULL)
    canvas.line(side(((_BOW_SIDE, _RAIL), (_STERN, _RAIL)), near), palette.CHROME, 1.5)
    canvas.line(side(((_BOW_SIDE, _WATERLINE), (_STERN, _WATERLINE)), near), palette.HOUSE, 1.5)


def _draw_house(canvas: Canvas, view: View, scene: Scene) -> None:
    for aft, low, top in ((_HOUSE_AFT, 0.0, _HOUSE_TOP), (_BRIDGE_AFT, _HOUSE_TOP, _BRIDGE_TOP)):
        near, far = -7.0, 7.0
        wall = [(_BOW_SIDE, near, low), (aft, near, low), (aft, near, top), (_BOW_SIDE, near, top)]
        end = [(aft, near, low), (aft, far, low), (aft, far, top), (aft, near, top)]
        roof = [(_BOW_SIDE, near, top), (aft, near, top), (aft, far, top), (_BOW_SIDE, far, top)]
        for face, colour in ((roof, palette.CHROME), (end, palette.HOUSE_SHADE), (wall, palette.HOUSE)):
            canvas.polygon(view.pixels(scene.on_deck(face)), colour)
        for x in np.arange(aft - 1.8, aft - 20.0, -2.4):
            level = 0.5 * (low + top) + 0.4
            window = [(x, near, level), (x + 1.1, near, level), (x + 1.1, near, level + 1.1), (x, near, level + 1.1)]
            canvas.polygon(view.pixels(scene.on_deck(window)), palette.WINDOW)


def draw_frame_and_drum(canvas: Canvas, view: View, scene: Scene) -> None:
    """Draw the portal: legs from the feet A to the corners B, the top beam with S, the servomotors N-C; the drum."""
    frame = scene.crane.frame
    sine, cosine = math.sin(scene.luffing_angle), math.cos(scene.luffing_angle)

    def pixel(x: float, y: float, z: float) -> FloatArray:
        return view.pixels(scene.on_deck([x, y, z]))

    def leg(y: float, height: float) -> FloatArray:
        return pixel(height * sine, y, height * cosine)

    width = frame.half_width
    for y, colour in ((width, palette.STEEL_SHADE), (-width, palette.STEEL)):
        if y < 0.0:
            canvas.line([leg(width, frame.height), leg(-width, frame.height)], palette.STEEL_SHADE, 9.0)
            _draw_drum(canvas, view, scene)
        foot, end = pixel(frame.servomotor_deck_x, y, 0.0), leg(y, frame.servomotor_height)
        canvas.line([foot, end], palette.CHROME, 3.0)
        canvas.line([foot, 0.45 * foot + 0.55 * end], palette.MACHINE, 5.0)
        canvas.line([pixel(0.0, y, 0.0), leg(y, frame.height)], colour, 8.0)
        for joint in (pixel(0.0, y, 0.0), foot, end):
            canvas.circle(joint, 3.5, palette.MACHINE)


def drum_on_picture(view: View, scene: Scene) -> tuple[FloatArray, float]:
    """Centre and radius of the drum H, pixels."""
    return view.pixels(scene.on_deck(scene.crane.drum_position)), view.scale * scene.crane.winch.drum_radius


def _draw_drum(canvas: Canvas, view: View, scene: Scene) -> None:
    """Draw the drum H; its spokes turn clockwise when it pays out."""
    centre, radius = drum_on_picture(view, scene)
    x, y, _ = scene.crane.drum_position
    for foot in (x - 1.5, x + 1.5):
        canvas.line([centre, view.pixels(scene.on_deck([foot, y, 0.0]))], palette.MACHINE, 4.0)
    draw_wheel(canvas, centre, 1.5 * radius, scene.drum_angle)


def draw_wheel(canvas: Canvas, centre: FloatArray, radius: float, angle: float) -> None:
    """Draw a drum's flange with three spokes, one of them marked, turned clockwise by ``angle`` rad."""
    canvas.circle(centre, radius, palette.CHROME, edge=palette.MACHINE)
    for spoke, colour in ((1, palette.MACHINE), (2, palette.MACHINE), (0, palette.WARNING)):
        turn = 0.5 * math.pi - angle + spoke * 2.0 * math.pi / 3.0
        tip = centre + 0.82 * radius * np.array([math.cos(turn), -math.sin(turn)])
        canvas.line(np.stack([centre, tip]), colour, max(2.0, 0.13 * radius))
    canvas.circle(centre, 0.22 * radius, palette.MACHINE)
