"""Try other people's libraries on the package's wheel, each by a short script in an empty folder, and print a table.

``make compat`` sets up the environments, .venv-compat, and runs this. What a script prints is kept in build/compat.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Final

from rich.console import Console

from aframe_env.validation import InvalidValue
from compat.catalogue import LIBRARIES, ROOT, STAGES, Library
from train.shared.cli import parse
from train.shared.markdown import table
from train.shared.run_folder import new_folder, user_errors, write_text

PAGE: Final = ROOT / "docs" / "compatibility.md"
BEGIN, END = "<!-- `make compat ARGS=--write` writes this table -->\n\n", "\n<!-- end of it -->\n"
LONGEST: Final = 1800.0
"""Time for a script, s; after it, it counts as failed."""

_ABOUT: Final = """
import importlib.metadata, json, platform, sys
import gymnasium, aframe_env, agents
for observation in ("state", "sensors"):
    env = agents.AgentInterface(gymnasium.make(aframe_env.ENV_ID, observation=observation))
    env.reset(seed=0)
    env.step(env.action_space.sample())
print(json.dumps({
    "python": platform.python_version(),
    "where": aframe_env.__file__,
    "versions": {found.metadata["Name"].lower().replace("_", "-"): found.version
                 for found in importlib.metadata.distributions()},
}))
"""


@dataclass(frozen=True)
class Options:
    """Libraries of a run, and where their environments are."""

    only: tuple[str, ...] = ()
    """Words: try only libraries that have one of them in their name, in any case."""
    environments: Path = Path(".venv-compat")
    """Folder of the environments, one for each requirements file in compat."""
    write: bool = False
    """Write the libraries' rows into the table of docs/compatibility.md."""

    def __post_init__(self) -> None:
        if not self.libraries:
            names = ", ".join(library.name for library in LIBRARIES)
            raise InvalidValue(f"only = {' '.join(self.only)!r}: no library has it in its name; there are {names}")

    @property
    def libraries(self) -> tuple[Library, ...]:
        """The libraries to try."""
        words = [word.lower() for word in self.only]
        return tuple(each for each in LIBRARIES if not words or any(word in each.name.lower() for word in words))


@dataclass(frozen=True)
class Environment:
    """An environment with the wheel in it."""

    interpreter: Path
    python: str
    """Version."""
    versions: dict[str, str] = field(repr=False)
    """Of every distribution, by its name in small letters, with hyphens."""


@dataclass(frozen=True)
class Outcome:
    """What came of a library."""

    library: Library
    environment: Environment
    reached: tuple[str, ...]
    seconds: float
    day: date
    failure: str = ""
    """Last line of what a script said that did not come through."""

    @property
    def row(self) -> tuple[str, ...]:
        """The table's row."""
        library, versions = self.library, self.environment.versions
        done = ("yes" if stage in self.reached else "**no**" if stage in library.stages else "" for stage in STAGES)
        failure = self.failure.replace("|", "/")  # which would end the cell
        told = "; ".join(filter(None, (f"**{failure}**" if failure else "", library.remark)))
        where = (versions[library.distribution], self.environment.python, versions["gymnasium"])
        return (library.name, *where, *done, f"{self.seconds:.0f}", self.day.isoformat(), told)


HEADINGS: Final = ("library", "version", "Python", "Gymnasium", *STAGES, "s", "tried on", "what to know")


def build_wheel(folder: Path) -> Path:
    """Build the checkout's wheel in an empty folder, by way of its sdist, as a release is built."""
    _run([sys.executable, "-m", "build", "--outdir", folder, ROOT])
    (wheel,) = folder.glob("*.whl")
    return wheel


def open_environment(folder: Path, wheel: Path) -> Environment:
    """Put the wheel into the environment, see that its requirements are met, and compile the physics."""
    interpreter = folder.absolute() / "bin" / "python"
    if not interpreter.exists():
        raise InvalidValue(f"environments: there is no {interpreter}: `make compat` makes it")
    pip = (interpreter, "-m", "pip", "--disable-pip-version-check")
    _run([*pip, "install", "-q", "--no-deps", "--force-reinstall", wheel])
    _run([*pip, "check"])
    with tempfile.TemporaryDirectory() as empty:
        about = json.loads(_run([interpreter, "-c", _ABOUT], Path(empty)))
    if not Path(about["where"]).is_relative_to(folder.absolute()):
        raise InvalidValue(f"environments: {interpreter} takes aframe_env from {about['where']}, not from the wheel")
    return Environment(interpreter, about["python"], about["versions"])


