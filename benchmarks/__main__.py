"""Measure the package beside its peers, and write benchmarks.json, benchmarks.md and benchmarks.png.

``make bench`` sets up the peers' environment and runs this. The measures are in catalogue.py, the bars in bars.py.
An interrupted run keeps what it has: ``--resume`` goes on with it.
"""

from __future__ import annotations

import shlex
import signal
import sys
from dataclasses import dataclass
from pathlib import Path

from rich.box import SIMPLE
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from aframe_env.validation import InvalidValue, require_integer
from benchmarks.catalogue import MEASURES, Measure, Script, matching
from benchmarks.limit.library import NoCompiler, compiler_version
from benchmarks.report import write_report
from benchmarks.results import Machine, Run, Series
from benchmarks.workers import NotMeasured, Pythons, Worker
from train.shared.cli import parse
from train.shared.run_folder import user_errors


@dataclass(frozen=True)
class Options:
    """Measures of a run, and their number of samples."""

    rounds: int = 5
    """Samples of each measure, taken in turn."""
    quick: bool = False
    """Trial run: one round, without slow measures."""
    only: tuple[str, ...] = ()
    """Words: measure only what has one of them in its name, e.g. "envpool", "limit/double", "@1"."""
    out: Path | None = None
    """Output folder; by default results, or runs/benchmarks with --quick or --only."""
    resume: bool = False
    """Go on with an interrupted run."""
    peers: Path = Path(".venv-peers/bin/python")
    """Interpreter of the peers' environment."""

    def __post_init__(self) -> None:
        require_integer("rounds", self.rounds, low=1, high=1000)
        if self.only and not matching(self.only):
            groups = ", ".join(sorted({measure.group for measure in MEASURES.values()}))
            raise InvalidValue(f"only = {' '.join(self.only)!r}: nothing has it in its name; there are {groups}")

    @property
    def folder(self) -> Path:
        """Output folder."""
        return self.out or (Path("runs/benchmarks") if self.quick or self.only else Path("results"))


class Measuring:
    """Sampling of a run, round by round."""

    def __init__(self, run: Run, pythons: Pythons, partial: Path) -> None:
        self.run = run
        self._pythons = pythons
        self._partial = partial
        self._workers: dict[tuple[Script, int], Worker] = {}

    def wanted(self, measure: Measure) -> int:
        """Samples that a measure shall have."""
        return min(self.run.rounds, measure.rounds or self.run.rounds)

    def all(self, measures: list[Measure], bars: Progress) -> None:
        """Take every missing sample, in turn."""
        missing = sum(self.wanted(m) - len(self.run.series[m.key].samples) for m in measures)
        bar = bars.add_task("", total=missing)
        for index in range(self.run.rounds):
            for measure in measures:
                series = self.run.series[measure.key]
                if series.error or len(series.samples) > index or index >= self.wanted(measure):
                    continue
                bars.update(bar, description=f"round {index + 1}: {measure.key}")
                try:
                    series.samples.append(self._worker(measure).sample(measure.name))
                    bars.advance(bar)
                except NotMeasured as reason:
                    series.error = str(reason)
                    bars.console.print(f"{measure.key}: not measured: {reason}", markup=False, highlight=False)
                    bars.advance(bar, self.wanted(measure) - len(series.samples))
                self.run.save(self._partial)

    def close(self) -> None:
        """End the workers."""
        for worker in self._workers.values():
            worker.close()

    def _worker(self, measure: Measure) -> Worker:
        place = (measure.script, measure.cores)
        if place not in self._workers:
            self._workers[place] = Worker(measure.script, measure.cores, self._pythons)
            self.run.peer_versions[measure.script.path] = self._workers[place].versions
        return self._workers[place]


def _compiler() -> str:
    try:
        return compiler_version()
    except NoCompiler as error:
        return str(error)


def _open(options: Options, partial: Path) -> Run:
    """Open a new run, or the interrupted one."""
    machine = Machine.here(_compiler())
    command = shlex.join(["python", "-m", "benchmarks", *(arg for arg in sys.argv[1:] if arg != "--resume")])
    new = Run.new(command, 1 if options.quick else options.rounds, machine)
    if not options.resume:
        return new
    if not partial.exists():
        raise InvalidValue(f"resume: there is no {partial}")
    old = Run.load(partial)
    if (old.machine, old.versions, old.rounds) != (new.machine, new.versions, new.rounds):
        raise InvalidValue(f"resume: {partial} is of another machine, other versions or another number of rounds")
    for series in old.series.values():
        series.error = ""  # what failed may do better now
    return old


def run(options: Options, console: Console) -> int:
    """Measure, print, write; return the exit status."""
    folder = options.folder
    if folder.exists() and not folder.is_dir():
        raise InvalidValue(f"out = {str(folder)!r}: is a file, must be a folder")
    partial = folder / "benchmarks.partial.json"
    measured = _open(options, partial)
    measures = matching(options.only, options.quick)
    for measure in measures:
        measured.series.setdefault(measure.key, Series())
    columns = (
        TextColumn("{task.description:<40}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    measuring = Measuring(measured, Pythons(options.peers), partial)
    try:
        with Progress(*columns, console=console) as bars:
            measuring.all(measures, bars)
    except KeyboardInterrupt:
        console.print(f"interrupted: {partial} has what was measured; --resume goes on with it")
        return 130
    finally:
        measuring.close()
    rows = write_report(folder, measured)
    partial.unlink(missing_ok=True)
    table = Table("bar", "", "measured", "ratio", "met", box=SIMPLE, padding=0)
    for row in rows:
        table.add_row(row.what, row.bar, row.measured, row.ratio, row.word)
    console.print(table)
    console.print(f"written: {folder / 'benchmarks.md'}")
    return 0


def main() -> int:
    """Run the command."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with user_errors():
        return run(parse(Options, "benchmarks", __doc__ or ""), Console())


if __name__ == "__main__":
    sys.exit(main())
