"""Where the load shall be, in time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from aframe_env.dynamics.layout import PROFILE_MOST
from aframe_env.text import read_csv
from aframe_env.validation import InvalidValue, require_number, require_vector, shown

FASTEST = 10.0
"""Greatest speed of a target, m/s."""


@dataclass(frozen=True, kw_only=True)
class TargetPath:
    """Path of the target from the scenario's ``target_level``: straight lines in time with rounded corners.

    Before the first corner it holds at the first change, after the last at the last.
    """

    corners: tuple[tuple[float, float], ...]
    """Time [s] and change of the level since the start [m, positive up] of each corner; the first change is 0."""
    corner_time: float = 2.0
    """Time over which the velocity changes at a corner, s: a parabola about it."""

    def __post_init__(self) -> None:
        require_number("corner_time", self.corner_time, "s", low=0.01, high=1e3)
        if not isinstance(self.corners, tuple) or not 2 <= len(self.corners) <= PROFILE_MOST:
            raise InvalidValue(f"corners = {shown(self.corners)}: must be a tuple of 2 to {PROFILE_MOST} corners")
        before = None
        for index, corner in enumerate(self.corners):
            require_vector(f"corners[{index}]", corner, "s and m", size=2)
            time, change = corner
            first = 0.5 * self.corner_time if before is None else before[0] + 1e-3
            require_number(f"corners[{index}] time", time, "s", low=first, high=1e6)
            require_number(f"corners[{index}] change", change, "m", low=-1e4, high=1e4)
            if before is None and change != 0.0:
                raise InvalidValue(f"corners[0] change = {change!r} m: must be 0 m, the scenario's target_level")
            if before is not None and abs(change - before[1]) > FASTEST * (time - before[0]):
                raise InvalidValue(
                    f"corners[{index}] = {corner!r}: the target goes there at "
                    f"{abs(change - before[1]) / (time - before[0]):g} m/s: must be at most {FASTEST:g} m/s"
                )
            before = corner

    @classmethod
    def lowering(cls, change: float, speed: float, start: float = 10.0, corner_time: float = 2.0) -> TargetPath:
        """Return a path by ``change`` m (negative: down) at ``speed`` m/s from ``start`` s on."""
        require_number("change", change, "m", low=-1e4, high=1e4)
        require_number("speed", speed, "m/s", low=1e-4, high=FASTEST)
        return cls(corners=((start, 0.0), (start + abs(change) / speed, change)), corner_time=corner_time)

    @classmethod
    def from_csv(cls, path: str | Path, corner_time: float = 2.0) -> TargetPath:
        """Read a path from a CSV file with the header ``time_s,change_m`` and one line for each corner."""
        corners: list[tuple[float, float]] = []
        header_seen = False
        for number, cells in read_csv(Path(path), "target path"):
            where = f"{path}, line {number}"
            if cells[0].startswith("#"):
                continue
            if not header_seen:
                if tuple(cells) != ("time_s", "change_m"):
                    raise InvalidValue(f"{where}: the columns must be time_s,change_m")
                header_seen = True
                continue
            try:
                time, change = map(float, cells)
            except ValueError:
                raise InvalidValue(f"{where}: {','.join(cells)!r}: must be two numbers, s and m") from None
            corners.append((time, change))
        try:
            return cls(corners=tuple(corners), corner_time=corner_time)
        except InvalidValue as error:
            raise InvalidValue(f"{path}: {error}") from None

    @property
    def turns(self) -> tuple[tuple[float, float], ...]:
        """Time of each corner, s, and by how much the velocity changes there, m/s."""
        speeds = [0.0]
        for (t0, z0), (t1, z1) in zip(self.corners, self.corners[1:], strict=False):
            speeds.append((z1 - z0) / (t1 - t0))
        speeds.append(0.0)
        return tuple(
            (time, after - before)
            for (time, _), before, after in zip(self.corners, speeds[:-1], speeds[1:], strict=True)
        )

    @property
    def changes(self) -> tuple[float, float]:
        """Lowest and highest change of the level, m."""
        changes = [change for _, change in self.corners]
        return min(changes), max(changes)

    def at(self, time: float) -> tuple[float, float]:
        """Change of the level [m] and velocity [m/s] ``time`` s after the start."""
        change, rate = 0.0, 0.0
        for corner, turn in self.turns:
            rounding = min(max(time - corner + 0.5 * self.corner_time, 0.0), self.corner_time)
            straight = max(time - corner - 0.5 * self.corner_time, 0.0)
            change += turn * (0.5 * rounding**2 / self.corner_time + straight)
            rate += turn * rounding / self.corner_time
        return change, rate

    @property
    def duration(self) -> float:
        """Time at which the target has come to rest, s."""
        return self.corners[-1][0] + 0.5 * self.corner_time
