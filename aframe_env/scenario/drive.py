"""The drive of a drum with inertia: motors behind a gear, a brake, and the loop that has the drum's speed follow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from aframe_env.validation import require_number

GEAR_CREEP: Final = 0.02
"""Speed of the rope at which 70 % of the gear's friction has built up, m/s: at rest it has no sign."""


@dataclass(frozen=True, kw_only=True)
class TorqueDrive:
    """Drive of a drum whose angle is a coordinate: I φ'' = M + T d_H/2, eqs. (23), (24).

    A proportional-integral loop asks for the torque M by the commanded speed, within the winch's limits of speed and
    acceleration, less the drum's own. The defaults are for the reference crane: 100 t on a drum of 1.5 m are 0.74 MN m.
    """

    inertia: float = 4.0e4
    """I_H of all that turns, about the drum's axis, kg m². Default: 58 t of rope at 0.75 m (3 km of the default rope)
    are 3.3e4, the rest is the drum's shell and hydraulic motors behind the gear; electric motors have several times
    as much."""
    gear_ratio: float = 40.0
    """Turns of the motors for one of the drum. Default: 1,500 a minute at 3 m/s of rope."""
    motor_torque: float = 3.75e4
    """Greatest torque of all motors together, N m. Default: at the drum twice what holds 100 t."""
    motor_power: float = 4.5e6
    """Greatest power of all motors together, given or taken, W. Default: 100 t at 3 m/s are 2.9 MW; the rest is for
    waves."""
    hoisting_efficiency: float = 0.95
    """Share of the motors' power that the drum has while they turn it. Default: three planetary stages."""
    lowering_efficiency: float = 0.94
    """Share of the drum's power that the motors have while it turns them. Default: the same losses, 2 - 1/0.95."""
    brake_torque: float = 1.5e6
    """Torque at the drum up to which the brake holds, and with which it slips beyond, N m; 0 for no brake. Default:
    twice what holds 100 t. It falls once the command is 0 and the drum has come to rest."""
    bandwidth: float = 8.0
    """Frequency of the speed loop's poles, with the drum's inertia alone, rad/s; 5 to 10 for winches of this size."""
    damping_ratio: float = 1.0
    """Damping of these poles."""
    tension_feedforward: float = 0.0
    """Share of the measured tension's torque that the loop is relieved of; 0 for none: a drum that gives way to the
    load's bobbing damps it."""
    tension_filter: float = 0.1
    """Time constant of the load pin's filter, s; 0 for none."""

    def __post_init__(self) -> None:
        require_number("inertia", self.inertia, "kg m²", low=1.0, high=1e9)
        require_number("gear_ratio", self.gear_ratio, "", low=0.1, high=1e4)
        require_number("motor_torque", self.motor_torque, "N m", low=1.0, high=1e12)
        require_number("motor_power", self.motor_power, "W", low=1.0, high=1e12)
        require_number("hoisting_efficiency", self.hoisting_efficiency, "", low=0.3, high=1.0)
        require_number("lowering_efficiency", self.lowering_efficiency, "", low=0.3, high=1.0)
        require_number("brake_torque", self.brake_torque, "N m", low=1.0, high=1e12, or_zero=True)
        require_number("bandwidth", self.bandwidth, "rad/s", low=0.01, high=1e3)
        require_number("damping_ratio", self.damping_ratio, "", low=0.1, high=10.0)
        require_number("tension_feedforward", self.tension_feedforward, "", low=0.0, high=1.2)
        require_number("tension_filter", self.tension_filter, "s", low=1e-3, high=10.0, or_zero=True)

    @property
    def torque(self) -> float:
        """Greatest torque of the motors at the drum, were the gear without losses, N m."""
        return self.gear_ratio * self.motor_torque

    @property
    def gain(self) -> float:
        """Torque that the loop asks for by 1 rad/s of error, N m s."""
        return 2.0 * self.damping_ratio * self.bandwidth * self.inertia

    @property
    def integral_time(self) -> float:
        """Time constant of the loop's integral part, s."""
        return 2.0 * self.damping_ratio / self.bandwidth

    @property
    def gear(self) -> tuple[float, float]:
        """Torque at the drum over the motors' without losses: the mean of both ways, and the half by which they differ.

        While the motors turn the drum it is the mean less the half, while it turns them the mean and the half.
        """
        driven, driving = self.hoisting_efficiency, 1.0 / self.lowering_efficiency
        return 0.5 * (driving + driven), 0.5 * (driving - driven)

    def rates(self, stiffness: float, loss_time: float, radius: float) -> list[float]:
        """Rates that the inner step follows, each by what a step may be of it, 1/s.

        The drum of ``radius`` m hangs on a rope of ``stiffness`` N/m with a ``loss_time`` in s.
        """
        spring = stiffness * radius * radius / self.inertia
        over = max(self.damping_ratio**2 - 1.0, 0.0)
        loop = max(self.bandwidth * (self.damping_ratio + math.sqrt(over)), math.sqrt(self.bandwidth**2 + spring))
        friction = self.gear[1] * self.torque * radius / (GEAR_CREEP * self.inertia)
        return [
            2.0 * loop,
            spring * loss_time + self.gain / self.inertia,
            friction,
            2.0 / self.tension_filter if self.tension_filter else 0.0,
        ]
