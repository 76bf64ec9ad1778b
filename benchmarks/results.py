"""Samples of a run: their median and spread, kept in a file from round to round."""

from __future__ import annotations

import os
import platform
import statistics
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from aframe_env.serialization import strict_converter, structure
from aframe_env.text import read_json
from train.shared.run_folder import versions, write_json

NOT_ASKED: Final = "not measured in this run"


@dataclass
class Series:
    """Samples of one measure, one a round; or the reason why there are none."""

    samples: list[float] = field(default_factory=list)
    error: str = ""

    @property
    def measured(self) -> bool:
        """True if there are samples, and none of them failed."""
        return bool(self.samples) and not self.error

    @property
    def median(self) -> float:
        """Median of the samples."""
        return statistics.median(self.samples)


@dataclass(frozen=True)
class Machine:
    """Machine of a run."""

    processor: str
    cores: int
    """Cores that the run may use; it uses at most two."""
    pinned: bool
    system: str
    compiler: str

    @classmethod
    def here(cls, compiler: str) -> Machine:
        """This machine."""
        pinned = hasattr(os, "sched_getaffinity")
        cores = len(os.sched_getaffinity(0)) if pinned else os.cpu_count() or 1
        return cls(_processor(), cores, pinned, f"{platform.system()} {platform.machine()}", compiler)


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or "unknown"


@dataclass
class Run:
    """A run, finished or not."""

    command: str
    rounds: int
    machine: Machine
    versions: dict[str, str]
    series: dict[str, Series]
    """Series by key of the measure."""
    peer_versions: dict[str, dict[str, str]] = field(default_factory=dict)
    """Versions of the peers' packages by script."""

    @classmethod
    def new(cls, command: str, rounds: int, machine: Machine) -> Run:
        """A run without samples."""
        return cls(command, rounds, machine, versions(), {})

    def get(self, key: str) -> Series:
        """Series of a measure; an empty one if it was not asked for."""
        return self.series.get(key, Series(error=NOT_ASKED))

    def data(self) -> dict[str, Any]:
        """Return the run as plain data."""
        return dict(strict_converter().unstructure(self))

    def save(self, path: Path) -> None:
        """Write the samples, all or nothing."""
        write_json(path, self.data())

    @classmethod
    def load(cls, path: Path) -> Run:
        """Read a file that ``save`` wrote."""
        return structure(strict_converter(), read_json(path, "run"), cls, str(path))
