"""Export an agent as ONNX: ``python -m train.export ppo-sensors --out DIR`` (extra ``onnx``).

The model has all of the controller in it: features, filters, base law, network, limits of the winch.
It is one step, readings, told values and state in, drum speed and state out, for ONNX Runtime on any machine. Writes
controller.onnx, controller.json (names, shapes, units) and episode.csv, a held-out lift with what the model commands.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console

from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.validation import InvalidValue, require_integer
from agents import shipped
from agents.learned import recurrent
from agents.learned.agent import LearnedPolicy, load
from agents.rollout import held_out_scenarios
from train.export.check import check
from train.export.episode import write_episode
from train.export.model import export
from train.shared.cli import parse
from train.shared.console import PlainConsole
from train.shared.run_folder import new_folder, user_errors, write_atomically, write_json

MODEL = "controller.onnx"
DESCRIPTION = "controller.json"
EPISODE = "episode.csv"


@dataclass(frozen=True, kw_only=True)
class Options:
    """The agent and the folder."""

    agent: Annotated[str, tyro.conf.Positional]
    """Name of a shipped agent, as ppo-sensors, or the folder of one."""
    out: Path | None = None
    """Output folder; by default runs/export-DATE-TIME."""
    overwrite: bool = False
    """Write into the output folder even if it has something in it."""
    check: int = 0
    """Run the model through so many held-out scenarios beside Python, and say how well they agree."""

    def __post_init__(self) -> None:
        require_integer("check", self.check, low=0, high=20_000)


def exportable(name: str) -> LearnedPolicy:
    """The agent. Raises InvalidValue where there is none, or one whose controller no model can hold."""
    folder = shipped.folder(name)
    if any(folder.glob(recurrent.CARD)) or any(folder.glob(f"seed-*/{recurrent.CARD}")):
        raise InvalidValue(
            f"agent = {name!r}: is a recurrent agent, whose filters and wave bank are not exported: must be one on "
            "features, as ppo-sensors"
        )
    agent = load(name)
    if agent.card.action == "predictive":
        raise InvalidValue(
            f"agent = {name!r}: corrects predictive control, which solves a quadratic programme at every step and does "
            "not go into ONNX; export one with the residual action, as aframe export ppo-sensors"
        )
    if agent.card.made_for.winch:
        raise InvalidValue(
            f"agent = {name!r}: has limits and lag of the winch among its features, which exported controllers do not "
            "take: must be trained with --no-winch"
        )
    sensors = agent.card.made_for.sensors
    if sensors is not None and sensors.motion_unit is not None:
        raise InvalidValue(
            f"agent = {name!r}: was trained with a motion_unit, whose heave filter exported controllers do not undo: "
            "must be trained with motion_unit = None"
        )
    return agent


def run(options: Options, console: Console) -> int:
    """Export, write, and check."""
    agent = exportable(options.agent)
    with console.status("exporting"):
        model, description = export(agent)
    folder = new_folder(
        options.out or Path("runs") / f"export-{datetime.now():%Y%m%d-%H%M%S}", overwrite=options.overwrite
    )
    write_atomically(folder / MODEL, lambda temporary: temporary.write_bytes(model.SerializeToString()))
    write_json(folder / DESCRIPTION, description)
    scenarios: list[Scenario] = held_out_scenarios(ScenarioDistribution(), max(1, options.check))
    write_episode(folder / EPISODE, agent, folder / MODEL, scenarios[0])
    console.print(f"controller: {folder / MODEL}")
    if options.check:
        with console.status(f"checking on {options.check} held-out scenarios"):
            agreement = check(agent, folder / MODEL, scenarios)
        milliseconds = 1e3 * agreement.seconds
        double, single = agreement.drum_speed, agreement.drum_speed_single
        console.print(
            f"{double.size} steps: the drum's speed differs from Python's by {double.max():.1e} of the winch's at most",
            f"with Python's network in single precision: by {single.max():.1e} at most, by more than 1e-6 in "
            f"{(single > 1e-6).mean():.2%} of the steps",
            f"depth error, root mean square: {agreement.rms.mean():.5f} m in the mean, Python by itself "
            f"{agreement.rms_python.mean():.5f} m",
            f"a step takes {np.median(milliseconds):.2f} ms in the median, {milliseconds.max():.2f} ms at most",
            sep="\n",
        )
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return run(parse(Options, "train.export", __doc__ or ""), PlainConsole())


if __name__ == "__main__":
    sys.exit(main())
