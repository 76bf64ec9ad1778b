"""A frame that luffs during an episode: its angle in time, by the common stroke of its servomotors."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics.layout import LUFFING_MOST
from aframe_env.dynamics.luffing import leg_of_stroke, pulley_of_stroke
from aframe_env.scenario.crane import Crane, Frame
from aframe_env.validation import InvalidValue, require_number, require_vector, shown

FloatArray = npt.NDArray[np.float64]

STEEPEST: Final = math.radians(80.0)
"""Greatest luffing angle to either side, rad: at 90° the servomotors are at their dead points."""
PEAK_SPEED: Final = 1.875
"""Peak speed of the quintic smoothstep, over its mean."""
PEAK_ACCELERATION: Final = 10.0 / math.sqrt(3.0)
"""Peak acceleration of the quintic smoothstep, over way by time squared."""


class Swing(NamedTuple):
    """A luffing frame at N times."""

    angle: FloatArray
    """Luffing angle, rad: (N,)."""
    angle_rate: FloatArray
    """rad/s: (N,)."""
    angle_acceleration: FloatArray
    """rad/s²: (N,)."""
    pulley: FloatArray
    """Pulley S along {D}, m: (N, 3)."""
    pulley_velocity: FloatArray
    """m/s: (N, 3)."""
    pulley_acceleration: FloatArray
    """m/s²: (N, 3)."""


@dataclass(frozen=True, kw_only=True)
class Luffing:
    """Way of a luffing frame: from point to point the servomotors' stroke follows a quintic smoothstep.

    Before the first point the frame holds at the first angle, after the last at the last.
    """

    points: tuple[tuple[float, float], ...]
    """Time [s] and luffing angle [rad] of each point; the first angle is the frame's ``luffing_angle``."""
    max_speed: float = 0.15
    """Greatest speed of the servomotors, m/s."""
    max_acceleration: float = 0.1
    """Greatest acceleration of the servomotors, m/s²."""

    def __post_init__(self) -> None:
        require_number("max_speed", self.max_speed, "m/s", low=1e-4, high=10.0)
        require_number("max_acceleration", self.max_acceleration, "m/s²", low=1e-4, high=100.0)
        if not isinstance(self.points, tuple) or not 2 <= len(self.points) <= LUFFING_MOST:
            raise InvalidValue(f"points = {shown(self.points)}: must be a tuple of 2 to {LUFFING_MOST} points")
        earliest = 0.0
        for index, point in enumerate(self.points):
            require_vector(f"points[{index}]", point, "s and rad", size=2)
            require_number(f"points[{index}] time", point[0], "s", low=earliest, high=1e6)
            require_number(f"points[{index}] angle", point[1], "rad", low=-STEEPEST, high=STEEPEST)
            earliest = point[0] + 0.1

    @classmethod
    def swing(cls, start_angle: float, end_angle: float, begin: float, duration: float, **limits: float) -> Luffing:
        """Return one swing from an angle to another [rad] from ``begin`` s on, in ``duration`` s.

        ``limits``: ``max_speed`` and ``max_acceleration``.
        """
        require_number("duration", duration, "s", low=0.1, high=1e6)
        return cls(points=((begin, start_angle), (begin + duration, end_angle)), **limits)

    @property
    def duration(self) -> float:
        """Time at which the frame has come to rest, s."""
        return self.points[-1][0]

    @property
    def holds(self) -> bool:
        """Whether it keeps its first angle."""
        return len({angle for _, angle in self.points}) == 1

    def require_rigid_servomotors(self, frame: Frame) -> None:
        """Raise where the servomotors are elastic, with which the full model cannot luff."""
        elastic = frame.structure.servomotor.stiffness
        if elastic is not None:
            raise InvalidValue(
                f"servomotor.stiffness = {elastic!r} N/m: must be None, rigid, with luffing, as only rigid ones have a "
                "given length"
            )

    def strokes(self, frame: Frame) -> list[tuple[float, float]]:
        """Time [s] and length of the servomotors [m] at each point."""
        return [(time, replace(frame, luffing_angle=angle).servomotor_length) for time, angle in self.points]

    def cranes(self, crane: Crane) -> list[Crane]:
        """The ``crane`` at every point, upright where the frame passes that, and where the pulley is nearest the drum.

        Between these angles the pulley's height and its distance from the drum rise or fall.
        """
        angles = [angle for _, angle in self.points]
        x, _, z = crane.drum_position
        in_line = math.atan2(x, z) if x or z else 0.0
        opposite = in_line - math.copysign(math.pi, in_line)
        angles += [angle for angle in (0.0, in_line, opposite) if min(angles) < angle < max(angles)]
        return [replace(crane, frame=replace(crane.frame, luffing_angle=angle)) for angle in angles]

    def require_frame(self, crane: Crane) -> None:
        """Raise where the way does not begin at the frame's angle, or is beyond what crane and servomotors can do."""
        frame, first = crane.frame, self.points[0][1]
        if abs(first - frame.luffing_angle) > 1e-6:
            raise InvalidValue(
                f"points[0] angle = {first!r} rad: must be {frame.luffing_angle!r} rad, the frame's luffing_angle"
            )
        try:
            self.cranes(crane)
            strokes = self.strokes(frame)
        except InvalidValue as error:
            raise InvalidValue(f"luffing: on its way {error}") from None
        for leg, ((begin, before), (end, after)) in enumerate(itertools.pairwise(strokes)):
            change, duration = abs(after - before), end - begin
            for what, peak, limit, unit in (
                ("speed", PEAK_SPEED * change / duration, self.max_speed, "m/s"),
                ("acceleration", PEAK_ACCELERATION * change / duration**2, self.max_acceleration, "m/s²"),
            ):
                if peak > limit:
                    raise InvalidValue(
                        f"leg from points[{leg}] to points[{leg + 1}], {begin:g} s to {end:g} s: the servomotors go "
                        f"{change:.3g} m with a peak {what} of {peak:.3g} {unit}: must be at most {limit:g} {unit}"
                    )

    def at(self, frame: Frame, times: npt.ArrayLike) -> Swing:
        """The ``frame`` at ``times`` (N,) s, with the arithmetic of the kernels."""
        strokes = self.strokes(frame)
        geometry = frame.servomotor_height, frame.servomotor_deck_x, frame.height
        found = np.empty((np.size(times), 3, 3))
        for index, time in enumerate(np.ravel(times).astype(np.float64).tolist()):
            legs = [leg_of_stroke(time, a, b, to - at) for (a, at), (b, to) in itertools.pairwise(strokes)]
            length, speed, acceleration = (sum(parts) for parts in zip(*legs, strict=True))
            found[index] = pulley_of_stroke(strokes[0][1] + length, speed, acceleration, *geometry)
        place, velocity, acceleration = found.transpose(1, 0, 2)
        x, z = place[:, 0], place[:, 2]
        square = frame.height**2
        rate = (z * velocity[:, 0] - x * velocity[:, 2]) / square
        bend = (z * acceleration[:, 0] - x * acceleration[:, 2]) / square
        return Swing(np.arctan2(x, z), rate, bend, place, velocity, acceleration)
