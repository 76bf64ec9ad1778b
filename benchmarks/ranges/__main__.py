"""Sweep every documented range to its ends: ``python -m benchmarks.ranges``.

Environments of random cranes, motions, tasks and sensors are stepped, reset, saved, restored and copied, vectors and
tensors beside single rows, until so many steps of a row are made. The first that is not finite, not in its space, or
not the same alone as among others, ends the command with what leads there.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

from hypothesis import HealthCheck, Phase, Verbosity, seed, settings
from hypothesis.stateful import run_state_machine_as_test
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from aframe_env.validation import require_integer
from benchmarks.ranges.machine import Rows, Tensors
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.run_folder import user_errors


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of the command."""

    steps: int = 1_000_000
    """Steps of a row to make."""
    seed: int = 0
    """Of the first batch of machines; each further one takes the next."""

    def __post_init__(self) -> None:
        require_integer("steps", self.steps, low=1, high=10**12)
        require_integer("seed", self.seed, low=0, high=2**31)


BATCH = settings(
    max_examples=50,
    stateful_step_count=20,
    deadline=None,
    database=None,
    verbosity=Verbosity.normal,
    phases=(Phase.generate, Phase.shrink),
    suppress_health_check=list(HealthCheck),
    print_blob=False,
)


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "benchmarks.ranges", __doc__ or ""), PlainConsole()
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        with Progress(*columns, console=console) as progress:
            bar = progress.add_task("steps", total=options.steps)
            batch = options.seed
            count = Rows.count
            while count.steps < options.steps:
                progress.update(bar, description=f"steps, seed {batch}")
                for machine in (Rows, Tensors):
                    run_state_machine_as_test(seed(batch)(machine), settings=BATCH)
                progress.update(bar, completed=count.steps)
                batch += 1
        said = ", ".join(f"{begun} on the model {model!r}" for model, begun in count.episodes.items())
        console.print(f"{count.steps} steps clean, seeds {options.seed} to {batch - 1}; episodes: {said}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
