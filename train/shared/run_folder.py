"""Run folders and output files: nothing is overwritten unasked, nothing is left half-written."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import platform
import re
import shlex
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from gymnasium.error import DependencyNotInstalled
from llvmlite.binding import get_host_cpu_name

from aframe_env.text import read_toml
from aframe_env.validation import InvalidValue
from train.shared.cli import program, to_mapping, to_toml
from train.shared.console import let_output_degrade
from train.shared.job_store import JOBS
from train.shared.jobs import JobsFailed

CONFIG: Final = "config.toml"
RECORD: Final = "run.json"
_WHERE_AND_HOW: Final = (
    "out",
    "overwrite",
    "resume",
    "checkpoint_every",
    "log",
    "threads",
    "workers",
    "cluster",
    "trials",
)
"""Options that do not change what is computed, or only how much."""
_TEMPORARY: Final = re.compile(r"\..+\.[a-z0-9_]{8}\.[a-z0-9]+")
"""Name of a temporary file of ``write_atomically``."""
_LOCKS: Final[dict[Path, int]] = {}
"""Handles of the folders that this process has locked."""
REPORTED_PACKAGES = ("gymnasium", "stable-baselines3", "torch", "numpy", "scipy", "numba")


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then rename it: all or nothing.

    Raises:
        OSError: The disk is full, or the like; it names ``path``.
    """
    with naming(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix)
        os.close(handle)
        temporary = Path(name)
        try:
            write(temporary)
            temporary.chmod(0o644)
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise


@contextlib.contextmanager
def naming(path: Path, *, unless_named: bool = False) -> Iterator[None]:
    """Let an error of the disk name a file that is written: by itself it names none, or a temporary one.

    ``unless_named``: leave alone what names a file already.
    """
    try:
        yield
    except OSError as error:
        if error.errno is None or (unless_named and error.filename is not None):
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error


