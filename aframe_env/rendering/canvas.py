"""A canvas: shapes and text in pixels of the picture, drawn finer and then shrunk, which smooths every edge."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Final, Literal

import matplotlib
import numpy as np
import numpy.typing as npt
import pygame

from aframe_env.rendering.palette import INK, Colour

Point = tuple[float, float] | npt.NDArray[np.float64]
Points = Sequence[Point] | npt.NDArray[np.float64]
Box = tuple[float, float, float, float]
"""Left, top, width, height."""
Anchor = Literal["midleft", "center", "midright", "midbottom", "midtop"]

_FINENESS: Final = 2
_TRANSPARENT: Final = (0, 0, 0, 0)


@cache
def _font(size: int, bold: bool) -> pygame.font.Font:
    pygame.font.init()
    # matplotlib brings a font that has the units' characters and looks the same on every machine.
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return pygame.font.Font(str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name), size * _FINENESS)


class Canvas:
    """Picture to draw on: later shapes lie above earlier ones."""

    def __init__(self, width: int, height: int) -> None:
        self.size = (width, height)
        self._fine = pygame.Surface((width * _FINENESS, height * _FINENESS), 0, 32)

    def picture(self, size: tuple[int, int] | None = None) -> pygame.Surface:
        """Return the picture, one pixel a pixel, or stretched to ``size`` pixels."""
        return pygame.transform.smoothscale(self._fine, size or self.size)

    @contextmanager
    def within(self, box: Box) -> Iterator[None]:
        """Draw within ``box`` only."""
        before = self._fine.get_clip()
        self._fine.set_clip(_rect(box).clip(before))
        try:
            yield
        finally:
            self._fine.set_clip(before)

    def box(self, box: Box, colour: Colour, *, radius: float = 0.0, edge: Colour | None = None) -> None:
        """Fill a box, its corners rounded."""
        round_off = round(radius * _FINENESS)
        pygame.draw.rect(self._fine, colour, _rect(box), border_radius=round_off)
        if edge is not None:
            pygame.draw.rect(self._fine, edge, _rect(box), width=_FINENESS, border_radius=round_off)

    def round_off(self, box: Box, beyond: Colour, radius: float) -> None:
        """Round the corners of what is drawn in a box: colour what is ``radius`` beyond them."""
        left, top, width, height = box
        ring = _rect((left - radius, top - radius, width + 2.0 * radius, height + 2.0 * radius))
        thickness = round(radius * _FINENESS)
        pygame.draw.rect(self._fine, beyond, ring, width=thickness, border_radius=2 * thickness)

    def gradient(self, box: Box, top: Colour, bottom: Colour, opacity: tuple[float, float] = (1.0, 1.0)) -> None:
        """Fill a box with colours, and opacities, from ``top`` to ``bottom``."""
        ends = np.array([[*top, 255.0 * opacity[0]], [*bottom, 255.0 * opacity[1]]])
        rect = _rect(box)
        share = np.linspace(0.0, 1.0, rect.height)[:, None]
        column = np.rint((1.0 - share) * ends[0] + share * ends[1]).astype(np.uint8)
        if min(opacity) >= 1.0:
            for y, colour in enumerate(column.tolist(), start=rect.top):
                pygame.draw.line(self._fine, colour, (rect.left, y), (rect.right - 1, y))
            return
        strip = pygame.image.frombuffer(column.tobytes(), (1, rect.height), "RGBA")
        self._fine.blit(pygame.transform.scale(strip, rect.size), rect)

    def polygon(self, points: Points, colour: Colour, *, opacity: float = 1.0) -> None:
        """Fill a polygon."""
        fine = _fine(points)
        if opacity >= 1.0:
            pygame.draw.polygon(self._fine, colour, fine)
            return
        low, high = np.floor(np.min(fine, axis=0)), np.ceil(np.max(fine, axis=0))
        layer = pygame.Surface(tuple((high - low + 1.0).astype(int)), pygame.SRCALPHA, 32)
        layer.fill(_TRANSPARENT)
        pygame.draw.polygon(layer, (*colour, round(255.0 * opacity)), np.asarray(fine) - low)
        self._fine.blit(layer, low)

    def line(self, points: Points, colour: Colour, width: float = 1.5) -> None:
        """Draw a line through ``points`` with round joints and ends."""
        fine = _fine(points)
        thickness = round(width * _FINENESS)
        if len(fine) > 1:
            pygame.draw.lines(self._fine, colour, False, fine, thickness)
        if thickness > 2:
            for point in fine:
                pygame.draw.circle(self._fine, colour, point, 0.5 * thickness)

    def dashes(self, start: Point, end: Point, colour: Colour, width: float = 1.5, dash: float = 6.0) -> None:
        """Draw a dashed straight line, dash and gap ``dash`` pixels long."""
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        length = float(np.hypot(*(last - first)))
        along = (last - first) / max(length, 1e-9)
        for place in np.arange(0.0, length, 2.0 * dash):
            stop = min(place + dash, length)
            self.line(np.stack([first + along * place, first + along * stop]), colour, width)

    def circle(self, centre: Point, radius: float, colour: Colour, *, edge: Colour | None = None) -> None:
        """Fill a circle."""
        middle = (centre[0] * _FINENESS, centre[1] * _FINENESS)
        pygame.draw.circle(self._fine, edge or colour, middle, radius * _FINENESS)
        if edge is not None:
            pygame.draw.circle(self._fine, colour, middle, (radius - 1.0) * _FINENESS)

    def arc(self, centre: Point, radius: float, angles: tuple[float, float], colour: Colour, width: float) -> None:
        """Draw an arc between two angles, rad from the right, counter-clockwise."""
        angle = np.linspace(*angles, max(2, round(abs(angles[1] - angles[0]) * 20.0)))
        x, y = centre[0] + radius * np.cos(angle), centre[1] - radius * np.sin(angle)
        self.line(np.stack([x, y], axis=1), colour, width)

    def text(
        self,
        text: str,
        place: Point,
        *,
        size: int = 12,
        colour: Colour = INK,
        anchor: Anchor = "midleft",
        bold: bool = False,
    ) -> float:
        """Write ``text`` with its ``anchor`` at ``place``; return its width."""
        # Hyphens stand before numbers only.
        image = _font(size, bold).render(text.replace("-", "−"), True, colour)
        fine = (round(place[0] * _FINENESS), round(place[1] * _FINENESS))
        self._fine.blit(image, image.get_rect(**{anchor: fine}))
        return image.get_width() / _FINENESS


def text_width(text: str, size: int = 12, bold: bool = False) -> float:
    """Width of a text, pixels."""
    return _font(size, bold).size(text)[0] / _FINENESS


def _rect(box: Box) -> pygame.Rect:
    left, top, width, height = (round(value * _FINENESS) for value in box)
    return pygame.Rect(left, top, width, height)


def _fine(points: Points) -> list[tuple[float, float]]:
    return [(float(x) * _FINENESS, float(y) * _FINENESS) for x, y in points]
