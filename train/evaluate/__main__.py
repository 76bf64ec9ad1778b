"""Compare policies on the same held-out scenarios: ``python -m train.evaluate --policies ppo S-Ω1``.

A policy is a name ("S-Ω1", or s-omega1 on a keyboard without Ω; "ppo-sensors" and "drive-map" are shipped), the folder
of an agent or a drive map, or module:function for your own: see ``agents.registry``. The drum left alone is always
there as the yardstick. Writes the table (Markdown, JSON, PNG), every episode (CSV, Parquet), and report.html: one page
with figures, pictures and the worst cases, which opens in any browser, offline.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from importlib.util import find_spec

from aframe_env.validation import InvalidValue
from agents.registry import choose_all
from train.evaluate.run import AFTER_TRAINING, HeldOut, require_period, run_all, write
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.jobs import Where
from train.shared.run_folder import RunOptions, open_jobs, user_errors

REPORT_PACKAGES = ("jinja2", "plotly", "pyarrow")


def needed_for_the_report() -> str:
    """What the report still needs, and the command that helps; empty where it needs nothing."""
    missing = [name for name in REPORT_PACKAGES if find_spec(name) is None]
    return f'{", ".join(missing)} not installed: pip install "aframe-heave[report]"' if missing else ""


@dataclass(frozen=True, kw_only=True)
class Options(RunOptions, Where, HeldOut):
    """Policies, and the held-out scenarios that they meet."""

    policies: tuple[str, ...] = (
        "predictive-ppo",
        "predictive-ppo-sensors",
        "ppo",
        "sac",
        "ppo-sensors",
        "sac-sensors",
        "ppo-speed",
        "sac-speed",
        "drive-map",
        "drive-map:clock",
        *AFTER_TRAINING,
        "output zero",
        "output zero on sensors",
        "predictive control (state)",
        "predictive control",
        "inverse dynamics",
    )
    """Names, or folders of agents (of all seeds, where there are several) or of drive maps, or module:function."""
    report: bool = not needed_for_the_report()
    """Write report.html and episodes.parquet too; by default where the extra "report" is installed."""

    def __post_init__(self) -> None:
        Where.__post_init__(self)
        HeldOut.__post_init__(self)
        needed = needed_for_the_report()
        if self.report and needed:
            raise InvalidValue(f"report = True: {needed}, or pass --no-report")


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "train.evaluate", __doc__ or ""), PlainConsole()
        choices = choose_all(options.policies)
        require_period(choices, options.config.control_period)
        opened = open_jobs(options, "train.evaluate", "comparison.json")
        folder = opened.folder
        try:
            comparison = run_all(choices, options, console, jobs=opened.jobs, where=options)
            write(folder, comparison, console)
            if options.report:
                # Imported late: they need the extra.
                from train.evaluate.episode_table import write_episodes
                from train.evaluate.report.html import write_report

                write_episodes(folder / "episodes.parquet", comparison)
                console.print(f"every episode: {folder / 'episodes.parquet'}")
                with console.status("writing the report"):
                    write_report(folder / "report.html", comparison, opened.command)
                console.print(f"report: {folder / 'report.html'}")
            elif needed := needed_for_the_report():
                console.print(f"no report: {needed}")
        except KeyboardInterrupt:
            console.print("interrupted: what is finished is kept; the same command goes on from there")
            return 130
        opened.finish()
    return 0


if __name__ == "__main__":
    sys.exit(main())
