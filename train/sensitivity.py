"""How policies degrade when things are not what they were told: ``python -m train.sensitivity``.

Load mass, rope length, E_R F_R, rope damping, period and phase of the waves, one at a time and all together. Writes
sensitivity.json (curves and Sobol indices), one_at_a_time.png, sobol.png and notes.md into the output folder.
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress

from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.validation import InvalidValue, require_choice, require_integer
from agents.drives import map as drive_map
from agents.drives.map_policy import DriveMapPolicy
from agents.drives.optimisation import OPTIMISERS, OptimisedDrive, Optimiser
from agents.drives.policy import DrivePolicy
from agents.drives.tuned import TUNED
from agents.policy import DrumStill, FloatArray, Knowledge, Policy
from agents.registry import BuildContext, choose
from agents.rollout import held_out_scenarios, run
from train.config import parse, to_toml
from train.output import new_folder, user_errors, versions, write_json, write_text
from train.sensitivity_study.analysis import Sensitivity, analyse
from train.sensitivity_study.factors import FACTORS
from train.sensitivity_study.figures import draw_curves, draw_indices
from train.tasks import run_tasks
from train.tuned_drives import DURATION, tune

STILL, MAP = "drum still", "drive map"


@dataclass(frozen=True)
class Options:
    """Which policies, in how many scenarios."""

    policies: tuple[str, ...] = (
        STILL,
        *TUNED,
        MAP,
        "feed-forward + feedback",
        "results/agents/ppo",
        "results/agents/sac",
        "results/agents/ppo-sensors",
        "results/agents/sac-sensors",
    )
    """"drum still", "S-Ω1", "S-Ω2", "H-Ω1", "H-Ω2", "drive map", or the folder of an agent."""
    scenarios: int = 8
    """Held-out random seas that are assumed."""
    points: int = 9
    """Values of each factor, one at a time."""
    samples: int = 128
    """Base samples of the Sobol indices, a power of two: 8 times as many combinations, in every assumed scenario."""
    drive_map: Path = Path("results/drive-map")
    """Folder of the drive map."""
    optimiser: Optimiser = "nelder-mead"
    """What tunes the drives for Ω1."""
    seed: int = 0
    """Draws the Sobol samples."""
    workers: int | None = None
    """Worker processes; by default one for each core."""
    out: Path | None = None
    """Output folder; by default runs/sensitivity-DATE-TIME."""
    overwrite: bool = False
    """Write into the output folder even if it has something in it."""

    def __post_init__(self) -> None:
        if not self.policies or len(set(self.policies)) < len(self.policies):
            raise InvalidValue(f"policies = {self.policies}: must be at least one, each named once")
        require_integer("scenarios", self.scenarios, low=1, high=10_000)
        require_integer("points", self.points, low=2, high=1001)
        require_integer("samples", self.samples, low=2, high=2**20)
        if self.samples & (self.samples - 1):
            raise InvalidValue(f"samples = {self.samples}: must be a power of two in [2, 1048576]")
        require_choice("optimiser", self.optimiser, OPTIMISERS)
        require_integer("seed", self.seed, low=0, high=2**32 - 1)
        for name in self.policies:
            if name not in (STILL, MAP, *TUNED) and choose(name).for_each_scenario:
                raise InvalidValue(f"policies: {name!r}: is optimised for each scenario as S-Ω1 and its like are here")


@dataclass(frozen=True)
class Task:
    """One policy's share of the study."""

    name: str
    drives: tuple[OptimisedDrive, ...]
    """Tuned for the assumed scenarios, if the policy follows such."""
    still: tuple[float, ...]
    """RMS depth error with the drum still in the assumed scenarios, m."""
    options: Options


def _policy(task: Task) -> Policy:
    if task.name == STILL:
        return DrumStill()
    if task.name == MAP:
        return DriveMapPolicy(drive_map.load(task.options.drive_map), None)
    if task.name in TUNED:
        return DrivePolicy(task.name, task.drives, Knowledge.FUTURE)
    scenarios = assumed_scenarios(task.options)
    setting = BuildContext(
        scenarios=scenarios, nominal=ScenarioDistribution().nominal(), episode_duration=DURATION, observation="state"
    )
    return choose(task.name).build(setting)


