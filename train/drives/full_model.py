"""The transfer of section 4: drives found on the simplified model, run in the full one."""

from __future__ import annotations

from collections.abc import Callable

from aframe_env.rfem.simulate import Drum, DynamicCase, PrescribedDrum, StillDrum, simulate
from aframe_env.scenario import Scenario
from agents.drives.functions import Drive
from agents.policy import FloatArray
from train.drives.results import Result, Transfer

STEP = 2.5e-3
OUTPUT_INTERVAL = 0.01


def transfer(scenario: Scenario, duration: float, result: Result) -> Transfer:
    """Run a drive, or the drum still, in the full model for ``duration`` s; the drum follows the drive exactly."""
    case = DynamicCase(
        scenario=scenario,
        drum=StillDrum() if result.drive is None else _prescribed(result.drive),
        duration=duration,
        step=STEP,
        output_interval=OUTPUT_INTERVAL,
    )
    run = simulate(case)
    return Transfer(run.time, run.load[:, 2] - scenario.target_level)


def _prescribed(drive: Drive) -> Drum:
    def at(function: Callable[[float], FloatArray]) -> Callable[[float], float]:
        return lambda time: float(function(min(time, drive.duration)))

    return PrescribedDrum(angle=at(drive.angle), rate=at(drive.speed))
