"""Verification of the full model: ``python -m train.verify``.

Without a file it runs every check against closed forms and independent programs and writes a table
(README.md, verification.json) and pictures into ``--folder``, default runs/verify-DATE-TIME. The exit status
is 1 if a bar does not hold. With a file it runs that one case and prints its result as JSON, or writes it
into the file that ``--out`` names:

    python -m train.verify --load-case case.toml
    python -m train.verify --release case.toml --out release.json
    python -m train.verify --dynamic case.toml --out run.json
    python -m train.verify --rope-case case.toml --out run.json

With --water it runs the checks of heavy ropes and loads in water in place of the full model's.

A static case's JSON has the keys of the reference data's cases (aframe_env/data/reference/static.json) and,
under ``along``, section forces and von Mises stress along the frame. In ``sec_before_…`` and ``sec_after_…``
the moments are those at the point; N, Vy, Vz and T are means over the adjoining 0.1 m, as in the reference
program. The other two kinds have one list a column, with the column names of the reference data's CSV files.
"""

from __future__ import annotations

import json
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import scipy
import tyro
from rich.console import Console

import aframe_env
import train.verify
from aframe_env.text import read_toml
from aframe_env.validation import InvalidValue
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.job_store import JobStore, version_of
from train.shared.run_folder import RunOptions, new_file, open_jobs, user_errors, write_json, write_text
from train.verify import drive_checks, frame_checks, luffing_checks, rope_cases, rope_checks, run_checks, water_checks
from train.verify.cases import (
    FORMAT,
    dynamic_case,
    release_case,
    static_case,
    without_nan,
)
from train.verify.pictures import draw_all
from train.verify.report import Check, markdown
from train.verify.rope_cases import run_rope_case
from train.verify.rope_pictures import draw_ropes

__doc__ = f"{__doc__}\n{FORMAT}\n{rope_cases.FORMAT}"

CASE_KINDS: Mapping[str, Callable[[Mapping[str, Any], Path], dict[str, object]]] = {
    "load_case": lambda data, _: static_case(data),
    "release": lambda data, _: release_case(data),
    "dynamic": dynamic_case,
    "rope_case": run_rope_case,
}
"""Functions that run a case, given its file's contents and folder."""
CASE_OPTIONS = ", ".join(f"--{name.replace('_', '-')}" for name in CASE_KINDS)


CHECKS: Sequence[Callable[[], Check | list[Check]]] = (
    frame_checks.beam_frequencies,
    frame_checks.determinate_reactions,
    frame_checks.static_frame,
    frame_checks.second_order,
    frame_checks.natural_modes,
    frame_checks.previous_model,
    run_checks.releases,
    run_checks.paper_case,
    run_checks.shocks,
    run_checks.rough_seas,
    luffing_checks.swings,
    luffing_checks.rigid_swing,
    drive_checks.torque_drive_on_flexible_frame,
    run_checks.stiff_frame,
    run_checks.energy,
    run_checks.steps,
    run_checks.drift,
)
"""Every check of the full model, in the order of the table."""
WATER_CHECKS: Sequence[Callable[[], Check | list[Check]]] = (
    rope_checks.cases,
    rope_checks.statics,
    rope_checks.frequencies,
    rope_checks.transfer,
    rope_checks.massless_limit,
    rope_checks.energy,
    *water_checks.CHECKS,
    drive_checks.torque_drive,
)
"""Every check of heavy ropes, loads in water, and what drives the drum."""


@dataclass(frozen=True)
class Checked:
    """What a check found, and how long it took."""

    checks: tuple[Check, ...]
    seconds: float


def run_all(
    store: JobStore[Checked], console: Console, wanted: Sequence[Callable[[], Check | list[Check]]]
) -> list[Check]:
    """Run those of the wanted checks that are not in the store, and return all."""
    checks: list[Check] = []
    for check in wanted:
        done = store.get([check.__module__, check.__name__], partial(_timed, check))
        for item in done.checks:
            mark = "ok  " if item.passed else "FAIL"
            console.print(f"{mark} {item.name}: {item.measured} (bar: {item.bar})", highlight=False)
        console.print(f"     {done.seconds:.1f} s", highlight=False)
        checks += done.checks
    return checks