def study(task: Task) -> Sensitivity:
    """Everything about one policy."""
    options = task.options
    assumed = assumed_scenarios(options)
    return analyse(_policy(task), assumed, np.array(task.still), options.points, options.samples, options.seed)


def assumed_scenarios(options: Options) -> list[Scenario]:
    """What the policies are told."""
    return held_out_scenarios(ScenarioDistribution(), options.scenarios)


TEXT = """\
# What becomes of policies that were told wrongly
Made by `{command}`.

{scenarios} held-out random seas are assumed. Every policy that goes by the clock (the drives, and the drive map) is
told its assumed scenario in full, waves and phases included, and then meets another one; the agents are told mass and
rope length, and measure the rest. Figures are RMS depth errors over that of the drum left still in the assumed
scenario, so that what the scenario itself does is in them too: see the drum still.

## As assumed, at both ends of each range, and over all ranges at once
Median over the assumed scenarios; the last columns are median, 95 % quantile and worst case when all factors vary
together over their ranges.

{ends}
## Sobol indices: first order / total
Shares of the variance of the decimal logarithm (mean over the assumed scenarios) when all factors vary together. A
factor whose total is well above its first order acts through others.

{indices}
"""


def _table(rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]]) + "\n"


def notes(command: str, options: Options, studies: Sequence[Sensitivity]) -> str:
    """Text of notes.md."""
    ranges = [f"{factor.name} {factor.low:.3g} … {factor.high:.3g}" for factor in FACTORS]
    ends = [["policy", "as assumed", *ranges, "all: median", "95 %", "worst"]]
    indices = [["policy", *(factor.name for factor in FACTORS)]]
    for each in studies:
        middle = np.median([_at(c.values, c.left, f.assumed) for c, f in zip(each.curves, FACTORS, strict=True)])
        cells = [" … ".join(f"{np.median(c.left[end]):.3g}" for end in (0, -1)) for c in each.curves]
        ends.append(
            [each.policy, f"{middle:.3g}", *cells, f"{each.median:.3g}", f"{each.high:.3g}", f"{each.worst:.3g}"]
        )
        shares = [f"{max(0.0, index.first):.2f} / {index.total:.2f}" for index in each.indices]
        indices.append([each.policy, *shares])
    return TEXT.format(command=command, scenarios=options.scenarios, ends=_table(ends), indices=_table(indices))


def _at(values: Sequence[float], left: Sequence[Sequence[float]], place: float) -> float:
    return float(np.median(left[int(np.argmin(np.abs(np.array(values) - place)))]))


def _still(assumed: Sequence[Scenario]) -> FloatArray:
    return run(DrumStill(), assumed).rms


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, __doc__ or ""), Console()
        if MAP in options.policies:
            drive_map.load(options.drive_map)
        folder = new_folder(
            options.out or Path("runs") / f"sensitivity-{datetime.now():%Y%m%d-%H%M%S}", overwrite=options.overwrite
        )
        assumed = assumed_scenarios(options)
        still = tuple(_still(assumed).tolist())
        names = [name for name in options.policies if name in TUNED]
        try:
            with Progress(console=console) as bars:
                tuned = tune(names, assumed, optimiser=options.optimiser, workers=options.workers, progress=bars)
                tasks = [Task(name, tuple(tuned.get(name, ())), still, options) for name in options.policies]
                studies = run_tasks(study, tasks, workers=options.workers, progress=bars, description="policies")
        except KeyboardInterrupt:
            console.print("interrupted: nothing was written")
            return 130
        command = shlex.join(["python", "-m", "train.sensitivity", *sys.argv[1:]])
        write_json(folder / "sensitivity.json", [asdict(each) for each in studies])
        write_json(folder / "run.json", {"command": command, "seed": options.seed, "versions": versions()})
        write_text(folder / "config.toml", to_toml(options))
        draw_curves(folder / "one_at_a_time.png", studies)
        draw_indices(folder / "sobol.png", studies)
        text = notes(command, options, studies)
        write_text(folder / "notes.md", text)
        console.print(text, soft_wrap=True, markup=False)
        console.print(f"written: {folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
