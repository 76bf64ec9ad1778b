"""Memory layout of a row: the slots of the engine's array.

The engine's array has shape (blocks, slots(components) * lanes): rows in blocks, each quantity contiguous over a
block's lanes. An index `slot * lanes + lane` with constant slot and lanes shows the compiler that no two
quantities overlap, and so it vectorises the loop over lanes. All float64, SI.
"""

from __future__ import annotations

from itertools import count
from typing import Final, NamedTuple

LANES: Final = 64
"""Rows in a block."""
SPRINGS_MOST: Final = 10
"""Most springs of a rope with mass: one more than it has lumps."""
CURRENT_MOST: Final = 8
"""Most depths at which a current is given."""
PROFILE_MOST: Final = 16
"""Most corners of a target's path in time."""
LUFFING_MOST: Final = 16
"""Most points of a luffing frame's way in time."""


class Span(NamedTuple):
    """Lanes of a block to go through."""

    stride: int
    """Lanes in the block."""
    begin: int
    end: int


_next = count().__next__


def _take(size: int) -> int:
    first = _next()
    for _ in range(size - 1):
        _next()
    return first


# State.
STEP: Final = _take(1)
"""Motion segments since the start."""
TIME: Final = _take(1)
LIFT: Final = _take(2 * SPRINGS_MOST)
"""Load and lumps of a rope with mass, from below: how far they are below the pulley, m, and how fast they go down, m/s,
both along the line from pulley to load. The load's position and velocity follow."""
LOAD_POSITION: Final = _take(3)
LOAD_VELOCITY: Final = _take(3)
STROKE: Final = _take(1)
"""Rope that a passive compensator has paid out, m."""
DRUM_ANGLE: Final = _take(1)
DRUM_SPEED: Final = _take(1)
INTEGRAL: Final = _take(1)
"""Integral part of a drive's speed loop: torque at the drum, N m."""
FILTERED: Final = _take(1)
"""Tension as a drive's filter has it, N."""
SET_ANGLE: Final = _take(1)
"""Angle of a drum that goes as it is told within its limits, from the real one's at the segment's start, rad."""
SET_SPEED: Final = _take(1)
"""Its speed: what a drive's loop wants, rad/s."""
BRAKED: Final = _take(1)
"""1 where a drive's brake has fallen."""
DRIVE_TORQUE: Final = _take(1)
"""Torque of a drive at the drum, N m; positive pays out."""
DRIVE_POWER: Final = _take(1)
"""Power that its motors give, W; negative where the load drives them."""
COMMAND: Final = _take(1)
PULLEY: Final = _take(9)
"""Pulley S in the base frame: position, velocity, acceleration."""
NODE_STEP: Final = _take(1)
"""Motion segments from the start to the next node of the deck's motion."""
NODE: Final = _take(18)
"""Deck at the next node: six coordinates, their rates, their accelerations."""
NODE_PULLEY: Final = _take(9)
"""Pulley at the next node: position, velocity, acceleration."""
NODE_BEFORE: Final = _take(18)
"""Deck at the node before."""
PATH: Final = _take(18)
"""Quintic through the pulley's path from node to node: coefficients 0..5 for each axis (axis-major)."""
OMEGA1: Final = _take(1)
OMEGA2: Final = _take(1)
STEP_COST: Final = _take(1)
"""Integral of (x_L3 - h)² over the last control step."""
TENSION: Final = _take(1)
PEAK_TENSION: Final = _take(1)
"""Greatest tension within the last control step."""
SLACK: Final = _take(1)
"""1 where the rope was slack within the last control step."""
CHARGED: Final = _take(1)
"""1 once the task has charged a parted row for the rest of its episode."""
PARTED: Final = _take(1)
"""1 from the moment at which the tension passed the breaking load."""
LOAD_TENSION: Final = _take(1)
"""Tension of a rope with mass at the load; TENSION is that at the pulley."""
ON_BED: Final = _take(1)
"""1 while the load is on the seabed."""
CONTACT: Final = _take(1)
"""Greatest force of the seabed on the load within the last control step, N."""
LANDINGS: Final = _take(1)
"""Times that the load has come down on the seabed."""
LIFT_OFFS: Final = _take(1)
"""Times that it has left it again."""
LANDING_SPEED: Final = _take(1)
"""Greatest speed with which it has come down, m/s."""
TARGET_RATE: Final = _take(1)
"""Velocity of the target, m/s."""
TIP: Final = _take(9)
"""Pulley S along the deck's axes {D} at the next node: position, velocity, acceleration; at rest unless the frame
luffs."""
REACH: Final = _take(3)
"""\\|SH\\| at the next node, its rate and its acceleration: DRUM_TO_PULLEY, 0 and 0 unless the frame luffs."""
REACH_PATH: Final = _take(6)
"""Quintic through \\|SH\\| from node to node: coefficients 0..5."""
LUFFING_ANGLE: Final = _take(1)
"""Luffing angle of the frame, rad."""

