"""The side view: sea, ship, A-frame, rope, and the load: where it is, or below the rope left out."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from aframe_env.rendering import palette
from aframe_env.rendering.canvas import Box, Canvas, text_width
from aframe_env.rendering.load import draw_ghost, draw_load
from aframe_env.rendering.palette import Colour
from aframe_env.rendering.rope import draw_gap, draw_hanging, draw_hoist
from aframe_env.rendering.scene import Scene
from aframe_env.rendering.ship import draw_frame_and_drum, draw_ship
from aframe_env.rendering.view import FloatArray, View

_SCALE: Final = 11.0
"""Greatest scale, pixels per metre; a crane that would stand out of the picture has a smaller one."""
_RECESSION: Final = (0.30, 0.15)
_AFT, _ABOVE = 160.0, 187.0
"""Extent of the view aft of the deck's origin and above it, pixels."""
_HEAVE: Final = 2.5
"""Heave of the pulley that there is room for, m; with more of it the words stay at the picture's edge."""
_WORDS: Final = (100.0, 34.0)
"""Room for the words beside and above the pulley, pixels."""
_BELOW: Final = 92.0
"""Height of the part about the load, pixels."""
_GAP: Final = 18.0
"""Height of the band that stands for the rope left out, pixels."""
LOAD_SIZE: Final = 30.0
"""Size of the load's picture, pixels."""
_NEAR, _FAR = -11.0, 16.0
"""Ends of the sea along y, towards the onlooker and away, m."""


def draw_side_view(canvas: Canvas, box: Box, scene: Scene, still: Scene | None = None) -> tuple[float, float]:
    """Draw the side view, and the load of ``still`` beside its own; return the pixel about which the load is seen."""
    left, top, width, height = box
    view = View((left + width - _AFT, top + _ABOVE), scale_of(scene), _RECESSION)
    # By the target, not by the load, so that a load that heaves does not change the picture.
    near = float(view.pixels([0.0, 0.0, scene.target_level])[1]) < top + height - _BELOW
    upper = box if near else (left, top, width, height - _BELOW)
    with canvas.within(upper):
        canvas.gradient(upper, palette.SKY_TOP, palette.SKY_LOW)
        _draw_water(canvas, view, upper, scene, _FAR, palette.FAR_WATER, 1.0)
        draw_ship(canvas, view, scene)
        draw_frame_and_drum(canvas, view, scene)
        if near:
            _draw_load(canvas, view, upper, scene, still)
        _draw_water(canvas, view, upper, scene, _NEAR, palette.NEAR_WATER, 0.55)
        darker = float(view.pixels([0.0, 0.0, scene.water.level - 2.0])[1])
        canvas.gradient(
            (left, darker, width, top + upper[3] - darker), palette.DEEP_WATER, palette.DEEP_WATER, (0.0, 0.8)
        )
        draw_hoist(canvas, view, scene)
        _draw_pulley_heave(canvas, view, upper, scene)
        cut = top + upper[3]
        if not near:
            draw_hanging(canvas, view.pixels(scene.pulley), _on_rope(view, scene, cut), scene)
    if near:
        with canvas.within(upper):
            colour = palette.TARGET_IN_AIR if scene.target_level > scene.water.level else palette.TARGET
            _draw_level(canvas, left, width, float(view.pixels([0.0, 0.0, scene.target_level])[1]), scene, colour)
        _draw_captions(canvas, left, top, scene)
        x, y = view.pixels(scene.load)
        return float(x), float(y)
    lower = (left, top + upper[3], width, _BELOW)
    with canvas.within(lower):
        place = _draw_depth(canvas, lower, view, scene, still)
    with canvas.within(box):
        gap = (left, cut - 0.5 * _GAP, width, _GAP)
        draw_gap(canvas, gap, _on_rope(view, scene, cut)[0], float(place[0]), scene)
    _draw_captions(canvas, left, top, scene)
    return float(place[0]), float(place[1])


def scale_of(scene: Scene) -> float:
    """Scale of the side view, pixels per metre: the pulley and the words beside it are within the picture."""
    x, z = scene.furthest
    return min(_SCALE, (_AFT - _WORDS[0]) / max(x, 1.0), (_ABOVE - _WORDS[1]) / (max(z, 1.0) + _HEAVE))


def _draw_water(canvas: Canvas, view: View, box: Box, scene: Scene, y: float, colour: Colour, opacity: float) -> None:
    """Draw the water from its surface at ``y`` [m] down."""
    left, top, width, height = box
    ends = view.metres([[left - 2.0, top], [left + width + 2.0, top]], y)[:, 0]
    x = np.linspace(ends[0], ends[1], 120)
    heights = scene.water.heights(x, y, scene.time)
    surface = view.pixels(np.stack([x, np.full_like(x, y), heights], axis=1))
    corners = [[surface[-1, 0], top + height + 2.0], [surface[0, 0], top + height + 2.0]]
    canvas.polygon(np.concatenate([surface, corners]), colour, opacity=opacity)
    canvas.line(surface, palette.FOAM, 1.2)


