"""A vessel: its motion in regular waves, from a table of response amplitude operators."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env.scenario.long_waves import long_wave_remark
from aframe_env.text import read_csv
from aframe_env.validation import InvalidValue, ResponseTableWarning, require_vector

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

COLUMNS = (
    "omega_rad_s",
    "heading_deg",
    *(f"{dof}_{part}" for dof in ("surge", "sway", "heave", "roll", "pitch", "yaw") for part in ("amp", "phase")),
)

DIED_OUT: Final = 0.05
"""Surge, sway and heave [m/m] of a ship that short waves leave alone."""
FALL: Final = 1.25
"""Where a response that has not died out is nothing, in last frequencies of its table."""

# Ship axes (x forward, y to port) to the deck's (x aft, y to starboard): half a turn about z.
_TO_DECK = np.array([-1.0, -1.0, 1.0, -1.0, -1.0, 1.0])
# The mirror image in the centreplane.
_MIRROR = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])


@dataclass(frozen=True, eq=False, kw_only=True)
class Vessel:
    """Motion response of a ship in regular waves.

    Ship axes: x forward, y to port, z up, origin midships on the waterline. A wave with the elevation
    Re(a exp(iωt)) at the reference point, travelling towards heading β (from the bow towards port: 0 following sea,
    π head sea), moves the reference point by Re(a response exp(iωt)).
    """

    name: str
    frequencies: FloatArray = field(repr=False)
    """(F,) rad/s, rising."""
    headings: FloatArray = field(repr=False)
    """(D,) rad, rising from 0 to 2π."""
    response: ComplexArray = field(repr=False)
    """(F, D, 6) surge, sway, heave [m/m], roll, pitch, yaw [rad/m] of the reference point."""
    reference_point: tuple[float, float, float]
    """m, in ship axes."""
    deck_position: tuple[float, float, float] = (-40.0, 0.0, 5.0)
    """Origin of the deck frame {D}, midway between the A-frame's feet, m, in ship axes: at the stern."""
    path: Path | None = None
    """The file that it was read from, if it was."""

    def __post_init__(self) -> None:
        require_vector("reference_point", self.reference_point, "m", low=-1e4, high=1e4)
        require_vector("deck_position", self.deck_position, "m", low=-1e4, high=1e4)
        shape = (len(self.frequencies), len(self.headings), 6)
        if self.response.shape != shape:
            raise InvalidValue(f"response of shape {self.response.shape}: must be {shape}")

    @classmethod
    def from_csv(cls, path: str | Path, *, deck_position: tuple[float, float, float] | None = None) -> Vessel:
        """Read a vessel from a CSV file.

        Comment lines start with ``#``; ``# title: NAME`` and ``# reference_point_m: x, y, z`` are read (the origin,
        where the latter is missing). Then the columns ``omega_rad_s, heading_deg, surge_amp, surge_phase, ...,
        yaw_amp, yaw_phase``: amplitudes in m/m and rad/m, phases (lead) in rad, conventions as above. Every
        combination of frequency and heading must be there; headings from 0 to 180° (the rest is then the mirror
        image) or all around, from wherever, at steps of 45° at the most.
        """
        path = Path(path)
        name, reference = path.stem, (0.0, 0.0, 0.0)
        rows: list[list[float]] = []
        header_seen = False
        for number, cells in read_csv(path, "vessel"):
            where = f"{path}, line {number}"
            if cells[0].startswith("#"):
                key, _, value = cells[0][1:].partition(":")
                if key.strip() == "title":
                    name = value.strip()
                elif key.strip() == "reference_point_m":
                    point = [_number(item, where, "reference_point_m") for item in value.split(",")]
                    if len(point) != 3:
                        raise InvalidValue(f"{where}: reference_point_m: must be three numbers in m")
                    reference = (point[0], point[1], point[2])
            elif not header_seen:
                if tuple(cells) != COLUMNS:
                    raise InvalidValue(f"{where}: the columns must be {','.join(COLUMNS)}")
                header_seen = True
            else:
                if len(cells) != len(COLUMNS):
                    raise InvalidValue(f"{where}: {len(cells)} columns: must be {len(COLUMNS)}")
                row = [_number(cell, where, column) for cell, column in zip(cells, COLUMNS, strict=True)]
                _check_row(row, where)
                rows.append(row)
        if not rows:
            raise InvalidValue(f"vessel {str(path)!r}: has no data")
        frequencies, headings, response = _grid(np.array(rows), path)
        vessel = cls(
            name=name,
            frequencies=frequencies,
            headings=headings,
            response=response,
            reference_point=reference,
            path=path,
        )
        return vessel if deck_position is None else replace(vessel, deck_position=deck_position)

    @classmethod
    def supply(cls) -> Vessel:
        """Return the default vessel: an 83 m supply ship, computed by ``train.vessel``."""
        return _supply()

    def response_at(self, position: tuple[float, float, float]) -> ComplexArray:
        """Response (F, D, 6) of another point of the ship [m, in ship axes], for small angles.

        The wave's elevation stays that at the reference point.
        """
        lever = np.asarray(position) - np.asarray(self.reference_point)
        moved = self.response.copy()
        moved[..., :3] += np.cross(self.response[..., 3:], lever)
        return moved

    @cached_property
    def deck_response(self) -> ComplexArray:
        """Response (F, D, 6) of the deck frame {D}: x aft, y to starboard, z up."""
        return np.ascontiguousarray(self.response_at(self.deck_position) * _TO_DECK)

    @cached_property
    def dies_out(self) -> bool:
        """Whether the ship hardly moves any more (5 % of the wave) at the table's highest frequency."""
        return bool(np.abs(self.response[-1, :, :3]).max() < DIED_OUT)

    @cached_property
    def deck_table(self) -> tuple[FloatArray, ComplexArray]:
        """Frequencies (F,) and ``deck_response`` (F, D, 6) to look up, of which both ends are held.

        A table that ends before the response has died out goes on to nothing, a quarter above its last frequency.
        """
        if self.dies_out:
            return self.frequencies, self.deck_response
        nothing = np.zeros((1, *self.deck_response.shape[1:]), dtype=np.complex128)
        frequencies = np.append(self.frequencies, FALL * self.frequencies[-1])
        return frequencies, np.concatenate([self.deck_response, nothing])


