"""Rigid servomotors whose length changes as prescribed: the b(t) of C q = b(t), eqs. (28)–(30)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aframe_env.dynamics.motion import smooth_ramp
from aframe_env.rfem.beam import Array
from aframe_env.validation import require_number


@dataclass(frozen=True, kw_only=True)
class Stroke:
    """Prescribed change s(t) of a rigid servomotor's length, longer is positive.

    The frame is linear about the luffing angle that it was built with: a stroke turns its rfes by small rotations, it
    does not carry the reference configuration along. That holds while no rfe turns by more than 0.05 rad (a
    ``SmallRotationWarning`` says when one does): for the reference crane strokes of some 0.13 m, where S is 15 mm
    outside its circle about the feet. To luff further, build the crane anew with another ``Frame.luffing_angle``.
    """

    change: Callable[[float], float]
    """s(t), m."""
    rate: Callable[[float], float]
    """ṡ(t), m/s; continuous."""
    acceleration: Callable[[float], float]
    """s̈(t), m/s²."""

    @classmethod
    def smooth(cls, change: float, duration: float) -> Stroke:
        """Stroke from rest to ``change``, m, in ``duration``, s, along the quintic smoothstep."""
        require_number("change", change, "m")
        require_number("duration", duration, "s", low=0.0, low_open=True)

        def derivative(order: int) -> Callable[[float], float]:
            return lambda time: change * smooth_ramp(time, 1.0 / duration, 0.0)[order]

        return cls(change=derivative(0), rate=derivative(1), acceleration=derivative(2))


def strokes_at(strokes: tuple[Stroke, Stroke] | None, times: Array) -> Array:
    """s, ṡ, s̈ of S_R and S_L at ``times``, (k,), s: (3, k, 2); zeros for None."""
    if strokes is None:
        return np.zeros((3, times.size, 2))
    columns = [
        [[float(law(time)) for time in times.tolist()] for law in (item.change, item.rate, item.acceleration)]
        for item in strokes
    ]
    return np.moveaxis(np.array(columns), 0, 2)