def _timed(check: Callable[[], Check | list[Check]]) -> Checked:
    begin = time.perf_counter()
    found = check()
    every = [found] if isinstance(found, Check) else found
    return Checked(tuple(replace(each, passed=bool(each.passed)) for each in every), time.perf_counter() - begin)


def versions() -> dict[str, str]:
    """Versions of the packages that the figures depend on."""
    return {"python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__}


def write_report(checks: Sequence[Check], folder: Path, water: bool) -> None:
    """Write the table as Markdown and JSON, and the pictures."""
    pictures = draw_ropes(folder) if water else draw_all(folder)
    command = "python -m train.verify" + water * " --water"
    heading = "Verification of heavy ropes and loads in water" if water else "Verification of the full model"
    stated = ", ".join(f"{name} {version}" for name, version in versions().items())
    images = "\n\n".join(f"![{path.stem.replace('_', ' ')}]({path.name})" for path in pictures)
    footer = f"{images}\n\nMade by `{command}` ({stated})."
    write_json(
        folder / "verification.json",
        {
            "command": command,
            "versions": versions(),
            "checks": [{**asdict(check), "rows": [asdict(row) for row in check.rows]} for check in checks],
        },
    )
    write_text(folder / "README.md", markdown(checks, heading, footer))


@dataclass(frozen=True, kw_only=True)
class Options:
    """All checks, or one case."""

    load_case: Annotated[Path | None, tyro.conf.arg(aliases=("--static",))] = None
    """Run one static load case, from a TOML file."""
    release: Path | None = None
    """Run one release of a static load, from a TOML file."""
    dynamic: Path | None = None
    """Run one case with ship motion, from a TOML file."""
    rope_case: Path | None = None
    """Run one case of a load in water on a heavy rope, from a TOML file."""
    water: bool = False
    """Check heavy ropes and loads in water, not the full model."""
    out: Path | None = None
    """JSON file for that case's result; by default it is printed."""
    folder: Path | None = None
    """Folder for table and pictures of all checks; by default runs/verify-DATE-TIME."""
    overwrite: bool = False
    """Write even where there is something."""

    def __post_init__(self) -> None:
        if len(self.cases) > 1:
            raise InvalidValue(f"{', '.join(self.cases)}: give one of them")
        if self.cases and self.folder is not None:
            raise InvalidValue(f"--folder goes without {CASE_OPTIONS}: name a file by --out")
        if self.cases and self.water:
            raise InvalidValue(f"--water goes without {CASE_OPTIONS}")
        if self.out is not None and not self.cases:
            raise InvalidValue(f"--out goes with {CASE_OPTIONS}")

    @property
    def cases(self) -> dict[str, Path]:
        """Files of the cases that are asked for."""
        given = {name: getattr(self, name) for name in CASE_KINDS}
        return {name: path for name, path in given.items() if path is not None}


def run_case(kind: str, path: Path, options: Options, console: Console) -> None:
    """Run one case, and write or print its result."""
    out = None if options.out is None else new_file(options.out, overwrite=options.overwrite)
    result = without_nan(CASE_KINDS[kind](read_toml(path, kind), path.parent))
    if out is None:
        console.print(json.dumps(result, indent=2, allow_nan=False), highlight=False)
    else:
        write_json(out, result)
        console.print(f"result: {out}", highlight=False)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit status."""
    with user_errors():
        options, console = parse(Options, "train.verify", __doc__ or "", arguments), PlainConsole()
        for kind, path in options.cases.items():
            run_case(kind, path, options, console)
            return 0
        run = open_jobs(RunOptions(out=options.folder, overwrite=options.overwrite), "train.verify", "README.md")
        try:
            with JobStore(run.jobs, Checked, version_of(aframe_env, train.verify)) as store:
                checks = run_all(store, console, WATER_CHECKS if options.water else CHECKS)
            write_report(checks, run.folder, options.water)
        except KeyboardInterrupt:
            console.print("interrupted: what is finished is kept; the same command goes on from there")
            return 130
        run.finish()
        console.print(f"written: {run.folder}", highlight=False)
        return 0 if all(check.passed for check in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