@cache
def _supply() -> Vessel:
    return Vessel.from_csv(Path(str(files("aframe_env") / "data" / "supply_vessel.csv")))


def _number(text: str, where: str, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise InvalidValue(f"{where}: {name} = {text.strip()!r}: must be a number") from None
    if not math.isfinite(value):
        raise InvalidValue(f"{where}: {name} = {text.strip()!r}: must be finite")
    return value


def _check_row(row: list[float], where: str) -> None:
    if row[0] <= 0.0:
        raise InvalidValue(f"{where}: omega_rad_s = {row[0]:g} rad/s: must be above 0")
    if not -360.0 <= row[1] <= 360.0:
        raise InvalidValue(f"{where}: heading_deg = {row[1]:g}°: must be in [-360, 360]")
    for column, value in zip(COLUMNS[2::2], row[2::2], strict=True):
        if value < 0.0:
            raise InvalidValue(f"{where}: {column} = {value:g}: must not be negative")


def _grid(rows: FloatArray, path: Path) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Frequencies, headings over the full circle, response, from the rows of a file."""
    frequencies, degrees = np.unique(rows[:, 0]), np.unique(rows[:, 1])
    if len(frequencies) < 2:
        raise InvalidValue(f"{path}: {len(frequencies)} frequency: must be at least 2")
    place = np.searchsorted(frequencies, rows[:, 0]) * len(degrees) + np.searchsorted(degrees, rows[:, 1])
    times = np.bincount(place, minlength=len(frequencies) * len(degrees))
    if (times != 1).any():
        first = int(np.flatnonzero(times != 1)[0])
        omega, heading = frequencies[first // len(degrees)], degrees[first % len(degrees)]
        there = "is missing" if times[first] == 0 else f"is there {times[first]} times"
        raise InvalidValue(
            f"{path}: the row of {omega:g} rad/s and {heading:g}° {there}: each of the {len(frequencies)} frequencies "
            f"must be there once with each of the {len(degrees)} headings"
        )
    ordered = rows[np.argsort(place)].reshape(len(frequencies), len(degrees), -1)
    amplitudes, phases = ordered[:, :, 2::2], ordered[:, :, 3::2]
    circle, response = _circle(degrees, amplitudes * np.exp(1j * phases), path)
    remark = long_wave_remark(frequencies, np.radians(degrees), amplitudes, phases)
    if remark:
        warnings.warn(
            f"{path}: in the longest wave, {frequencies[0]:g} rad/s, {remark}. A wave that is long for the ship "
            "carries it along: see 'A vessel's response' in docs/scenario-files.md",
            ResponseTableWarning,
            stacklevel=3,
        )
    return frequencies, np.radians(circle), np.ascontiguousarray(response)


def _circle(degrees: FloatArray, response: ComplexArray, path: Path) -> tuple[FloatArray, ComplexArray]:
    """Headings [deg] from 0 to 360, and the response there, from those of a file in [-360, 360]."""
    first, last = float(degrees[0]), float(degrees[-1])
    around = degrees % 360.0
    order = np.argsort(around, kind="stable")
    around, response = around[order], response[:, order]
    same = np.flatnonzero(np.diff(around) == 0.0)
    for k in same:
        apart = np.abs(response[:, k] - response[:, k + 1])
        if (apart > 0.01 * np.abs(response).max(axis=(0, 1))).any():
            raise InvalidValue(f"{path}: two responses at the one heading of {around[k]:g}°: must agree")
    around, response = np.delete(around, same + 1), np.delete(response, same + 1, axis=1)
    if last - first == 180.0 and first % 180.0 == 0.0:
        # Half a circle from the bow to the stern, on either side.
        mirrored = (-around) % 360.0
        new = ~np.isin(mirrored, around)
        around = np.concatenate([around, mirrored[new]])
        order = np.argsort(around)
        around, response = around[order], np.concatenate([response, response[:, new] * _MIRROR], axis=1)[:, order]
    if around[0] > 0.0:
        # Across the bow between the last heading and the first, as between any two.
        share = around[0] / (around[0] + 360.0 - around[-1])
        ahead = (1.0 - share) * response[:, :1] + share * response[:, -1:]
        around, response = np.concatenate([[0.0], around]), np.concatenate([ahead, response], axis=1)
        gap = around[1] + 360.0 - around[-1]
    else:
        gap = 360.0 - around[-1]
    widest = max(gap, float(np.diff(around).max(initial=0.0)))
    if widest > 45.0:
        raise InvalidValue(
            f"{path}: headings from {first:g} to {last:g}° leave {widest:g}° open: must go from 0 to 180°, or around, "
            "at steps of 45° at the most"
        )
    return np.concatenate([around, [360.0]]), np.concatenate([response, response[:, :1]], axis=1)
