"""A recorded ship motion: read from CSV, checked, and resampled for the engine.

The file: ``#`` starts a comment line; the first other line is the header, which names seven columns with
their units, in any order, as in ``time_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg``; then one line
of numbers for each sample. Units: time in s or ms; surge, sway and heave in m, cm, mm or ft; roll, pitch and
yaw in rad or deg. Axes and angles are those of ``motion``: x outboard, z up, ZYX Euler angles of the deck
frame.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import scipy

from aframe_env.memory import require_memory
from aframe_env.scenario.motion import COORDINATES, FloatArray
from aframe_env.text import read_csv
from aframe_env.validation import InvalidValue, RecordNoiseWarning, require_number

_LENGTHS: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048}
_ANGLES: Final = {"rad": 1.0, "deg": math.pi / 180.0}
_UNITS: Final = {
    "time": {"s": 1.0, "ms": 0.001},
    **dict.fromkeys(COORDINATES[:3], _LENGTHS),
    **dict.fromkeys(COORDINATES[3:], _ANGLES),
}
_EXAMPLE: Final = "time_s,surge_m,sway_m,heave_m,roll_deg,pitch_deg,yaw_deg"

MIN_SAMPLES: Final = 12
"""Fewest samples of a record: twice what one quintic piece of the spline rests on."""
GAP: Final = 1.5
"""A time step longer than this many medians is a gap."""
ORDER: Final = 10
"""Of the differences that noise is told by; a record has more samples."""
NOISE_GAIN: Final = 3.9
"""Acceleration of a quintic spline through white noise of deviation 1 at steps of 1, root mean square."""
ARM: Final = 10.0
"""What angular accelerations are weighed by, m: about the pulley's distance from the deck's origin."""
NOTABLE: Final = 0.25
"""Acceleration of noise in parts of the ship's own that is worth a warning."""
LEAST: Final = 0.05
"""And in m/s²."""
ROUNDING: Final = 1e-9
"""What a time may lie beyond the end, s."""
MAX_LINES: Final = 20_000_000
"""Most lines of a motion's table: three weeks at 10 Hz, some 2.7 GiB."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedMotion:
    """Motion of the deck frame that somebody measured or computed elsewhere, on its own times.

    Between the samples it is the quintic spline through them, so that position, velocity and acceleration are
    all smooth. For a component of amplitude A and frequency ω, sampled every T, the spline errs by up to
    about A (ωT)⁶/14000 away from the record's ends: 2e-5 A with 8 samples a period, 2e-7 A with 17. A record
    that is finer than the environment's steps is not filtered: the spline goes through every sample, and
    noise in the record becomes motion of the ship. Smooth such a record first.

    Raises ``InvalidValue`` for a record with a gap, a NaN, times that do not increase, or fewer than
    ``MIN_SAMPLES`` samples.
    """

    times: FloatArray = field(repr=False)
    """(T,) s, increasing, in nearly equal steps; the first is where an episode starts."""
    coordinates: FloatArray = field(repr=False)
    """(T, 6): surge, sway, heave, m; roll, pitch, yaw, rad. Jumps of roll and yaw by 2π are taken out."""
    path: Path | None = None
    """The file that it was read from, if it was."""

    def __post_init__(self) -> None:
        source = "record" if self.path is None else str(self.path)
        times = np.array(self.times, dtype=np.float64)
        coordinates = np.array(self.coordinates, dtype=np.float64)
        if times.ndim != 1 or coordinates.shape != (len(times), 6):
            raise InvalidValue(
                f"{source}: times of shape {times.shape} and coordinates of shape {coordinates.shape}: "
                "must be (T,) and (T, 6)"
            )
        _check(times, coordinates, [f"{source}, sample {i}" for i in range(len(times))], source)
        times -= times[0]
        for angle in (3, 5):
            coordinates[:, angle] = np.unwrap(coordinates[:, angle])
        times.setflags(write=False)
        coordinates.setflags(write=False)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "coordinates", coordinates)
        noise = _noise(times, coordinates)
        object.__setattr__(self, "_spline", _spline(times, coordinates, noise))
        self._warn_of(noise)

    def _warn_of(self, noise: FloatArray) -> None:
        """Warn where the noise (6,) m, rad of the samples is a notable part of the accelerations."""
        step = float(np.median(np.diff(self.times)))
        between = np.concatenate([self.times, 0.5 * (self.times[1:] + self.times[:-1])])
        arms = np.repeat([1.0, ARM], 3)
        false = arms * NOISE_GAIN * noise / step**2
        whole = arms * np.sqrt(np.mean(self.at(between)[2] ** 2, axis=0))
        own = math.sqrt(max(np.sum(whole**2) - np.sum(false**2), 0.0))
        sum_of_false = math.sqrt(np.sum(false**2))
        if sum_of_false > max(NOTABLE * own, LEAST):
            worst = int(np.argmax(false))
            unit = "m" if worst < 3 else "rad"
            warnings.warn(
                f"{self.origin}: rounding or noise of its samples, {step:.3g} s apart, is {sum_of_false:.2g} m/s² of "
                f"acceleration beside {own:.2g} m/s² of the ship's own, most of it by {COORDINATES[worst]} "
                f"({noise[worst]:.2g} {unit}): smooth the record, or log it finer",
                RecordNoiseWarning,
                stacklevel=4,
            )

    @classmethod
    def from_csv(cls, path: str | Path) -> RecordedMotion:
        """Read a record from a CSV file (see the module's docstring). Errors name file and line."""
        times, coordinates, lines = _read(Path(path))
        _check(times, coordinates, [f"{path}, line {line}" for line in lines], str(path))
        return cls(times=times, coordinates=coordinates, path=Path(path))

    @property
    def origin(self) -> str:
        """Words for the record, in messages."""
        return "the recorded motion" if self.path is None else str(self.path)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.times[-1])

    def at(self, times: npt.ArrayLike) -> FloatArray:
        """Coordinates, rates and accelerations at ``times`` (T,) s from the first sample: array (3, T, 6).

        Times are in [0, ``duration``].
        """
        t = np.atleast_1d(np.asarray(times, dtype=np.float64))
        for extreme in (t.min(), t.max()) if t.size else ():
            require_number("time", float(extreme), "s", low=0.0, high=self.duration + ROUNDING)
        spline: scipy.interpolate.BSpline = self._spline  # type: ignore[attr-defined]
        return np.stack([spline(t), spline(t, nu=1), spline(t, nu=2)])

    def table(self, period: float) -> FloatArray:
        """Coordinates, rates and accelerations at 0, ``period``, ... up to ``duration``: (T, 18)."""
        return np.concatenate(list(self.at(grid(self.duration, period))), axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedWindow:
    """A stretch of a record: what the ship did from ``start`` on, ``duration`` s long.

    Raises ``InvalidValue`` where the record does not reach so far.
    """

    record: RecordedMotion
    start: float
    """s from the record's first sample."""
    duration: float
    """s."""

    def __post_init__(self) -> None:
        longest = self.record.duration
        require_number("start", self.start, "s", low=0.0, high=longest)
        left = longest - self.start
        require_number("duration", self.duration, "s", low=0.0, high=left + ROUNDING, low_open=True)

    @property
    def origin(self) -> str:
        """Words for the window, in messages."""
        return f"the window of {self.record.origin}"

    def at(self, times: npt.ArrayLike) -> FloatArray:
        """Coordinates, rates and accelerations at ``times`` (T,) s from the window's start: array (3, T, 6)."""
        return self.record.at(self.start + np.atleast_1d(np.asarray(times, dtype=np.float64)))

    def table(self, period: float) -> FloatArray:
        """Coordinates, rates and accelerations at 0, ``period``, ... up to ``duration``: (T, 18)."""
        return np.concatenate(list(self.at(grid(self.duration, period))), axis=1)


def _noise(times: FloatArray, coordinates: FloatArray) -> FloatArray:
    """Standard deviation (6,) of the part of each coordinate that no motion has which the samples are fine enough for.

    By divided differences of an order that leaves little of a motion with four samples a period or more.
    """
    count = len(times) - ORDER
    scaled = times / np.median(np.diff(times))
    weights = np.ones((ORDER + 1, count))
    for i in range(ORDER + 1):
        for j in range(ORDER + 1):
            if i != j:
                weights[i] /= scaled[i : i + count] - scaled[j : j + count]
    weights /= np.sqrt(np.sum(weights**2, axis=0))
    differences = sum(weights[i][:, None] * coordinates[i : i + count] for i in range(ORDER + 1))
    return np.asarray(np.sqrt(np.mean(np.square(differences), axis=0)))


def _spline(times: FloatArray, coordinates: FloatArray, noise: FloatArray) -> scipy.interpolate.BSpline:
    """The quintic spline through the samples.

    At the ends, where noise turns a spline most, a coordinate has rate and acceleration of the polynomial that follows
    its samples there within their noise (6,), where there is one.
    """
    spline = scipy.interpolate.make_interp_spline(times, coordinates, k=5)
    start, end = (np.stack([spline(times[k], nu=1), spline(times[k], nu=2)]) for k in (0, -1))
    fitted = False  # Unless a coordinate is, the spline stays as it is, to the bit.
    for dof in range(6):
        for derivatives, time, value, way in (
            (start, times - times[0], coordinates[:, dof], 1.0),
            (end, times[-1] - times[::-1], coordinates[::-1, dof], -1.0),
        ):
            fit = _smooth_end(time, value, float(noise[dof]))
            if fit is not None:
                derivatives[:, dof] = way * fit[0], fit[1]
                fitted = True
    if not fitted:
        return spline
    ends = [[(1, each[0]), (2, each[1])] for each in (start, end)]
    # The stubs know conditions by name alone.
    fitted_spline: scipy.interpolate.BSpline = scipy.interpolate.make_interp_spline(
        times,
        coordinates,
        k=5,
        bc_type=ends,  # type: ignore[call-overload]
    )
    return fitted_spline


def _smooth_end(times: FloatArray, values: FloatArray, noise: float) -> tuple[float, float] | None:
    """Rate and acceleration at time 0 of the quintic that follows the first values (T,) longest within their noise."""
    found = None
    count = MIN_SAMPLES
    while noise > 0.0 and count <= len(times):
        x = times[:count] / times[count - 1]
        powers = np.vander(x, 6, increasing=True)
        coefficients = np.linalg.lstsq(powers, values[:count], rcond=None)[0]
        left = np.sum((powers @ coefficients - values[:count]) ** 2) / (count - 6)
        # Within two standard errors of a variance from so many samples.
        if left > noise**2 * (1.0 + 2.0 * math.sqrt(2.0 / (count - 6))):
            break
        found = float(coefficients[1] / times[count - 1]), float(2.0 * coefficients[2] / times[count - 1] ** 2)
        count = count * 3 // 2
    return found


def grid(duration: float, period: float) -> FloatArray:
    """Times 0, ``period``, ... up to ``duration`` (T,) s."""
    require_number("period", period, "s", low=0.0, high=1e6, low_open=True)
    if duration / period >= MAX_LINES:
        raise InvalidValue(
            f"{duration:g} s of recorded motion at steps of {period:g} s take {duration / period * 18 * 8 / 2**30:.3g} "
            f"GiB: must be at most {MAX_LINES * period:g} s; take a stretch with start and duration, or mend the unit "
            "of time"
        )
    # A duration that is a whole number of periods up to rounding has its last line too.
    count = math.floor(duration / period + 1e-6) + 1
    # The table, and what it is put together from.
    require_memory(f"{duration:g} s of recorded motion at steps of {period:g} s", 2 * count * 18 * 8)
    return np.asarray(np.minimum(np.arange(count) * period, duration))


def _check(times: FloatArray, coordinates: FloatArray, places: list[str], source: str) -> None:
    """Raise at the first sample that cannot be part of a motion. ``places`` names each sample."""
    for index, place in enumerate(places):
        if not math.isfinite(times[index]):
            raise InvalidValue(f"{place}: time = {times[index]} s: must be finite")
        bad = np.flatnonzero(~np.isfinite(coordinates[index]))
        if len(bad):
            name = COORDINATES[bad[0]]
            unit = "m" if bad[0] < 3 else "rad"
            raise InvalidValue(f"{place}: {name} = {coordinates[index, bad[0]]} {unit}: must be finite")
    if len(times) < MIN_SAMPLES:
        raise InvalidValue(f"{places[-1] if places else source}: {len(times)} samples: must be at least {MIN_SAMPLES}")
    steps = np.diff(times)
    backwards = np.flatnonzero(steps <= 0.0)
    if len(backwards):
        i = int(backwards[0])
        raise InvalidValue(
            f"{places[i + 1]}: time = {times[i + 1]:g} s after {times[i]:g} s: must increase line by line"
        )
    median = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * median)
    if len(gaps):
        i = int(gaps[0])
        raise InvalidValue(
            f"{places[i + 1]}: a gap of {steps[i]:g} s after time = {times[i]:g} s: a step must be in "
            f"(0, {GAP * median:g}] s, {GAP:g} times the median step"
        )