# Parameters.
MASS: Final = _take(1)
GRAVITY: Final = _take(1)
TARGET: Final = _take(1)
AXIAL_STIFFNESS: Final = _take(1)
ROPE_DAMPING: Final = _take(1)
BREAKING_LOAD: Final = _take(1)
FREE_LENGTH: Final = _take(1)
"""Unstretched length between drum and load at drum angle 0; l_0, unless the rope runs off another layer by now."""
START_LENGTH: Final = _take(1)
"""l_0: unstretched length between drum and load at the start."""
DRUM_TO_PULLEY: Final = _take(1)
"""\\|SH\\| at the start, m."""
DRUM_RADIUS: Final = _take(1)
MAX_SPEED: Final = _take(1)
MAX_ACCELERATION: Final = _take(1)
LAG: Final = _take(1)
MIN_ANGLE: Final = _take(1)
MAX_ANGLE: Final = _take(1)
PULLEY_ON_DECK: Final = _take(3)
"""Pulley S along the deck's axes {D} at the start, the frame rigid, m."""
DRUM_ON_DECK: Final = _take(3)
"""Drum H along {D}, m."""
LUFFING_POINTS: Final = _take(1)
"""Points of the frame's way in time; 0 where it holds its angle."""
LUFFING: Final = _take(2 * LUFFING_MOST)
"""Their times, s, then the lengths of the servomotors there, m; LUFFING_MOST slots for each."""
LUFFING_FRAME: Final = _take(3)
"""Servomotor's height on the leg, its end's x on the deck, height of the frame, m."""
RAMP_RATE: Final = _take(1)
RAMP_OFFSET: Final = _take(1)
CONTROL_PERIOD: Final = _take(1)
"""Length of one motion segment (a control step, or an equal part of a long one)."""
NODE_SEGMENTS: Final = _take(1)
"""Motion segments from node to node."""
SUBSTEPS: Final = _take(1)
INNER_STEP: Final = _take(1)
"""CONTROL_PERIOD / SUBSTEPS."""
HALF_STEP_DECAY: Final = _take(1)
"""exp(-h / (2 lag)): decay of the winch's speed error over half an inner step; 0 without lag."""
RECORD: Final = _take(1)
"""First line of the row's recorded motion in the engine's table, or -1."""
RECORD_LENGTH: Final = _take(1)
YAW_START: Final = _take(1)
"""Yaw that the ramp builds up the yaw about: a record's first, which may be a compass heading; else 0."""
SPRINGS: Final = _take(1)
"""Springs of the rope, one more than it has lumps; 0 for the paper's rope, which has no mass, in air."""
ROPE_MASS: Final = _take(1)
"""kg/m."""
ROPE_WEIGHT: Final = _take(1)
"""N/m, less buoyancy."""
ROPE_DRAG: Final = _take(1)
"""Tension that a metre of rope takes up at 1 m/s along itself, N s²/m³."""
LOSS_TIME: Final = _take(1)
"""Time constant of the rope's material damping, s."""
DRUM_PART: Final = _take(1)
"""Unstretched length of the rope between drum and pulley, m."""
HALF_WEIGHT: Final = _take(1)
"""Half the weight of a rope without lumps, which adds to the tension at the pulley, N; else 0."""
LOAD_INERTIA: Final = _take(2)
"""Mass and added mass of the load, horizontally and vertically, and a third of a rope without lumps, kg."""
LOAD_WEIGHT: Final = _take(1)
"""Weight of the load less buoyancy, and half of a rope without lumps, N."""
LOAD_DRAG: Final = _take(2)
"""Drag of the load at 1 m/s, horizontally and vertically, N s²/m²."""
ACROSS_DRAG: Final = _take(1)
"""Drag of a metre of rope at 1 m/s across itself, N s²/m³."""
CURRENT_POINTS: Final = _take(1)
"""Levels at which the current is given; 0 for none."""
CURRENT: Final = _take(3 * CURRENT_MOST)
"""Levels, m, from above, then the current's x and then its y there, m/s; CURRENT_MOST slots for each."""
SURFACE_LEVEL: Final = _take(1)
"""Mean level of the sea's surface, m."""
WAVES: Final = _take(1)
"""Wave components that move the water about the load; 0 for none."""
START_SHARE: Final = _take(1)
"""Share of the load that is under water at rest; LOAD_WEIGHT is the weight there."""
BUOYANCY: Final = _take(1)
"""Weight of the water that the load displaces, all of it under water, N."""
DISPLACED: Final = _take(1)
"""Mass of that water, kg."""
ADDED_MASS: Final = _take(2)
"""Added mass of the load under water, horizontally and vertically, kg; LOAD_INERTIA has it."""
HALF_HEIGHT: Final = _take(1)
"""Half the height of the load, m."""
INVERSE_HEIGHT: Final = _take(1)
"""One over the height, 1/m; 0 where it has none, and counts as under water wherever it is."""
SLAM: Final = _take(2)
"""Force of the surface on the load at 1 m/s, when it enters and when it leaves the water, N s²/m²."""
BED: Final = _take(3)
"""Seabed: level [m], stiffness [N/m], damping [N s/m]; without one it is infinitely deep."""
LEVEL: Final = _take(1)
"""Target at the start, m."""
CORNERS: Final = _take(1)
"""Corners of the target's path; 0 where it holds."""
CORNER_TIME: Final = _take(1)
"""Time that the target takes round a corner, s."""
PROFILE: Final = _take(2 * PROFILE_MOST)
"""Times of the corners, s, then by how much the target's velocity changes there, m/s; PROFILE_MOST slots for each."""
RATED_ACCELERATION: Final = _take(1)
"""Drum's acceleration limit apart from torque, rad/s²; MAX_ACCELERATION is the one in force over a segment."""
MAX_POWER: Final = _take(1)
"""W; 0 for no limit."""
MAX_TORQUE: Final = _take(1)
"""N m; 0 for no limit."""
DRUM_INERTIA: Final = _take(1)
"""kg m²."""
LAYER: Final = _take(4)
"""Rope layers on the drum: height [m], turns in each, radius of the innermost [m], all the rope there is [m]; height 0
where the radius does not change."""
LENGTH_LIMITS: Final = _take(2)
"""Least and greatest unstretched length between drum and load, m."""
SHEAVE_FRICTION: Final = _take(1)
"""Share by which the tensions on both sides of the turning pulley differ."""
GAS: Final = _take(4)
"""Passive compensator: force of its gas at mid-stroke [N], length of its gas column [m], exponent, damping [N s/m]."""
HALF_STROKE: Final = _take(1)
"""Half the stroke of a passive compensator, m of rope; 0 for none."""
DRIVE: Final = _take(1)
"""Inertia of a drum that a drive turns, kg m²; 0 where the drum goes as it is told."""
GAIN: Final = _take(1)
"""Torque that the speed loop asks for by 1 rad/s of error, N m s."""
INTEGRAL_RATE: Final = _take(1)
"""One over the time constant of its integral part, 1/s."""
FEEDFORWARD: Final = _take(1)
"""Share of the measured tension that the loop is relieved of."""
FILTER_RATE: Final = _take(1)
"""One over the time constant of the tension's filter, 1/s; 0 for none."""
MOTOR: Final = _take(2)
"""Greatest torque of the motors, at the drum without the gear's losses [N m], and their greatest power [W]."""
GEAR: Final = _take(3)
"""Torque at the drum over that of the motors: mean of both ways, half their difference, and the drum's speed at which
70 % of that have built up [rad/s]."""
BRAKE: Final = _take(1)
"""Torque up to which the brake holds, N m; 0 for none."""

