"""Release of a static load: the frame swings, undamped unless its material or servomotors damp it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from aframe_env.rfem.history import FrameHistory
from aframe_env.rfem.integrator import AverageAcceleration
from aframe_env.rfem.model import DOWN, FrameModel, frame_model
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
    scheme = AverageAcceleration(frame, output_interval / inner)

    weight = frame.weight(GRAVITY if case.own_weight else 0.0)
    load = generalised_forces(frame, point_forces(crane, case))
    basis = frame.constraints.basis
    position = solve(frame, weight + load)
    reduced_weight, reduced_load = scheme.reduce(weight), scheme.reduce(load)
    start = (position * frame.mass) @ basis
    factor = 1.0 if ramp > 0.0 else 0.0
    scheme.start(start, np.zeros_like(start), reduced_weight + factor * reduced_load)

    times = output_interval * np.arange(outputs + 1, dtype=np.float64)
    coordinates = np.zeros((outputs + 1, 2, start.size))
    factors = np.zeros(outputs + 1)
    coordinates[0, 0], factors[0] = start, factor
    for output in range(1, outputs + 1):
        for number in range(1, inner + 1):
            factor = release_factor((output - 1) * output_interval + number * scheme.step, ramp)
            scheme.predict()
            scheme.finish(scheme.solve(reduced_weight + factor * reduced_load))
        coordinates[output] = scheme.position, scheme.velocity
        factors[output] = factor
    history = coordinates @ basis.T
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
