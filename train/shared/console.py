"""The console of the commands: no run is lost to a character that it has not, nor to a reader that goes away."""

from __future__ import annotations

import io
import os
import sys
from typing import Any

from rich.console import Console


def let_output_degrade() -> None:
    """Let standard output write ``?`` for what its encoding lacks, as cp1252 lacks Ω, instead of failing."""
    if isinstance(sys.stdout, io.TextIOWrapper):  # a notebook's own takes everything
        sys.stdout.reconfigure(errors="replace")


class PlainConsole(Console):
    """A console that prints text as it is: ``[/b]`` and ``:b:`` in the name of a folder are no markup."""

    def __init__(self) -> None:
        super().__init__(markup=False, emoji=False)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print, and leave it to the terminal where sentences are broken: a path in a pipe or a file stays whole."""
        sentences = all(isinstance(each, str) for each in objects)
        super().print(*objects, **{"soft_wrap": sentences, **options})

    def on_broken_pipe(self) -> None:
        """Say no more where nobody reads on, as behind ``| head``, and let the run go on to its files."""
        self.quiet = True
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
