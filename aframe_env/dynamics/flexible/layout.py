"""Memory layout of the flexible frame: slots of a row, and places in the constants of a frame.

Rows are stored as in ``aframe_env.dynamics.layout``, in an array of their own: (blocks, slots(modes) * lanes). The
constants of a frame are one line of a table, (frames, size): the head, then MODE_SIZE numbers for each mode, then the
carried matrix, then, where the damping couples the modes, the matrices of the step, then the numbers of a frame that
luffs (``swing``). All float64, SI.
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
ELASTIC: Final = 10
"""Its elastic part, which goes along a cubic from step to step; the rest goes along straight lines; 3."""
GROWTH: Final = 13
"""Rate of the elastic part, 3."""

# Scratch.
COORDINATES: Final = 16
"""Quintics of the deck's six coordinates over the segment, 36 coefficients (coordinate-major)."""
ROTATION: Final = 52
"""{D} → base frame, 9, row-major."""
ORIGIN: Final = 61
"""Origin of {D} in the base frame: position and velocity, 6."""
SPIN: Final = 67
"""Angular velocity of {D}, along {D}, 3."""
INPUT: Final = 70
"""Deck's motion as the frame feels it: field (gravity less acceleration, 3) and W = α× + Ω×Ω× (9), in {D}."""
CARRIED: Final = 82
"""W_cd η_b + 2 Ω×_cd η̇_b of the carried modes b: 9 for each of at most CARRIED_MOST."""
CARRIED_MOST: Final = 8
TIP: Final = CARRIED + 9 * CARRIED_MOST
"""Displacement of S and its rate at the end of the step but for the coming pull of the rope, 6."""
ACTIVE: Final = TIP + 6
"""1 where the row takes part in the inner step that is under way."""
HELD: Final = ACTIVE + 1
"""Load and lumps of a rope with mass at the start of the inner step, as in LIFT of ``aframe_env.dynamics.layout``."""
PULLEY: Final = HELD + LIFT_SIZE
"""Pulley S along the axes that all vectors here are along, the frame undeformed, 3, m."""
LEAN: Final = PULLEY + 3
"""Cosine and sine of the angle by which these axes have luffed from {D}; 1 and 0 where the frame holds. They are those
of a deck that has turned with the frame since the luffing angle of its line in the tables."""
DRUM_RATE: Final = LEAN + 2
"""Velocity of the drum along these axes, 3, m/s."""
REACHED: Final = DRUM_RATE + 3
"""What luffing has added to |SH| of the undeformed frame, m, and its rate."""
SLOPE: Final = REACHED + 2
"""τ: tangent of the angle by which the servomotors have turned in the frame since that luffing angle."""
TURNED: Final = SLOPE + 1
"""Forces of S_R and S_L across their line at that luffing angle, N, and the strokes along it, m; 2 each."""
MODES: Final = TURNED + 4
"""MODE_SLOTS for each mode from here on."""
POSITION: Final = 0
RATE: Final = 1
FORCE: Final = 2
"""What the deck's motion does to the mode, N/√kg."""
RIGHT: Final = 3
"""The same at the end of the step (scratch)."""
NEXT: Final = 4
"""Place and rate at the end of a coupled step (scratch), 2."""
MODE_SLOTS: Final = 6

# The table of a frame: its head.
COUNT: Final = 0
"""Modes."""
CARRIED_COUNT: Final = 1
COUPLED: Final = 2
"""1 where the damping couples the modes."""
STEP: Final = 3
"""h, s."""
GIVE: Final = 4
"""Displacement of S at the step's end by the rope's force there: by its elastic part [m/N], by the rate of that [m s/N]
and by the rest [m/N]; 9 each."""
GIVE_RATE: Final = 31
"""Rate of S in the same way, 9 each."""
REST: Final = 58
"""Displacement of S at rest for a unit force there, 9, m/N."""
SWING: Final = 67
"""Where the numbers of a frame that luffs begin in its line; 0 where it holds."""
HEAD: Final = 68
# Of each mode.
SQUARE: Final = 0
"""ω², 1/s²."""
DAMPING: Final = 1
"""ΦᵀLΦ, 1/s."""
FREE: Final = 2
"""Place at the step's end by place and rate at its start, rate by the same, 4."""
LINEAR: Final = 6
"""Place by a force at the start and at the end of the step that goes along a straight line, rate by the same, 4."""
CUBIC: Final = 10
"""Place by a force at the start and by its rate there, which goes along a cubic, rate by the same, 4."""
SHAPE: Final = 14
"""Displacement of S, 3."""
RESPONSE: Final = 17
"""Place by the rope's force at the step's end (elastic part, its rate, the rest; 3 each), rate by the same, 18."""
FIELD: Final = 35
"""Force for a unit INPUT, 12 (inertial terms with their minus)."""
MODE_SIZE: Final = 47
# Matrices of a coupled step: place, then rate, by the modes' places, rates, forces at the start and at the end, and by
# the rope's elastic force at the start and its rate.
MATRICES: Final = 6

# Of a frame that luffs, from SWING on: two neighbours in luffing angle, up and down.
NEIGHBOUR: Final = 0
"""Their lines in the tables, or -1, 2."""
HALFWAY: Final = 2
"""Sines of the angles by which the axes have luffed where a row goes over to them, 2."""
PASSAGE: Final = 4
"""Where in the line the matrices begin that take the modes there, 2."""
OWN_PULLEY: Final = 6
"""PULLEY of this line, 3."""
LOADED: Final = 9
"""What is sensed of the servomotors, the reactions of S_R and S_L and the displacements across them, by INPUT and PULL
beside what the modes tell: 15 each."""
FEED: Final = 69
"""The same by TURNED, 4 × 4."""
FELT: Final = 85
"""What the modes tell at the step's end by the rope's force there, 3 each."""
LOOP: Final = 97
"""All that is sensed at the step's end by TURNED there, 4 × 4."""
SERVOMOTORS: Final = 113
"""Of each mode, TURNED_SIZE: what its place tells, 4, its place and rate by TURNED at the step's end, 4 each, and what
of its place is TURNED's at once, 4. By symmetry the numbers that its place tells are those of TURNED's force on it."""
TURNED_SIZE: Final = 16


def slots(modes: int) -> int:
    """Slots of a row with room for ``modes`` modes."""
    return MODES + MODE_SLOTS * modes