# Scratch of one control step.
DUE: Final = _take(1)
"""1 where the row has come to its node."""
ELAPSED: Final = _take(1)
"""Time from the node before to the start of the segment."""
WINCH: Final = _take(7)
"""Plan of the winch: direction, ramp time, start of decay, first decaying half step, error, start angle, speed."""
INVERSE_MASS: Final = _take(1)
STIFFNESS: Final = _take(1)
"""c_R of the rope at the start of the inner step."""
STEP_LENGTH: Final = _take(1)
"""Length of the inner step; 0 where the row stands still."""
LIFT_SIZE: Final = 2 * SPRINGS_MOST + 11
"""Slots from LIFT to the drive's filter."""
LIFT_A: Final = _take(LIFT_SIZE)
"""Nodes and load as in LIFT at a stage of the Runge-Kutta scheme."""
LIFT_B: Final = _take(LIFT_SIZE)
"""The same at the stage after."""
LIFT_SUM: Final = _take(LIFT_SIZE)
"""Weighted sum of the stages' rates."""
END_SIZE: Final = 16
ENDS: Final = _take(3 * END_SIZE)
"""Upper end of the rope at the start, middle and end of the inner step: the pulley's position, velocity and
acceleration, unstretched length between drum and load, its rate, the target's level, \\|SH\\| with its rate, and the
rope that goes over the pulley as a flexible frame comes nearer to the drum, part of the length, with its rate."""
FLOW: Final = _take(3)
"""Velocity of the water about the load at the start of a segment, m/s."""
FLOW_RATE: Final = _take(3)
"""Its acceleration over the segment, m/s²."""
SURFACE: Final = _take(2)
"""Level of the surface about the load at the start of a segment, m, and its rate, m/s."""
WANTED: Final = _take(3)
"""Speed that a drive's loop wants at start, middle and end of the inner step, rad/s."""
MOMENT: Final = _take(1)
"""Time since the start of the segment at which the water about the load is taken, s."""
PUSH: Final = _take(6)
"""What the drag of water across the rope hands on to the load over a segment, and to the pulley, N."""
STAGE: Final = _take(16)
"""What is kept of the stages of an inner step, see ``lift``."""

ROW_SLOTS: Final = _next()

# Wave components follow, COMPONENT_SLOTS for each.
PHASE_RE: Final = 0
PHASE_IM: Final = 1
TURN_RE: Final = 2
TURN_IM: Final = 3
FREQUENCY: Final = 4
RESPONSE: Final = 5
"""Six complex amplitudes: real parts at RESPONSE + dof, imaginary parts at RESPONSE + 6 + dof."""
ELEVATION_RE: Final = 17
ELEVATION_IM: Final = 18
"""Complex amplitude of the sea's elevation under the pulley at rest, m; where the water moves about the load."""
TOWARDS_X: Final = 19
TOWARDS_Y: Final = 20
"""Direction that the wave travels in, on the deck's axes."""
COMPONENT_SLOTS: Final = 21
UNROLL: Final = 4
"""Wave components are summed this many at a time; a row has room for a multiple of it."""


def padded(components: int) -> int:
    """Room that ``components`` wave components need: the next multiple of UNROLL."""
    return -(-components // UNROLL) * UNROLL


def slots(components: int) -> int:
    """Slots of a row with room for ``components`` wave components, a multiple of UNROLL."""
    return ROW_SLOTS + COMPONENT_SLOTS * components
