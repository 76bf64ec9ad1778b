"""Studies that are killed again and again, and started again by the same command."""

from __future__ import annotations

import json
import shlex
import sqlite3
import time
from contextlib import closing
from dataclasses import dataclass, field
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from benchmarks.torture.processes import start
from benchmarks.torture.trial import Outcome, Trial
from train.shared.job_store import JOBS

COMMANDS: Final = {
    "train.evaluate": "--scenarios 3 --privileged 1 --policies 'output zero' 'feed-forward + feedback' "
    "'predictive control' 'H-Ω1 for each scenario' --out out",
    "train.sensitivity": "--policies 'drum still' 'feed-forward + feedback' --scenarios 2 --points 2 --samples 2 "
    "--workers 1 --out out",
    "train.optimisers": "--scenarios 0 --max-evaluations 50 --limited 1 --limited-evaluations 2 --workers 1 --out out",
    "train.tune": "--trials 4 --timesteps 2048 --scenarios 4 --out out",
    "train.tune_control": "--policies state inverse-dynamics --scenarios 2 --evaluations 8 --out out",
    "train.drives": "--drive harmonic --objective omega1 --duration 6 --max-evaluations 40 --check rfem --out out",
    "train.drive_map": "--amplitudes 1 2 --periods 8 9 --masses 4e4 5e4 --lengths 200 300 --held-out 2 --scenarios 2 "
    "--workers 1 --out out",
    "train.verify": "--folder out",
}
"""Small runs of every command that keeps its finished jobs, in the folder where they start."""
MEASURED: Final = {
    "train.optimisers": ("comparison.md", "comparison.json"),
    "train.drives": ("notes.md", "summary.csv", "summary.json"),
    "train.drive_map": ("notes.md",),
    "train.verify": ("README.md", "verification.json"),
}
"""Files with seconds in them; of JSON all else is looked at."""
_PATIENCE: Final = 1800.0
"""Seconds after which a study is no longer waited for."""


@dataclass(frozen=True)
class Whole:
    """A study that nothing befell."""

    seconds: float
    files: dict[str, Any]


@dataclass
class Killed:
    """Studies by one command."""

    module: str
    _whole: Whole | None = field(default=None, init=False)

    def attempt(self, rng: np.random.Generator, folder: Path, most: int) -> Outcome:
        """Kill a study at random moments, until it ends or was killed so often; hold its files to the true ones."""
        whole, kills, rows, lost = self._truth(), 0, 0, 0
        while True:
            process = self._start(folder)
            if kills < most:
                process.join(float(rng.uniform(0.0, 0.6 * whole.seconds)))
            if kills == most or not process.is_alive():
                break
            process.kill()
            process.join()
            kills += 1
            if (folder / "out" / JOBS).exists():  # it goes with the end of the study
                found = _rows(folder / "out" / JOBS)
                lost += max(0, rows - found)
                rows = found
        process.join(_PATIENCE)
        status = process.exitcode
        process.kill()
        process.join()
        tried = max(kills, 1)
        said = (folder / "said").read_text(encoding="utf-8")
        if "Traceback" in said or not (status == 0 or "this run is finished" in said):
            return Outcome(tried, 0, failures=(f"exit status {status}: {said[-1000:]}",))
        if lost:
            return Outcome(tried, 0, failures=(f"{lost} rows of the store lost",))
        files = contents(folder / "out", MEASURED.get(self.module, ()))
        differ = sorted(name for name in files.keys() | whole.files.keys() if files.get(name) != whole.files.get(name))
        if differ:
            return Outcome(tried, 0, failures=(f"other bytes in {', '.join(differ)}",))
        return Outcome(tried, tried)

    def _truth(self) -> Whole:
        if self._whole is None:
            with TemporaryDirectory(prefix="torture-") as name:
                folder, begin = Path(name), time.monotonic()
                process = self._start(folder)
                process.join(_PATIENCE)
                seconds = time.monotonic() - begin
                if process.exitcode != 0:
                    process.kill()
                    said = (folder / "said").read_text(encoding="utf-8")
                    raise RuntimeError(f"{self.module}: exit status {process.exitcode} unkilled: {said[-1000:]}")
                self._whole = Whole(seconds, contents(folder / "out", MEASURED.get(self.module, ())))
        return self._whole

    def _start(self, folder: Path) -> ForkServerProcess:
        return start(folder / "said", self.module, *shlex.split(COMMANDS[self.module]), folder=folder)


def contents(folder: Path, measured: tuple[str, ...]) -> dict[str, Any]:
    """What a run wrote, by path; of files that hold seconds too, nothing, or all else if they are JSON."""
    found: dict[str, Any] = {}
    for path in (path for path in folder.rglob("*") if path.is_file()):
        name, data = path.relative_to(folder).as_posix(), path.read_bytes()
        if name not in measured:
            found[name] = data
        elif path.suffix == ".json":
            found[name] = without_seconds(json.loads(data))
    return found


def without_seconds(data: Any) -> Any:
    """JSON without its measured seconds, and without the rows of a table that hold them."""
    if isinstance(data, dict):
        if str(data.get("quantity")).endswith(", s"):
            return {}
        return {key: without_seconds(value) for key, value in data.items() if key != "seconds"}
    return [without_seconds(each) for each in data] if isinstance(data, list) else data


def _rows(store: Path) -> int:
    """Rows of a store."""
    with closing(sqlite3.connect(store, timeout=60.0)) as database:
        if not database.execute("SELECT 1 FROM sqlite_master").fetchall():
            return 0
        return int(database.execute("SELECT COUNT(*) FROM results").fetchone()[0])


def trials(kills: int) -> list[Trial]:
    """Every command that keeps its finished jobs."""
    return [
        Trial(
            name=f"{module}, killed",
            what=f"`{module}`, killed (−9) at random moments and started again until it ends: no row of its store is "
            "lost, and its files are those of a run that was never killed, byte for byte but for measured seconds",
            wanted=kills,
            attempt=Killed(module).attempt,
        )
        for module in COMMANDS
    ]
