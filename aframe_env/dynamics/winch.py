"""The winch as an actuator: speed follows its command within limits, in closed form over a control step.

While the command is constant, the speed approaches it at the greatest acceleration a until the error is a·lag,
then exponentially. Without lag it ramps onto the command. The drum angle is the exact integral.
"""

from __future__ import annotations

import math

from aframe_env.dynamics.compiling import fma, larger, scalar, select, smaller


@scalar
def plan(
    command: float, speed: float, max_acceleration: float, lag: float, half_step: float
) -> tuple[float, float, float, float, float]:
    """Plan of a control step: direction, ramp time, error after the ramp, first decaying half step, error there.

    The error is the distance of the speed from its command [rad/s]; half steps are counted from the start.
    """
    gap = command - speed
    direction = 1.0 if gap >= 0.0 else -1.0
    gap = abs(gap)
    error = max_acceleration * lag
    error = gap if gap < error else error
    ramp_time = (gap - error) / max_acceleration
    first = math.ceil(ramp_time / half_step)
    error_there = error
    if lag > 0.0:
        error_there = error * math.exp(-(first * half_step - ramp_time) / lag)
    return direction, ramp_time, error, first, error_there


@scalar
def next_error(error: float, half_step_index: float, first: float, decay: float) -> float:
    """Speed error at the next half step, given that of the one before it."""
    return error * select(half_step_index <= first, 1.0, decay)


@scalar
def drum_state(
    elapsed: float,
    angle: float,
    speed: float,
    command: float,
    max_acceleration: float,
    lag: float,
    direction: float,
    ramp_time: float,
    error_after_ramp: float,
    error: float,
    min_angle: float,
    max_angle: float,
) -> tuple[float, float]:
    """Drum angle [rad] and speed [rad/s] ``elapsed`` s after the command was given.

    At the limit switches (least and greatest paid-out length) the brake holds the drum.
    """
    ramping = elapsed < ramp_time
    ramp = smaller(elapsed, ramp_time)
    acceleration = direction * max_acceleration
    after_ramp = fma(ramp, fma(0.5 * acceleration, ramp, speed), angle)
    settled = fma(command, elapsed - ramp, after_ramp) - direction * lag * (error_after_ramp - error)
    new_angle = select(ramping, after_ramp, settled)
    new_speed = select(ramping, fma(acceleration, ramp, speed), fma(-direction, error, command))
    new_speed = select(new_angle <= min_angle, larger(new_speed, 0.0), new_speed)
    new_speed = select(new_angle >= max_angle, smaller(new_speed, 0.0), new_speed)
    return smaller(larger(new_angle, min_angle), max_angle), new_speed


@scalar
def middle_speed(angle0: float, speed0: float, angle2: float, speed2: float, step: float) -> float:
    """Speed at the middle of a step [rad/s] from which Simpson's rule finds the drum's very turn in it.

    Where the drum's acceleration holds through the step that is its speed there; where a ramp ends inside the step,
    or the brake falls, a scheme that looked at the speed itself would miss part of the turn, and lose its order.
    """
    return fma(1.5 / step, angle2 - angle0, -0.25 * (speed0 + speed2))
