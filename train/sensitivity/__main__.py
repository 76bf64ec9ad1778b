"""Study how policies degrade under wrong information: ``python -m train.sensitivity``.

Load mass, rope length, E_R F_R, rope damping, period and phase of the waves, one at a time and all together. Writes
sensitivity.json (curves and Sobol indices), one_at_a_time.png, sobol.png and notes.md into the output folder.
"""

from __future__ import annotations

import sys
from dataclasses import asdict

from rich.progress import Progress

import aframe_env
import agents
from agents.drives import map as drive_map
from agents.drives.tuned import TUNED
from train.sensitivity.analysis import Sensitivity
from train.sensitivity.figures import draw_curves, draw_indices
from train.sensitivity.notes import notes
from train.sensitivity.study import MAP, Job, Options, assumed_scenarios, identity, still_rms, study
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.job_store import JobStore, version_of
from train.shared.jobs import run_jobs
from train.shared.run_folder import open_jobs, user_errors, write_json, write_text
from train.shared.tuned_drives import tune


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "train.sensitivity", __doc__ or ""), PlainConsole()
        if MAP in options.policies:
            drive_map.load(options.drive_map)
        opened = open_jobs(options, "train.sensitivity", "notes.md", seed=options.seed)
        folder = opened.folder
        assumed = assumed_scenarios(options)
        still = tuple(still_rms(assumed).tolist())
        names = [name for name in options.policies if name in TUNED]
        try:
            with Progress(console=console) as bars:
                tuned = tune(
                    names,
                    assumed,
                    options.config.duration,
                    opened.jobs,
                    optimiser=options.optimiser,
                    where=options,
                    progress=bars,
                )
                jobs = [Job(name, tuple(tuned.get(name, ())), still, options) for name in options.policies]
                with JobStore(opened.jobs, Sensitivity, version_of(aframe_env, agents)) as store:
                    studies = run_jobs(
                        study,
                        jobs,
                        identity,
                        store=store,
                        where=options,
                        progress=bars,
                        description="policies",
                    )
        except KeyboardInterrupt:
            console.print("interrupted: what is finished is kept; the same command goes on from there")
            return 130
        write_json(folder / "sensitivity.json", [asdict(each) for each in studies])
        draw_curves(folder / "one_at_a_time.png", studies)
        draw_indices(folder / "sobol.png", studies)
        text = notes(opened.command, options.number, studies)
        write_text(folder / "notes.md", text)
        opened.finish()
        console.print(text)
        console.print(f"written: {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
