"""Results of an experiment with drives: figures of merit, demands on the winch, histories; and their files."""

from __future__ import annotations

import csv
import io
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from agents.drives.functions import Drive
from agents.policy import FloatArray
from train.shared.run_folder import write_json, write_text

HEADINGS = ("drive", "Ω1, m² s", "Ω2, m", "RMS, m", "amplitude, m", "evals", "s")


@dataclass(frozen=True)
class SummaryRow:
    """A row of summary.json."""

    drive: str
    """"still", "spline" or "harmonic"."""
    objective: str | None
    """"omega1", "omega2", or None with the drum still."""
    omega1: float
    """m² s."""
    omega2: float
    """m."""
    rms: float
    """m."""
    amplitude: float
    """Greatest distance of the load from h, m."""
    evaluations: int
    """Number of evaluations of the objective."""
    seconds: float
    """Wall-clock time of the search."""

    @property
    def label(self) -> str:
        """The paper's name for it, as in S-Ω1."""
        return "drum still" if self.objective is None else f"{self.drive[0].upper()}-Ω{self.objective[-1]}"

    @property
    def cells(self) -> tuple[str, ...]:
        """The row as text, under ``HEADINGS``."""
        return (
            self.label,
            f"{self.omega1:.3g}",
            f"{self.omega2:.3g}",
            f"{self.rms:.3g}",
            f"{self.amplitude:.3g}",
            f"{self.evaluations:,}",
            f"{self.seconds:.2f}",
        )


@dataclass(frozen=True)
class Transfer:
    """Result of a drive in the full model."""

    times: FloatArray
    """s."""
    error: FloatArray
    """x_L3 - h at ``times``, m."""

    @property
    def omega1(self) -> float:
        """Ω1, m² s."""
        return float(np.trapezoid(self.error**2, self.times))

    @property
    def amplitude(self) -> float:
        """Greatest distance of the load from h, m. The frame's sag under the load is part of it."""
        return float(np.abs(self.error).max())

    @property
    def swing(self) -> float:
        """Half the distance from the load's lowest to its highest place, m: the sag is no part of it."""
        return 0.5 * float(np.ptp(self.error))


@dataclass(frozen=True)
class Result:
    """A row, its drive, and the load's motion."""

    row: SummaryRow
    drive: Drive | None
    error: FloatArray
    """x_L3 - h at the inner steps, m."""
    full: Transfer | None = None
    """Result in the full model, if that was asked for."""


@dataclass(frozen=True)
class Experiment:
    """The still drum and every drive asked for, on one scenario."""

    times: FloatArray
    """Times of the histories, s."""
    needed: FloatArray
    """Drum angle at ``times`` that would hold a load without inertia at h, rad."""
    results: tuple[Result, ...]
    """The drum still first."""


@dataclass(frozen=True)
class Demand:
    """Demand of a drive on the winch; the optimisation itself puts no limits on it."""

    speed: float
    """Greatest drum speed, rad/s."""
    acceleration: float
    """Greatest drum acceleration once under way, rad/s²."""
    start_speed: float
    """Drum speed at the start, rad/s."""


def demand(drive: Drive, times: FloatArray) -> Demand:
    """Demand of ``drive`` on the winch, sampled at ``times`` (T,) s."""
    speed = drive.speed(times)
    acceleration = np.gradient(speed, times)
    return Demand(float(np.abs(speed).max()), float(np.abs(acceleration).max()), float(speed[0]))


def write_results(folder: Path, experiment: Experiment, free_start: bool) -> None:
    """Write summary.json, summary.csv, drives.json (decision variables) and histories.csv.

    With a ``free_start`` the first decision variable is φ_H⁰ or A_0.
    """
    times, results = experiment.times, experiment.results
    rows = [
        asdict(result.row)
        | (
            {}
            if result.full is None
            else {
                "omega1_rfem": result.full.omega1,
                "amplitude_rfem": result.full.amplitude,
                "swing_rfem": result.full.swing,
            }
        )
        for result in results
    ]
    write_json(folder / "summary.json", rows)
    text = io.StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write_text(folder / "summary.csv", text.getvalue())
    found = [
        {
            "drive": result.row.drive,
            "objective": result.row.objective,
            "duration": result.drive.duration,
            "free_start": free_start,
            "variables": result.drive.variables.tolist(),
        }
        for result in results
        if result.drive is not None
    ]
    write_json(folder / "drives.json", found)
    columns, names = [times], ["time_s"]
    for result in results:
        label = result.row.label.replace(" ", "_")
        columns.append(result.error)
        names.append(f"{label}_depth_error_m")
        if result.drive is not None:
            columns += [result.drive.angle(times), result.drive.speed(times)]
            names += [f"{label}_drum_angle_rad", f"{label}_drum_speed_rad_s"]
    stride = max(1, round(0.05 / (times[1] - times[0])))
    lines = [",".join(names)]
    lines += [",".join(f"{value:.9g}" for value in line) for line in np.stack(columns, axis=1)[::stride]]
    write_text(folder / "histories.csv", "\n".join(lines) + "\n")
