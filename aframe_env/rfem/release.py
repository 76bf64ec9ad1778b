"""Release of a static load: the frame swings, undamped unless its material or servomotors damp it.

The modes step exactly; only a ramp is made of straight lines, one a step. Modes of a period below two steps are left
out, but for their static shapes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aframe_env.rfem.exact_step import exact_step
from aframe_env.rfem.history import FrameHistory
from aframe_env.rfem.model import DOWN, FrameModel, frame_model
from aframe_env.rfem.reduction import resolved_form
from aframe_env.rfem.statics import LoadCase, generalised_forces, point_forces, solve
from aframe_env.scenario.crane import GRAVITY
from aframe_env.validation import InvalidValue, require_number

if TYPE_CHECKING:
    from aframe_env.scenario.crane import Crane


def release_factor(time: float, ramp: float) -> float:
    """Share of the load that is left at ``time`` > 0: half a cosine over ``ramp``, s; 0 at once if that is
    0."""
    if time >= ramp:
        return 0.0
    return 0.5 * (1.0 + math.cos(math.pi * time / ramp))


def release(
    crane: Crane,
    case: LoadCase,
    *,
    ramp: float = 0.0,
    duration: float = 2.0,
    step: float = 2.5e-4,
    output_interval: float = 5e-3,
    model: FrameModel | None = None,
) -> FrameHistory:
    """Release a frame at rest under ``case``: its forces and rope tension go, its own weight stays.

    Args:
        crane: The crane.
        case: The load before.
        ramp: Time over which it goes, s; 0 or more.
        duration: s, above 0.
        step: s; made a little smaller so that a whole number of them makes an output interval.
        output_interval: s.
        model: The frame's model, if it is not to be the default one.

    Warns:
        SmallRotationWarning: An rfe turns by more than 0.05 rad.
    """
    require_number("ramp", ramp, "s", low=0.0)
    require_number("duration", duration, "s", low=0.0, low_open=True)
    require_number("step", step, "s", low=0.0, low_open=True)
    require_number("output_interval", output_interval, "s", low=0.0, high=duration, low_open=True)
    frame = model or frame_model(crane.frame)
    if frame.frame != crane.frame:
        raise InvalidValue("model: must have been made of the crane's own frame")
    inner = max(1, math.ceil(output_interval / step - 1e-9))
    outputs = round(duration / output_interval)
    length = output_interval / inner
    modal = resolved_form(frame, length)
    exact = exact_step(modal, length)

    weight = frame.weight(GRAVITY if case.own_weight else 0.0)
    load = generalised_forces(frame, point_forces(crane, case))
    place, rate = modal.coordinates(solve(frame, weight + load)), np.zeros(modal.count)
    held, released = modal.shape.T @ weight, modal.shape.T @ load
    factor = 1.0 if ramp > 0.0 else 0.0

    times = output_interval * np.arange(outputs + 1, dtype=np.float64)
    coordinates = np.zeros((outputs + 1, 2, modal.count))
    factors = np.zeros(outputs + 1)
    coordinates[0, 0], factors[0] = place, factor
    for output in range(1, outputs + 1):
        for number in range(1, inner + 1):
            begin = held + factor * released
            factor = release_factor((output - 1) * output_interval + number * length, ramp)
            end = held + factor * released
            place, rate = (
                exact.times(exact.free[row, 0], place)
                + exact.times(exact.free[row, 1], rate)
                + exact.times(exact.linear[row, 0], begin)
                + exact.times(exact.linear[row, 1], end)
                for row in range(2)
            )
        coordinates[output] = place, rate
        factors[output] = factor
    history = coordinates @ modal.shape.T
    frame.warn_of_rotation(history[:, 0])
    down = frame.to_deck.T @ DOWN * (GRAVITY if case.own_weight else 0.0)
    return FrameHistory(
        model=frame,
        time=np.asarray(times),
        position=history[:, 0],
        velocity=history[:, 1],
        force=weight + np.outer(factors, load),
        field=np.broadcast_to(down, (outputs + 1, 3)),
    )
