"""Commands whose disk fills up: on a small tmpfs where one can be mounted, else by a limit of each file's size.

Both are errors that the system itself raises, ENOSPC and EFBIG.
"""

from __future__ import annotations

import json
import shlex
import subprocess
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from safetensors import safe_open

from agents.learned.agent import WEIGHTS
from benchmarks.torture.kills import SMALL
from benchmarks.torture.processes import start
from benchmarks.torture.trial import Outcome, Trial

_PAGE: Final = 4096
_PATIENCE: Final = 300.0
"""Seconds after which a command is no longer waited for."""
_COMMANDS: Final = {
    "train.ppo": f"{SMALL['train.ppo']} --timesteps 600 --checkpoint-every 0 --out DISK/run",
    "train.sac": f"{SMALL['train.sac']} --timesteps 120 --checkpoint-every 0 --out DISK/run",
    "train.drives": "--drive spline --objective omega2 --max-evaluations 60 --duration 12 --out DISK/run",
    "train.evaluate": "--scenarios 3 --privileged 0 --policies 'drum still' 'output zero' --out DISK/run",
    "train.drive_map": "--amplitudes 1 2 --periods 8 9 --masses 4e4 5e4 --lengths 200 300 --held-out 2 --workers 1 "
    "--store DISK/jobs.sqlite --out DISK/run",
    "train.sensitivity": "--scenarios 1 --points 2 --samples 2 --workers 1 --out DISK/run",
    "train.tune": "--trials 1 --timesteps 512 --scenarios 2 --out DISK/run",
    "train.dataset": "--kinds medium --observations state --episodes 2",
    "train.export": "ppo --out DISK/run",
    "train.demo": "--record DISK/replay.html",
}
"""Small runs of every command that writes to DISK."""


@dataclass(frozen=True)
class Disk:
    """A folder with so much room."""

    folder: Path
    mounted: bool

    def limit(self, room: int | None) -> int | None:
        """Leave room for so many bytes more, or plenty; return the most that a process may write into a file."""
        if not self.mounted:
            return None if room is None else max(room, _PAGE)
        used = sum(-(-path.stat().st_size // _PAGE) * _PAGE + _PAGE for path in self.folder.rglob("*"))
        size = 2**30 if room is None else used + room
        subprocess.run(["mount", "-o", f"remount,size={size}", self.folder], check=True)
        return None


@cache
def can_mount() -> bool:
    """Whether this user may mount a tmpfs."""
    with TemporaryDirectory(prefix="torture-") as folder:
        try:
            mounted = subprocess.run(["mount", "-t", "tmpfs", "tmpfs", folder], capture_output=True, check=False)
        except OSError:
            return False
        if mounted.returncode == 0:
            subprocess.run(["umount", folder], check=True)
        return mounted.returncode == 0


@contextmanager
def open_disk(folder: Path, *, mounted: bool) -> Iterator[Disk]:
    """A disk in a new folder."""
    folder.mkdir()
    if not mounted:
        yield Disk(folder, mounted)
        return
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1G", "tmpfs", folder], check=True)
    try:
        yield Disk(folder, mounted)
    finally:
        subprocess.run(["umount", folder], check=True)


@dataclass(frozen=True)
class Filled:
    """One command, and whether its disk is a tmpfs."""

    module: str
    mounted: bool

    def attempt(self, rng: np.random.Generator, folder: Path, most: int) -> Outcome:
        """Fill the disk at a random byte of what is written, then make room and go on."""
        sizes = self._sizes
        with open_disk(folder / "disk", mounted=self.mounted) as disk:
            again = bool(rng.integers(2))
            if again:
                self._run(disk, None)
            room = int(rng.integers(1, sum(sizes) if self.mounted else max(sizes)))
            status, said = self._run(disk, disk.limit(room), anew=again)
            counts = {"over an earlier run": int(again), "had room enough": int(status == 0)}
            failure = self._complaint(disk, status, said)
            if not failure and status != 0:
                disk.limit(None)
                # A training goes on; whatever else had begun needs --overwrite.
                status, said = self._run(disk, None, anew=self.module not in SMALL)
                if status != 0:
                    failure = f"cannot go on: exit status {status}: {said[-1000:]}"
            if not failure and self.module in SMALL and (disk.folder / "run" / WEIGHTS).read_bytes() != self._agent:
                failure = "another agent"
        return Outcome(1, int(not failure), counts, (f"room for {room} bytes: {failure}",) if failure else ())

    def _complaint(self, disk: Disk, status: int | None, said: str) -> str:
        """What is wrong with how the command ended, or with what it left; empty if nothing is."""
        errors = [line for line in said.splitlines() if line.startswith("error: ")]
        if "Traceback" in said:
            return f"a traceback: {said[-2000:]}"
        if status != 0 and (status != 2 or len(errors) != 1 or str(disk.folder) not in said):
            return f"exit status {status}: {said[-1000:]}"
        return next(damaged(disk.folder), "")

    def _run(self, disk: Disk, limit: int | None, *, anew: bool = False) -> tuple[int | None, str]:
        said = disk.folder.parent / "said"
        said.write_bytes(b"")
        overwrite = ("--overwrite",) if anew else ()
        environment = {"MINARI_DATASETS_PATH": str(disk.folder)}
        arguments = (*shlex.split(_COMMANDS[self.module].replace("DISK", str(disk.folder))), *overwrite)
        process = start(said, self.module, *arguments, environment=environment, largest_file=limit)
        process.join(_PATIENCE)
        status = process.exitcode
        process.kill()
        process.join()
        return status, said.read_text(encoding="utf-8")

    @cached_property
    def _whole(self) -> tuple[list[int], bytes]:
        """Sizes of the files of a run that nothing befalls, and its agent."""
        with TemporaryDirectory(prefix="torture-") as folder, open_disk(Path(folder) / "disk", mounted=False) as disk:
            status, said = self._run(disk, None)
            if status != 0:
                raise RuntimeError(f"{self.module}: exit status {status} with room enough: {said}")
            agent = disk.folder / "run" / WEIGHTS
            files = [path for path in disk.folder.rglob("*") if path.is_file()]
            return [path.stat().st_size for path in files], agent.read_bytes() if agent.exists() else b""

    @property
    def _sizes(self) -> list[int]:
        return self._whole[0]

    @property
    def _agent(self) -> bytes:
        return self._whole[1]


def damaged(folder: Path) -> Iterator[str]:
    """Files that cannot be read, and temporary ones that were left."""
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        try:
            if path.name.startswith("."):
                yield f"{path.name} was left"
            elif path.suffix == ".json":
                json.loads(path.read_text(encoding="utf-8"))
            elif path.suffix == ".toml":
                tomllib.loads(path.read_text(encoding="utf-8"))
            elif path.suffix == ".safetensors":
                with safe_open(path, "np") as opened:
                    opened.keys()
        except Exception as error:  # whatever a reader says of a damaged file
            yield f"{path.name} cannot be read: {error}"


def trials(count: int) -> list[Trial]:
    """Every command that writes."""
    mounted = can_mount()
    how = "ENOSPC on a small tmpfs" if mounted else "EFBIG, by a limit of each file's size"
    return [
        Trial(
            name=f"{module}, disk full",
            what=f"`{module}` while the disk fills at a random byte ({how}): one sentence names the file, what is "
            "there can be read, and with room again the same command ends, a training with the same agent",
            wanted=count,
            attempt=Filled(module, mounted).attempt,
        )
        for module in _COMMANDS
    ]
