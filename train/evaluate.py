"""Compare a trained agent with the drives on held-out scenarios: ``python -m train.evaluate --agent results/ppo``.

The same comparison as at the end of a training, on the simplified or the full model.
"""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal

from rich.console import Console

from aframe_env.flexible_engine import mesh_of
from aframe_env.validation import require_integer
from agents.drive_map import load as load_map
from agents.learned import load
from train.config import parse, to_toml
from train.held_out import evaluate
from train.output import new_folder, user_errors, versions, write_json, write_text


@dataclass(frozen=True)
class Options:
    """Which agent, on what."""

    agent: Path = Path("results/ppo")
    """Folder of the agent."""
    model: Literal["simplified", "rfem"] = "simplified"
    """Model that the policies run on; drives are optimised on the simplified one."""
    rfem_modes: int | None = None
    """With rfem, the number of natural modes to keep; all by default."""
    scenarios: int = 200
    """Held-out scenarios."""
    privileged: int = 20
    """The first so many of them for the drives that are optimised with the whole future known."""
    drive_map: Path | None = None
    """Folder of a drive map, such as results/drive-map, to run as well."""
    out: Path | None = None
    """Output folder; by default runs/evaluate-DATE-TIME."""
    overwrite: bool = False
    """Write into the output folder even if it has something in it."""

    def __post_init__(self) -> None:
        mesh_of(self.model, None, self.rfem_modes)
        require_integer("scenarios", self.scenarios, low=1, high=10**6)
        require_integer("privileged", self.privileged, low=0, high=self.scenarios)


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, __doc__ or ""), Console()
        policy = load(options.agent)
        stored = None if options.drive_map is None else load_map(options.drive_map)
        folder = new_folder(
            options.out or Path("runs") / f"evaluate-{datetime.now():%Y%m%d-%H%M%S}", overwrite=options.overwrite
        )
        write_text(folder / "config.toml", to_toml(options))
        command = shlex.join(["python", "-m", "train.evaluate", *sys.argv[1:]])
        write_json(folder / "run.json", {"command": command, "versions": versions()})
        try:
            evaluate(
                policy,
                folder,
                options.scenarios,
                options.privileged,
                console,
                model=options.model,
                rfem_modes=options.rfem_modes,
                drive_map=stored,
            )
        except KeyboardInterrupt:
            console.print("interrupted: no comparison was written")
            return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
