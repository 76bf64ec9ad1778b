"""The moving deck as the frame feels it: pose, spin, and the field of acceleration along its own axes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import scalar
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.motion import advance_motion, meet_node, on_quintic, quintic, second_derivative
from aframe_env.dynamics.transforms import turn

Block = npt.NDArray[np.float64]


@scalar
def advance_deck(row: Block, frame: Block, components: int, records: Block, lanes: int) -> None:
    """Advance the deck by one segment, which ends at a node, and lay quintics through its six coordinates over it."""
    advance_motion(row, components, records, Span(lanes, 0, lanes))
    meet_node(row, Span(lanes, 0, lanes))
    for dof in range(6):
        for j in range(lanes):
            coefficients = quintic(
                row[(at.NODE_BEFORE + dof) * lanes + j],
                row[(at.NODE_BEFORE + 6 + dof) * lanes + j],
                row[(at.NODE_BEFORE + 12 + dof) * lanes + j],
                row[(at.NODE + dof) * lanes + j],
                row[(at.NODE + 6 + dof) * lanes + j],
                row[(at.NODE + 12 + dof) * lanes + j],
                row[at.CONTROL_PERIOD * lanes + j],
            )
            for k in range(6):
                frame[(flex.COORDINATES + 6 * dof + k) * lanes + j] = coefficients[k]


@scalar
def coordinate_at(frame: Block, dof: int, elapsed: float, lanes: int, j: int) -> tuple[float, float, float]:
    """Coordinate ``dof`` of the deck, its rate and acceleration, ``elapsed`` s into the segment."""
    c = flex.COORDINATES + 6 * dof
    c2, c3 = frame[(c + 2) * lanes + j], frame[(c + 3) * lanes + j]
    c4, c5 = frame[(c + 4) * lanes + j], frame[(c + 5) * lanes + j]
    place, rate = on_quintic(frame[c * lanes + j], frame[(c + 1) * lanes + j], c2, c3, c4, c5, elapsed)
    return place, rate, second_derivative(c2, c3, c4, c5, elapsed)


@scalar
def write_pose(
    row: Block,
    frame: Block,
    lanes: int,
    j: int,
    surge: tuple[float, float, float],
    sway: tuple[float, float, float],
    heave: tuple[float, float, float],
    roll: tuple[float, float, float],
    pitch: tuple[float, float, float],
    yaw: tuple[float, float, float],
) -> None:
    """Write lane j's pose and INPUT, from the deck's coordinates (each with its rate and acceleration)."""
    turned, spin, spin_up = turn(roll[0], pitch[0], yaw[0], roll[1], pitch[1], yaw[1], roll[2], pitch[2], yaw[2])
    for k in range(9):
        frame[(flex.ROTATION + k) * lanes + j] = turned[k]
    frame[flex.ORIGIN * lanes + j] = surge[0]
    frame[(flex.ORIGIN + 1) * lanes + j] = sway[0]
    frame[(flex.ORIGIN + 2) * lanes + j] = heave[0]
    frame[(flex.ORIGIN + 3) * lanes + j] = surge[1]
    frame[(flex.ORIGIN + 4) * lanes + j] = sway[1]
    frame[(flex.ORIGIN + 5) * lanes + j] = heave[1]
    fx, fy, fz = -surge[2], -sway[2], -row[at.GRAVITY * lanes + j] - heave[2]
    for k in range(3):
        frame[(flex.INPUT + k) * lanes + j] = turned[k] * fx + turned[3 + k] * fy + turned[6 + k] * fz
    put_turning(frame, spin, spin_up, lanes, j)


@scalar
def put_turning(
    frame: Block, spin: tuple[float, float, float], spin_up: tuple[float, float, float], lanes: int, j: int
) -> None:
    """Write lane j's SPIN, and the part of INPUT that turns, from the angular velocity and acceleration."""
    x, y, z = spin
    a, b, c = spin_up
    frame[flex.SPIN * lanes + j] = x
    frame[(flex.SPIN + 1) * lanes + j] = y
    frame[(flex.SPIN + 2) * lanes + j] = z
    frame[(flex.INPUT + 3) * lanes + j] = -y * y - z * z
    frame[(flex.INPUT + 4) * lanes + j] = x * y - c
    frame[(flex.INPUT + 5) * lanes + j] = x * z + b
    frame[(flex.INPUT + 6) * lanes + j] = x * y + c
    frame[(flex.INPUT + 7) * lanes + j] = -x * x - z * z
    frame[(flex.INPUT + 8) * lanes + j] = y * z - a
    frame[(flex.INPUT + 9) * lanes + j] = x * z - b
    frame[(flex.INPUT + 10) * lanes + j] = y * z + a
    frame[(flex.INPUT + 11) * lanes + j] = -x * x - y * y


@scalar
def deck_at(row: Block, frame: Block, index: int, lanes: int) -> None:
    """Pose at the end of inner step ``index`` of the segment; lanes that have fewer stay at their segment's end."""
    for j in range(lanes):
        pose_lane(row, frame, elapsed_at(row, index + 1.0, lanes, j), lanes, j)


@scalar
def elapsed_at(row: Block, done: float, lanes: int, j: int) -> float:
    """Time into the segment of lane j once ``done`` inner steps have been made, or all that it has, s."""
    duration, substeps = row[at.CONTROL_PERIOD * lanes + j], row[at.SUBSTEPS * lanes + j]
    elapsed: float = duration * (done if done < substeps else substeps) / substeps
    return elapsed


@scalar
def pose_lane(row: Block, frame: Block, elapsed: float, lanes: int, j: int) -> None:
    """Pose of lane j's deck ``elapsed`` s into the segment."""
    write_pose(
        row,
        frame,
        lanes,
        j,
        coordinate_at(frame, 0, elapsed, lanes, j),
        coordinate_at(frame, 1, elapsed, lanes, j),
        coordinate_at(frame, 2, elapsed, lanes, j),
        coordinate_at(frame, 3, elapsed, lanes, j),
        coordinate_at(frame, 4, elapsed, lanes, j),
        coordinate_at(frame, 5, elapsed, lanes, j),
    )


@scalar
def deck_now(row: Block, frame: Block, lanes: int) -> None:
    """Pose from the deck's coordinates as they are in the row."""
    for j in range(lanes):
        m = at.NODE
        write_pose(
            row,
            frame,
            lanes,
            j,
            (row[m * lanes + j], row[(m + 6) * lanes + j], row[(m + 12) * lanes + j]),
            (row[(m + 1) * lanes + j], row[(m + 7) * lanes + j], row[(m + 13) * lanes + j]),
            (row[(m + 2) * lanes + j], row[(m + 8) * lanes + j], row[(m + 14) * lanes + j]),
            (row[(m + 3) * lanes + j], row[(m + 9) * lanes + j], row[(m + 15) * lanes + j]),
            (row[(m + 4) * lanes + j], row[(m + 10) * lanes + j], row[(m + 16) * lanes + j]),
            (row[(m + 5) * lanes + j], row[(m + 11) * lanes + j], row[(m + 17) * lanes + j]),
        )
