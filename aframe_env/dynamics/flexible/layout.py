"""Memory layout of the flexible frame: slots of a row, and places in the constants of a frame.

Rows are stored as in ``aframe_env.dynamics.layout``, in an array of their own: (blocks, slots(modes) * lanes). The
constants of a frame are one line of a table, (frames, size): the head, then MODE_SIZE numbers for each mode, then the
carried matrix, then, where the damping couples the modes, the inverse of the step's matrix. All float64, SI.
"""

from __future__ import annotations

from typing import Final

from aframe_env.dynamics.layout import LIFT_SIZE

# A row's slots: parameters and state.
FRAME: Final = 0
"""Line of the row's frame in the tables."""
DRUM: Final = 1
"""Drum H in {D}, 3."""
LOAD_ACCELERATION: Final = 4
"""Acceleration of the load in the base frame, 3."""
PULL: Final = 7
"""Rope's force on the frame at S, along {D}, 3."""

# Scratch.
COORDINATES: Final = 10
"""Quintics of the deck's six coordinates over the segment, 36 coefficients (coordinate-major)."""
ROTATION: Final = 46
"""{D} → base frame, 9, row-major."""
ORIGIN: Final = 55
"""Origin of {D} in the base frame: position and velocity, 6."""
SPIN: Final = 61
"""Angular velocity of {D}, along {D}, 3."""
INPUT: Final = 64
"""Deck's motion as the frame feels it: field (gravity less acceleration, 3) and W = α× + Ω×Ω× (9), in {D}."""
CARRIED: Final = 76
"""W_cd η_b + 2 Ω×_cd η̇_b of the carried modes b: 9 for each of at most CARRIED_MOST."""
CARRIED_MOST: Final = 8
TIP: Final = CARRIED + 9 * CARRIED_MOST
"""Displacement of S and its rate at the end of the step but for the coming pull of the rope, 6."""
ACTIVE: Final = TIP + 6
"""1 where the row takes part in the inner step that is under way."""
HELD: Final = ACTIVE + 1
"""Load and lumps of a rope with mass at the start of the inner step, as in LIFT of ``aframe_env.dynamics.layout``."""
MODES: Final = HELD + LIFT_SIZE
"""MODE_SLOTS for each mode from here on."""
POSITION: Final = 0
RATE: Final = 1
ACCELERATION: Final = 2
RIGHT: Final = 3
"""Right-hand side of a coupled step (scratch)."""
MODE_SLOTS: Final = 4

# The table of a frame: its head.
COUNT: Final = 0
"""Modes."""
CARRIED_COUNT: Final = 1
COUPLED: Final = 2
"""1 where the damping couples the modes."""
STEP: Final = 3
"""h, s."""
COMPLIANCE: Final = 4
"""Displacement of S at the step's end for a unit force there at that time, 9, m/N."""
COMPLIANCE_RATE: Final = 13
"""Its rate, 9, m/(s N)."""
REST: Final = 22
"""Displacement of S at rest for a unit force there, 9, m/N."""
HEAD: Final = 31
# Of each mode.
SQUARE: Final = 0
"""ω², 1/s²."""
DAMPING: Final = 1
"""ΦᵀLΦ, 1/s; 0 where the modes are coupled."""
LATE: Final = 2
"""β h², s²."""
EARLY: Final = 3
"""(1/2 - β) h², s²."""
INVERSE: Final = 4
"""1 / (1 + h ΦᵀLΦ / 2 + β h² ω²); unused where the modes are coupled."""
SHAPE: Final = 5
"""Displacement of S, 3."""
RESPONSE: Final = 8
"""Acceleration at the step's end for a unit force at S at that time, 3."""
FIELD: Final = 11
"""Force for a unit INPUT, 12 (inertial terms with their minus)."""
MODE_SIZE: Final = 23


def slots(modes: int) -> int:
    """Slots of a row with room for ``modes`` modes."""
    return MODES + MODE_SLOTS * modes