def write_text(path: Path, text: str) -> None:
    """Write a text file, all or nothing."""
    write_atomically(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def write_agent(place: Path, weights: bytes, card: Path, text: str) -> None:
    """Write an agent: weights first, the card that vouches for them last."""
    write_atomically(place, lambda path: path.write_bytes(weights))
    write_text(card, text)


def write_json(path: Path, data: Any) -> None:
    """Write a JSON file, all or nothing; NaN is refused."""
    write_text(path, json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n")


def new_folder(path: Path, *, overwrite: bool = False) -> Path:
    """Make an output folder; an existing one with something in it is refused unless ``overwrite``."""
    if path.exists() and not path.is_dir():
        raise InvalidValue(f"out = {str(path)!r}: is a file, must be a folder")
    if path.is_dir() and any(path.iterdir()) and not overwrite:
        raise InvalidValue(f"out = {str(path)!r}: exists and is not empty; choose another, or pass --overwrite")
    path.mkdir(parents=True, exist_ok=True)
    return path


def new_file(path: Path, *, overwrite: bool = False, option: str = "out") -> Path:
    """Return the path of an output file; one that exists is refused unless ``overwrite``.

    ``option``: its name on the command line.
    """
    if path.is_dir():
        raise InvalidValue(f"{option} = {str(path)!r}: is a folder, must be a file")
    if path.exists() and not overwrite:
        raise InvalidValue(f"{option} = {str(path)!r}: exists; choose another, or pass --overwrite")
    place = next(each for each in path.absolute().parents if each.exists())
    if not (place.is_dir() and os.access(place, os.W_OK)):
        what = "cannot be written to" if place.is_dir() else "is a file"
        raise InvalidValue(f"{option} = {str(path)!r}: {str(place)!r} {what}; choose another with --{option}")
    return path


def versions() -> dict[str, str]:
    """Versions of what a result depends on, to the last digit."""
    return {
        "aframe-heave": version("aframe-heave"),
        "python": platform.python_version(),
        "processor": get_host_cpu_name(),
        **{name: version(name) for name in REPORTED_PACKAGES},
    }


def command_line(name: str) -> str:
    """Return the command line that is running; ``name`` is the command's, as in "train.drives"."""
    return " ".join([program(name), *map(shlex.quote, sys.argv[1:])])


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """Output folder of a command."""

    out: Path | None = None
    """Output folder; by default runs/COMMAND-DATE-TIME."""
    overwrite: bool = False
    """Write into the output folder even if it has something in it."""


@dataclass(frozen=True)
class Run:
    """A run of a command, and the folder that it fills."""

    folder: Path
    command: str
    """The command line that made it."""
    taken_up: bool = False
    """Whether an earlier run of the same options began to fill it."""

    def record(self, options: RunOptions, **more: Any) -> None:
        """Write run.json: the command line, ``more``, and the versions; then config.toml, which ``--config`` reads."""
        write_json(self.folder / RECORD, {"command": self.command, **more, "versions": versions()})
        write_text(self.folder / CONFIG, to_toml(options))

    @property
    def jobs(self) -> Path:
        """Store of the jobs that are finished; it is there until the run is."""
        return self.folder / JOBS

    def finish(self) -> None:
        """Remove the store: the run's results are written."""
        self.jobs.unlink(missing_ok=True)


def open_jobs(options: RunOptions, name: str, result: str, **more: Any) -> Run:
    """Make the folder of a run whose jobs are kept in ``Run.jobs``, and record it; or take it up.

    ``result``: a file that a finished run has; its command is then refused. ``more`` is for run.json.
    """
    run = open_run(options, name, goes_on=True)
    if not run.taken_up:
        run.finish()
        (run.folder / result).unlink(missing_ok=True)
        run.record(options, **more)
    elif (run.folder / result).exists() and not run.jobs.exists():
        raise InvalidValue(f"out = {str(run.folder)!r}: this run is finished; pass --overwrite to do it again")
    return run


def open_run(options: RunOptions, name: str, *, goes_on: bool = False) -> Run:
    """Make the folder of a run of the command of that name, for this process alone.

    ``goes_on``: the command goes on with what an earlier run of the same options left, unless it is to be overwritten.
    """
    default = Path("runs") / f"{name.rpartition('.')[2].replace('_', '-')}-{datetime.now():%Y%m%d-%H%M%S}"
    folder = options.out or default
    taken_up = goes_on and not options.overwrite and _recorded(folder) == _what_counts(to_mapping(options))
    if not taken_up:
        new_folder(folder, overwrite=options.overwrite or _hardly_begun(folder))
    _lock(folder)
    if taken_up:
        for left in list(folder.rglob(".*")):
            if _TEMPORARY.fullmatch(left.name):  # of a file that was being written when the run was killed
                left.unlink()
    return Run(folder, command_line(name), taken_up)


def _hardly_begun(folder: Path) -> bool:
    """Whether a run of this folder was killed before it was recorded; nothing was computed then."""
    return folder.is_dir() and all(path.name == RECORD or path.name.startswith(".run.") for path in folder.iterdir())


def _recorded(folder: Path) -> dict[str, Any] | None:
    """Options that count of the run that began to fill a folder; None if there was none."""
    try:
        return _what_counts(read_toml(folder / CONFIG, "config"))
    except InvalidValue:
        return None


def _what_counts(options: dict[str, Any]) -> dict[str, Any]:
    """Options without those that do not change what is computed."""
    return {name: value for name, value in options.items() if name not in _WHERE_AND_HOW}


def _lock(folder: Path) -> None:
    """Keep other processes from filling the folder as long as this one runs."""
    if sys.platform == "win32":
        return  # a folder cannot be locked there
    import fcntl

    key = folder.resolve()
    if key in _LOCKS:
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(handle)
        if error.errno not in (errno.EAGAIN, errno.EACCES):
            return  # a disk that knows no locks
        raise InvalidValue(f"out = {str(folder)!r}: another process is writing into it") from error
    _LOCKS[key] = handle


def release(folder: Path) -> None:
    """Let other processes fill a folder that this one has opened a run in."""
    handle = _LOCKS.pop(folder.resolve(), None)
    if handle is not None:
        os.close(handle)


@contextlib.contextmanager
def user_errors() -> Iterator[None]:
    """One line on standard error for bad input, a failing disk or job, a missing extra (status 2) and Ctrl-C (130).

    Every command runs within it; its output degrades on a console that has not all characters.
    """
    let_output_degrade()
    try:
        yield
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise SystemExit(130) from None
    except (InvalidValue, OSError, DependencyNotInstalled, JobsFailed) as error:
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
