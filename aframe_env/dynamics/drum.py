"""What a winch can do beside its rated speed and acceleration: power, torque, and the layers of rope on its drum.

All three are taken at the start of a motion segment and hold over it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.compiling import fma, larger, scalar, smaller
from aframe_env.dynamics.layout import Span
from aframe_env.dynamics.start import radius_of_layer

Array = npt.NDArray[np.float64]

_radius_of_layer = scalar(radius_of_layer)


@scalar
def wind_layers(row: Array, lanes: int, j: int) -> None:
    """Take up the radius of the layer that lane j's rope runs off; the rope paid out stays what it is."""
    height = row[at.LAYER * lanes + j]
    if height > 0.0:
        angle, radius = row[at.DRUM_ANGLE * lanes + j], row[at.DRUM_RADIUS * lanes + j]
        length = fma(radius, angle, row[at.FREE_LENGTH * lanes + j])
        new = _radius_of_layer(
            length,
            height,
            row[(at.LAYER + 1) * lanes + j],
            row[(at.LAYER + 2) * lanes + j],
            row[(at.LAYER + 3) * lanes + j],
        )
        if new != radius:
            row[at.FREE_LENGTH * lanes + j] = length - new * angle
            row[at.DRUM_RADIUS * lanes + j] = new
            row[at.MIN_ANGLE * lanes + j] = angle + (row[at.LENGTH_LIMITS * lanes + j] - length) / new
            row[at.MAX_ANGLE * lanes + j] = angle + (row[(at.LENGTH_LIMITS + 1) * lanes + j] - length) / new


@scalar
def limit_drum(row: Array, span: Span) -> None:
    """Limit command and acceleration by power and torque at the present tension.

    A drum whose load overcomes its torque is turned by it: it pays out, however it is told to turn.
    """
    lanes = span.stride
    for j in range(span.begin, span.end):
        wind_layers(row, lanes, j)
        moment = row[at.TENSION * lanes + j] * row[at.DRUM_RADIUS * lanes + j]
        command, power = row[at.COMMAND * lanes + j], row[at.MAX_POWER * lanes + j]
        if power > 0.0:
            fastest = power / larger(moment, power / row[at.MAX_SPEED * lanes + j])
            command = smaller(larger(command, -fastest), fastest)
        torque, rated = row[at.MAX_TORQUE * lanes + j], row[at.RATED_ACCELERATION * lanes + j]
        if torque > 0.0:
            inertia = row[at.DRUM_INERTIA * lanes + j]
            speed = row[at.DRUM_SPEED * lanes + j]
            if moment > torque:
                # Nothing but the rated acceleration holds a drum that is overcome.
                command = row[at.MAX_SPEED * lanes + j]
                available = (moment - torque) / inertia
            elif command < speed:
                available = (torque - moment) / inertia
            else:
                available = (torque + moment) / inertia
            row[at.MAX_ACCELERATION * lanes + j] = larger(smaller(available, rated), LEAST_SHARE * rated)
        row[at.COMMAND * lanes + j] = command


LEAST_SHARE = 1e-6
"""Least acceleration of a drum at its torque's limit, in rated ones: it does not divide by nought."""