def _read(path: Path) -> tuple[FloatArray, FloatArray, list[int]]:
    """Times (T,) s, coordinates (T, 6) in m and rad, and the lines they stand on."""
    columns: list[tuple[int, float]] | None = None
    rows: list[list[float]] = []
    lines: list[int] = []
    for number, cells in read_csv(path, "record"):
        if cells[0].startswith("#"):
            continue
        if columns is None:
            columns = _header(cells, f"{path}, line {number}")
            continue
        if len(cells) != len(columns):
            raise InvalidValue(f"{path}, line {number}: {len(cells)} columns: must be {len(columns)}, as in the header")
        rows.append([_number(cells[place], scale, f"{path}, line {number}") for place, scale in columns])
        lines.append(number)
    if columns is None:
        raise InvalidValue(f"{path}: no header: must begin with a line like {_EXAMPLE}")
    values = np.array(rows, dtype=np.float64).reshape(-1, 7)
    return values[:, 0], values[:, 1:], lines


def _header(cells: list[str], place: str) -> list[tuple[int, float]]:
    """Column and scale to SI of time and of each coordinate."""
    found: dict[str, tuple[int, float]] = {}
    for column, cell in enumerate(cells):
        name, _, unit = cell.lower().rpartition("_")
        units = _UNITS.get(name)
        if units is None:
            raise InvalidValue(f"{place}: column {cell!r}: must be like {_EXAMPLE}")
        if unit not in units:
            raise InvalidValue(f"{place}: column {cell!r}: the unit of {name} must be one of {', '.join(units)}")
        if name in found:
            raise InvalidValue(f"{place}: column {name!r} occurs twice")
        found[name] = (column, units[unit])
    missing = [name for name in _UNITS if name not in found]
    if missing:
        raise InvalidValue(f"{place}: column {missing[0]!r} is missing: must be like {_EXAMPLE}")
    return [found[name] for name in _UNITS]


def _number(cell: str, scale: float, place: str) -> float:
    try:
        return float(cell) * scale
    except ValueError:
        raise InvalidValue(f"{place}: {cell!r} is not a number") from None
