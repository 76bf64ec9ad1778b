"""Try to lose work: kill commands, and a cluster's workers, at random moments, fill disks; count what survives.

``python -m benchmarks.torture`` takes an hour or two and writes results/reliability.json; interrupted, the same
command goes on where it was. All moments are drawn from --seed; what they hit is up to the machine. Linux and macOS.
"""

from __future__ import annotations

import signal
import sys
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from aframe_env.validation import require_integer
from benchmarks.torture import cluster, full_disk, kills, studies
from benchmarks.torture.trial import Results, Trial, attempts
from train.shared.cli import parse
from train.shared.run_folder import command_line, user_errors


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    kills: int = 100
    """Kills of each learner's training."""
    study_kills: int = 20
    """Kills of each command that keeps its finished jobs."""
    full_disks: int = 5
    """Full disks of each command that writes."""
    only: str = ""
    """Trials whose name has this in it."""
    seed: int = 0
    """Of all random moments."""
    out: Path = Path("results/reliability.json")
    """File that is written; rows of other trials that it has already are kept."""

    def __post_init__(self) -> None:
        require_integer("kills", self.kills, low=1, high=10**6)
        require_integer("study_kills", self.study_kills, low=1, high=10**6)
        require_integer("full_disks", self.full_disks, low=1, high=10**6)
        require_integer("seed", self.seed, low=0, high=2**32 - 1)

    @property
    def trials(self) -> list[Trial]:
        """What is tried."""
        everything = [
            *kills.trials(self.kills),
            *studies.trials(self.study_kills),
            *full_disk.trials(self.full_disks),
            *cluster.trials(),
        ]
        return [trial for trial in everything if self.only in trial.name]


def run(options: Options, console: Console) -> int:
    """Try everything, print, write; return 1 if anything was lost, else 0."""
    trials, partial = options.trials, options.out.with_suffix(".partial.json")
    results = Results.begin(command_line("benchmarks.torture"), options.seed, trials, partial)
    columns = (TextColumn("{task.description:<40}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console) as bars:
        for trial in trials:
            row = results.rows[trial.name]
            bar = bars.add_task(trial.name, total=trial.wanted, completed=row.tried)
            for outcome in attempts(trial, row, options.seed):
                bars.update(bar, completed=row.tried)
                for failure in outcome.failures:
                    console.print(f"{trial.name}: {failure}", markup=False, highlight=False)
                results.save(partial)
    results.beside(options.out).save(options.out)
    partial.unlink(missing_ok=True)
    table = Table("trial", "tried", "survived", "of these", "s")
    for name, row in results.rows.items():
        counts = ", ".join(f"{count} {kind}" for kind, count in row.counts.items())
        table.add_row(name, str(row.tried), str(row.survived), counts, f"{row.seconds:.0f}")
    console.print(table)
    console.print(f"written: {options.out}")
    return 0 if results.survived else 1


def main() -> int:
    """Run the command."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with user_errors():
        return run(parse(Options, "benchmarks.torture", __doc__ or ""), Console())


if __name__ == "__main__":
    sys.exit(main())