def _on_rope(view: View, scene: Scene, height: float) -> FloatArray:
    """Pixel at which the straight line from the pulley to the load crosses a height in pixels."""
    pulley, load = view.pixels(scene.pulley), view.pixels(scene.load)
    return np.asarray(pulley + (load - pulley) * (height - pulley[1]) / (load[1] - pulley[1]))


def _draw_pulley_heave(canvas: Canvas, view: View, box: Box, scene: Scene) -> None:
    x, y = view.pixels(scene.pulley)
    rest = float(view.pixels([0.0, 0.0, scene.crane.pulley_position[2]])[1])
    canvas.dashes((x + 8.0, rest), (x + 62.0, rest), palette.FADED, 1.0, 3.0)
    canvas.line([(x + 8.0, y), (x + 26.0, y)], palette.INK, 1.2)
    if abs(rest - y) > 3.0:
        canvas.line([(x + 20.0, rest), (x + 20.0, y)], palette.INK, 1.6)
    left, top, width, _ = box
    words = min(x + 36.0, left + width - 64.0), max(min(y, rest) - 9.0, top + 22.0)
    canvas.text("heave", (words[0], words[1] - 13.0), size=10)
    canvas.text(f"{scene.pulley_heave:+.2f} m", words, size=11, bold=True)


def _draw_load(canvas: Canvas, view: View, box: Box, scene: Scene, still: Scene | None) -> None:
    """Draw the load where it is, and the ground where that is as near."""
    place = view.pixels(scene.load)
    if math.isfinite(scene.ground):
        left, top, width, height = box
        ground = float(view.pixels([0.0, 0.0, scene.ground])[1]) + 0.5 * LOAD_SIZE
        if ground < top + height:
            canvas.box((left, ground, width, top + height - ground), palette.GROUND)
    if not scene.parted:
        draw_hanging(canvas, view.pixels(scene.pulley), place, scene)
    if still is not None:
        draw_ghost(canvas, view.pixels(still.load), LOAD_SIZE)
    draw_load(canvas, place, LOAD_SIZE)


def _draw_level(
    canvas: Canvas, left: float, width: float, height: float, scene: Scene, colour: Colour = palette.TARGET
) -> None:
    """Draw the target level at a height in pixels."""
    canvas.dashes((left, height), (left + width, height), colour, 1.2)
    label = f"target level {scene.target_level:.1f} m"
    canvas.text(label, (left + 14.0, height - 10.0), size=11, colour=colour)


def _draw_depth(canvas: Canvas, box: Box, view: View, scene: Scene, still: Scene | None) -> FloatArray:
    """Draw the load about its target level, at the ship's scale; return the load's pixel."""
    left, top, width, height = box
    canvas.gradient(box, palette.DEEP_WATER, (4, 22, 38))
    target = top + 0.56 * height
    reach = 0.5 * height - 16.0

    def level(of: Scene) -> float:
        return target - max(-reach, min(view.scale * of.depth_error, reach))

    # Where the load's lower edge is when it stands on the ground.
    ground = target - max(view.scale * (scene.ground - scene.target_level), -2.0 * reach) + 0.5 * LOAD_SIZE
    if ground < top + height:
        ground = max(ground, top)
        canvas.box((left, ground, width, top + height - ground), palette.GROUND)
        canvas.text("seabed", (left + 14.0, min(ground + 12.0, top + height - 8.0)), size=11, colour=palette.PAGE)
    x = min(max(float(view.pixels(scene.load)[0]), left + 24.0), left + width - 24.0)
    place = np.array([x, level(scene)])
    _draw_level(canvas, left, width, target, scene)
    slope = _on_rope(view, scene, 0.0) - _on_rope(view, scene, 1.0)
    if not scene.parted:
        draw_hanging(canvas, place + slope * (place[1] - top), place, scene)
    if still is not None:
        draw_ghost(canvas, np.array([x, level(still)]), LOAD_SIZE)
    draw_load(canvas, place, LOAD_SIZE)
    return place


def _draw_captions(canvas: Canvas, left: float, top: float, scene: Scene) -> None:
    chip = max(96.0, text_width(scene.motion)) + 28.0
    canvas.box((left, top, chip, 56.0), palette.PAGE)
    canvas.text(f"{scene.time:.1f} s", (left + 14.0, top + 19.0), size=18, bold=True)
    canvas.text(scene.motion, (left + 14.0, top + 41.0), colour=palette.FADED)
    if scene.slack or scene.parted:
        text = "rope parted: load lost" if scene.parted else "rope slack"
        canvas.box((left + 14.0, top + 66.0, 168.0 if scene.parted else 92.0, 22.0), palette.WARNING, radius=5.0)
        canvas.text(text, (left + 22.0, top + 77.0), colour=palette.CARD, bold=True)
