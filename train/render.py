"""Draw the environment: ``python -m train.render`` (extra ``render``).

The drum stands still for the first half of the time; in the second it pays out as the pulley rises, so that the
picture's chart has the depth error without and with compensation.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.error import DependencyNotInstalled
from rich.console import Console

import aframe_env
from aframe_env import task
from aframe_env.scenario import ScenarioDistribution
from aframe_env.validation import InvalidValue, require_integer, require_number
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.run_folder import new_file, user_errors, write_atomically

_CATCH_UP = 0.5
"""Speed at which the rope paid out catches up with each metre of the pulley's heave, 1/s."""


@dataclass(frozen=True)
class Options:
    """The scenario and the moment."""

    out: Path | None = None
    """PNG to write; by default runs/environment-DATE-TIME.png."""
    overwrite: bool = False
    """Write the PNG even if there is one of that name."""
    scenario_seed: int = 1
    """Draws the sea and the rope's length."""
    time: float = 56.0
    """Moment of the picture, s."""
    hs: float = 3.5
    """Significant wave height, m."""

    def __post_init__(self) -> None:
        require_integer("scenario_seed", self.scenario_seed, low=0, high=2**63 - 1)
        require_number("time", self.time, "s", low=0.0, high=3600.0)
        require_number("hs", self.hs, "m", low=0.0, high=30.0)


def picture(options: Options) -> npt.NDArray[np.uint8]:
    """Run the environment up to the moment and return its picture, (height, width, 3)."""
    env: Any = gymnasium.make(
        aframe_env.ENV_ID,
        scenario=ScenarioDistribution(hs=options.hs, tp=(8.0, 11.0), rope_length=(150.0, 600.0)),
        episode_duration=max(options.time, 60.0),
        render_mode="rgb_array",
    ).unwrapped
    env.reset(seed=options.scenario_seed)
    try:
        env.render()  # the chart begins with the first picture
    except DependencyNotInstalled as error:
        raise InvalidValue(f"train.render: {error}") from None
    steps = round(options.time / env.control_period)
    radius = env.scenario.crane.winch.drum_radius
    for step in range(steps):
        state = env.simulation.state[0]
        # The pulley's velocity in the middle of the step that the command is held for.
        ahead = state[task.PULLEY_VELOCITY_Z] + 0.5 * env.control_period * state[task.PULLEY_ACCELERATION_Z]
        behind = state[task.PULLEY_HEAVE] - radius * state[task.DRUM_ANGLE]
        command = (ahead + _CATCH_UP * behind) / radius if 2 * step >= steps else 0.0
        env.step(np.clip([command], env.action_space.low, env.action_space.high).astype(np.float32))
    frame: npt.NDArray[np.uint8] = env.render()
    env.close()
    return frame


def run(options: Options, console: Console) -> int:
    """Draw and write."""
    from matplotlib.image import imsave

    out = new_file(
        options.out or Path("runs") / f"environment-{datetime.now():%Y%m%d-%H%M%S}.png", overwrite=options.overwrite
    )
    frame = picture(options)
    write_atomically(out, lambda temporary: imsave(temporary, frame))
    console.print(f"picture: {out}")
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.render", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
