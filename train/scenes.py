"""Draw one telling scenario of each task: ``python -m train.scenes --tasks Storm --out results/tasks``.

Of the first validation scenarios the one that has the law's share of the ceiling in the middle of its worse half: hard,
but no freak. What the load does is drawn under a drum left still, under the law, an agent and the best drum commands,
and beneath it what the drum does. Writes TASK/scene.png.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.console import Console

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.scenario.sea import SeaMotion
from aframe_env.suite import TASKS, Task, find_task
from aframe_env.validation import InvalidValue, require_integer
from agents import shipped
from agents.registry import DRUM_STILL, OPTIMUM, choose_all
from agents.rollout import Episodes
from train.benchmark.specialists import specialists
from train.evaluate.figure import COLOURS, GREY
from train.evaluate.run import run_on
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.run_folder import user_errors, write_atomically

PICTURE: Final = "scene.png"
LONG: Final = 32
"""Letters of a name beyond which not all fit beside each other."""
LAWS: Final[Mapping[str, str]] = {"Splash": "predictive control"}
LAW: Final = "adaptive predictive control"
"""Best hand-written law on sensors of these tasks, and of all others."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Tasks whose scenes are drawn."""

    tasks: tuple[str, ...] = tuple(TASKS)
    """Tasks of the suite, by name."""
    scenarios: int = 20
    """Validation scenarios to choose from."""
    out: Path = Path("runs/scenes")
    """Folder that has a folder for each task."""

    def __post_init__(self) -> None:
        require_integer("scenarios", self.scenarios, low=1, high=1000)
        if not self.tasks:
            raise InvalidValue(f"tasks = (): must be one or more of {', '.join(map(repr, TASKS))}")
        for name in self.tasks:
            find_task(name)


@dataclass(frozen=True)
class Scene:
    """A scenario, and what happened in it under each policy, the drum left still first and the best commands last."""

    task: Task
    number: int
    """Of the validation scenarios."""
    scenario: Scenario
    runs: dict[str, Episodes]

    def share(self, name: str) -> float:
        """Share of the ceiling that a policy had in it."""
        still, best = self.runs[DRUM_STILL.name].rms[0], self.runs[OPTIMUM.name].rms[0]
        return float((still - self.runs[name].rms[0]) / (still - best))


def find_scene(task: Task, count: int, console: Console | None = None) -> Scene:
    """Run best law, agent and optimum in so many validation scenarios of a task, and choose its scene among them.

    The agent is the recurrent one that was trained on the task, or another where there is none.
    """
    scenarios = task.scenarios("validation", count)
    trained = specialists(task, "sensors")
    agents = [name for name in trained if name in shipped.RECURRENT] or trained
    specs = [*choose_all([LAWS.get(task.name, LAW), *agents]), OPTIMUM]
    seed = task.seed("validation")
    ran = run_on(specs, TaskConfig(**task.arguments), scenarios, console or PlainConsole(), seed=seed)
    still, law, *_, best = (entry.episodes.rms for entry in ran.entries)
    order = np.argsort((still - law) / (still - best))
    number = int(order[len(order) // 4])
    runs = {entry.policy: entry.episodes.rows(slice(number, number + 1)) for entry in ran.entries}
    return Scene(task, number, scenarios[number], runs)


def draw(path: Path, scene: Scene) -> None:
    """Draw depth errors, rope speeds and, where the task tells of contact or slack, tensions over time."""
    measures = bool(scene.task.measures)
    heights = [0.7, 1.4, 1.0, 1.0] if measures else [0.7, 1.4, 1.0]
    figure = Figure(figsize=(10.0, 2.4 * len(heights)), layout="constrained")
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    last = len(scene.runs) - 1
    radius = scene.scenario.crane.drum_radius(scene.scenario.free_length)
    for place, (name, episodes) in enumerate(scene.runs.items()):
        times = episodes.control_period * np.arange(episodes.error.shape[1])
        style: dict[str, Any] = {"color": COLOURS[(place - 1) % len(COLOURS)], "lw": 1.6}
        if place in (0, last):
            style = {"color": GREY, "lw": 1.4} if place == 0 else {"color": "#222222", "lw": 1.0, "ls": "--"}
        label = f"{name}: {100 * scene.share(name):.1f} %" if 0 < place < last else name
        panels[min(place, 1)].plot(times, episodes.error[0], label=label, **style)
        if place:
            panels[2].plot(times, radius * episodes.drum_speed[0], **style)
        if measures:
            panels[3].plot(times, episodes.tension[0] / 1e6, **style)
    _label(figure, panels, scene)
    write_atomically(path, lambda temporary: figure.savefig(temporary, dpi=120))


def _label(figure: Figure, panels: Sequence[Axes], scene: Scene) -> None:
    scenario = scene.scenario
    winch, motion = scenario.crane.winch, scenario.motion
    for axis, what in zip(
        panels, ("depth error, m", "depth error, m", "rope paid out, m/s", "tension, MN"), strict=False
    ):
        axis.set_ylabel(what)
        axis.grid(alpha=0.3)
        axis.set_xlim(0.0, scene.task.episode_duration)
    for limit in (-winch.max_rope_speed, winch.max_rope_speed):
        panels[2].axhline(limit, color="#c44e52", lw=0.8, ls=":")
    panels[-1].set_xlabel("time, s")
    if len(panels) > 3:
        panels[3].set_ylim(bottom=0.0)
    sea = f"Hs {motion.sea.hs:.1f} m, Tp {motion.sea.tp:.1f} s; " if isinstance(motion, SeaMotion) else ""
    panels[0].set_title(
        f"{scene.task.name}, validation scenario {scene.number}: {sea}{scenario.load_mass / 1e3:.0f} t on "
        f"{scenario.rope_length:.0f} m; winch {winch.max_rope_speed:.1f} m/s (dotted), "
        f"{winch.max_rope_acceleration:.1f} m/s²",
        fontsize=10,
    )
    columns = 4 if max(map(len, scene.runs)) <= LONG else 2
    figure.legend(loc="outside lower center", ncols=columns, frameon=False, title="in per cent: share of the ceiling")


def main() -> int:
    """Run the command."""
    with user_errors():
        options = parse(Options, "train.scenes", __doc__ or "")
        console: Console = PlainConsole()
        for name in options.tasks:
            task = find_task(name)
            scene = find_scene(task, options.scenarios, console)
            path = options.out / task.name.lower() / PICTURE
            path.parent.mkdir(parents=True, exist_ok=True)
            draw(path, scene)
            shares = ", ".join(f"{policy} {scene.share(policy):.1%}" for policy in scene.runs)
            console.print(f"{path}: scenario {scene.number}; {shares}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
