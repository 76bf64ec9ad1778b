"""Verification of the full model: ``python -m train.verify``.

Without a file it runs every check against closed forms and independent programs and writes a table
(README.md, verification.json) and pictures into ``--folder``, default runs/verify-DATE-TIME. The exit status
is 1 if a bar does not hold. With a file it runs that one case and prints its result as JSON, or writes it
into the file that ``--out`` names:

    python -m train.verify --load-case case.toml
    python -m train.verify --release case.toml --out release.json
    python -m train.verify --dynamic case.toml --out run.json

A static case's JSON has the keys of the reference data's cases (aframe_env/data/reference/static.json) and,
under ``along``, section forces and von Mises stress along the frame. In ``sec_before_…`` and ``sec_after_…``
the moments are those at the point; N, Vy, Vz and T are means over the adjoining 0.1 m, as in the reference
program. The other two kinds have one list a column, with the column names of the reference data's CSV files.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from train.output import new_file, new_folder, user_errors, write_json, write_text
from train.verification import frame_checks, run_checks
from train.verification.cases import (
    FORMAT,
    dynamic_case,
    read_toml,
    release_case,
    static_case,
    without_nan,
)
from train.verification.pictures import draw_all
from train.verification.report import Check, markdown

__doc__ = f"{__doc__}\n{FORMAT}"

CASE_KINDS: Mapping[str, Callable[[Mapping[str, Any], Path], dict[str, object]]] = {
    "load_case": lambda data, _: static_case(data),
    "release": lambda data, _: release_case(data),
    "dynamic": dynamic_case,
}
"""What runs a case, given what its file says and the file's folder."""


def run_all(*, say: bool = True) -> list[Check]:
    """Every check, in the order of the table."""
    checks: list[Check] = []
    for check in (
        frame_checks.beam_frequencies,
        frame_checks.determinate_reactions,
        frame_checks.static_frame,
        frame_checks.natural_modes,
        frame_checks.previous_model,
        run_checks.releases,
        run_checks.paper_case,
        run_checks.stiff_frame,
        run_checks.energy,
        run_checks.steps,
        run_checks.drift,
    ):
        begin = time.perf_counter()
        found = check()
        found = [found] if isinstance(found, Check) else found
        checks += found
        if say:
            for item in found:
                mark = "ok  " if item.passed else "FAIL"
                print(f"{mark} {item.name}: {item.measured} (bar: {item.bar})", flush=True)
            print(f"     {time.perf_counter() - begin:.1f} s", flush=True)
    return checks


def versions() -> dict[str, str]:
    """Of what the figures depend on."""
    return {"python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__}


def write_report(checks: Sequence[Check], folder: Path) -> None:
    """Table as Markdown and JSON, and the pictures."""
    pictures = draw_all(folder)
    stated = ", ".join(f"{name} {version}" for name, version in versions().items())
    images = "\n\n".join(f"![{path.stem.replace('_', ' ')}]({path.name})" for path in pictures)
    footer = f"{images}\n\nMade by `python -m train.verify` ({stated})."
    write_text(folder / "README.md", markdown(checks, "Verification of the full model", footer))
    write_json(
        folder / "verification.json",
        {
            "command": "python -m train.verify",
            "versions": versions(),
            "checks": [
                {**asdict(check), "passed": bool(check.passed), "rows": [asdict(row) for row in check.rows]}
                for check in checks
            ],
        },
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m train.verify",
        description="Verify the full model, or run one case of it.",
        epilog=FORMAT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument("--load-case", type=Path, metavar="FILE.toml", help="run one static load case")
    kind.add_argument("--release", type=Path, metavar="FILE.toml", help="run one release of a static load")
    kind.add_argument("--dynamic", type=Path, metavar="FILE.toml", help="run one case with ship motion")
    parser.add_argument("--out", type=Path, metavar="FILE.json", help="where that case's result goes; else printed")
    parser.add_argument("--folder", type=Path, help="where table and pictures go; by default runs/verify-DATE-TIME")
    parser.add_argument("--overwrite", action="store_true", help="write even where there is something")
    given = parser.parse_args(arguments)
    with user_errors():
        for name, solve in CASE_KINDS.items():
            path: Path | None = getattr(given, name)
            if path is None:
                continue
            if given.folder is not None:
                parser.error("--folder goes without --load-case, --release and --dynamic: name a file by --out")
            out = None if given.out is None else new_file(given.out, overwrite=given.overwrite)
            result = without_nan(solve(read_toml(path), path.parent))
            if out is None:
                print(json.dumps(result, indent=2, allow_nan=False))
            else:
                write_json(out, result)
                print(f"result: {out}")
            return 0
        if given.out is not None:
            parser.error("--out goes with --load-case, --release or --dynamic")
        folder = new_folder(
            given.folder or Path("runs") / f"verify-{datetime.now():%Y%m%d-%H%M%S}", overwrite=given.overwrite
        )
        checks = run_all()
        write_report(checks, folder)
        print(f"written: {folder}")
        return 0 if all(check.passed for check in checks) else 1


if __name__ == "__main__":
    sys.exit(main())
