"""Colours of the pictures."""

from __future__ import annotations

Colour = tuple[int, int, int]

PAGE: Colour = (233, 238, 242)
CARD: Colour = (255, 255, 255)
EDGE: Colour = (205, 214, 222)
INK: Colour = (28, 43, 57)
FADED: Colour = (104, 120, 135)
GRID: Colour = (226, 232, 237)

SKY_TOP: Colour = (142, 190, 222)
SKY_LOW: Colour = (238, 243, 242)
FAR_WATER: Colour = (98, 160, 184)
NEAR_WATER: Colour = (26, 104, 140)
DEEP_WATER: Colour = (8, 38, 62)
GROUND: Colour = (92, 78, 60)
FOAM: Colour = (205, 230, 238)

HULL: Colour = (30, 58, 88)
BOTTOM: Colour = (158, 62, 48)
DECK: Colour = (122, 142, 132)
HOUSE: Colour = (244, 244, 240)
HOUSE_SHADE: Colour = (206, 213, 217)
WINDOW: Colour = (52, 84, 110)
STEEL: Colour = (245, 184, 46)
STEEL_SHADE: Colour = (196, 139, 24)
MACHINE: Colour = (62, 74, 88)
CHROME: Colour = (190, 200, 208)

ROPE: Colour = (250, 246, 232)
ROPE_EDGE: Colour = (52, 58, 64)
LOAD: Colour = (240, 126, 48)
LOAD_SHADE: Colour = (190, 88, 24)
TARGET: Colour = (120, 226, 148)
TARGET_IN_AIR: Colour = (16, 118, 62)
HIGH_AIR: Colour = (52, 98, 138)
LOW_AIR: Colour = (108, 146, 172)
ERROR: Colour = (214, 84, 32)
HEAVE: Colour = (150, 192, 218)
WARNING: Colour = (208, 36, 48)
GOOD: Colour = (32, 140, 84)