def attempt(library: Library, environment: Environment, log: Path, longest: float = LONGEST) -> Outcome:
    """Run the library's script in an empty folder; its output goes to ``log``."""
    with tempfile.TemporaryDirectory() as name, log.open("w", encoding="utf-8") as output:
        folder = Path(name)
        for path in (library.script, *library.beside):
            shutil.copy(path, folder)
        start = time.monotonic()
        process = subprocess.Popen(
            [str(environment.interpreter), library.script.name],
            cwd=folder,
            env=_variables(folder),
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            status: int | None = process.wait(longest)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            _end_group(process)
        seconds = time.monotonic() - start
    lines = [line.strip() for line in log.read_text(encoding="utf-8", errors="replace").splitlines()]
    reached = tuple(stage for stage in library.stages if stage in lines)
    failure = ""
    if status is None:
        failure = f"not done after {longest:g} s"
    elif status:
        failure = next(filter(None, reversed(lines)), f"ended with status {status}")
    elif reached != library.stages:
        failure = "ended before it was done"
    return Outcome(library, environment, reached, seconds, datetime.now(UTC).date(), failure)


def updated(page: str, outcomes: Sequence[Outcome]) -> str:
    """Return the page with these outcomes in its table, in the place of what it said of the same libraries."""
    before, _, rest = page.partition(BEGIN)
    old, _, after = rest.partition(END)
    rows = {row[0]: row for line in old.splitlines()[2:] if (row := [cell.strip() for cell in line.split("|")[1:-1]])}
    rows |= {outcome.library.name: list(outcome.row) for outcome in outcomes}
    return before + BEGIN + table(HEADINGS, [rows[each.name] for each in LIBRARIES if each.name in rows]) + END + after


def run(options: Options, console: Console) -> int:
    """Try the libraries, print the table; return the exit status."""
    folder = new_folder(ROOT / "build" / "compat", overwrite=True)
    names = {library.environment: None for library in options.libraries}
    with tempfile.TemporaryDirectory() as empty, console.status("building and installing the wheel"):
        wheel = build_wheel(Path(empty))
        environments = {name: open_environment(options.environments / name, wheel) for name in names}
    outcomes = []
    for library in options.libraries:
        log = folder / f"{library.script.stem}.log"
        console.print(f"{library.name} ...", end=" ")
        outcomes.append(attempt(library, environments[library.environment], log))
        said = f"{outcomes[-1].failure or 'done'} ({outcomes[-1].seconds:.0f} s, {log.relative_to(ROOT)})"
        console.print(said, markup=False, highlight=False, soft_wrap=True)
        if options.write:
            write_text(PAGE, updated(PAGE.read_text(encoding="utf-8"), outcomes))
    rows = [outcome.row for outcome in outcomes]
    console.print(table(HEADINGS, rows), markup=False, highlight=False, soft_wrap=True)
    return int(any(outcome.failure for outcome in outcomes))


def _run(command: Sequence[str | Path], folder: Path | None = None) -> str:
    """Run a command, in a folder that is its home where one is given, and return what it says."""
    variables = None if folder is None else _variables(folder)
    done = subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stdout + done.stderr, file=sys.stderr)
        raise InvalidValue(f"{shlex.join(map(str, command))} ended with status {done.returncode}, see above")
    return done.stdout


def _variables(home: Path) -> dict[str, str]:
    """Environment variables of a user's script, whose home is its folder: nothing is left behind."""
    kept = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
    return {**kept, "HOME": str(home), "PYTHONUNBUFFERED": "1"}


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """End what a script left running, workers too."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:  # nothing is left
        return
    process.wait()


def main() -> None:
    """Run from the command line."""
    with user_errors():
        options = parse(Options, "compat", __doc__ or "")
        sys.exit(run(options, Console()))


if __name__ == "__main__":
    main()
