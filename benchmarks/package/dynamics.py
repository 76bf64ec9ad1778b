"""The engine's control step alone, without the task: ``Engine.step`` with and without a sea."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from aframe_env import (
    LOADS,
    Compensator,
    Crane,
    Rope,
    Scenario,
    Sea,
    Seabed,
    SeaMotion,
    TargetPath,
    Water,
    Winch,
)
from aframe_env.engine import Engine
from aframe_env.scenario.motion import Components, HarmonicMotion, ShipMotion
from benchmarks.peers import synthetic
from benchmarks.peers.serve import Measurement, serve, speed

ROWS = 4096
PERIOD = 0.1
INNER_STEP = 0.01
DEEP_ROWS = 1024


class SyntheticMotion:
    """The deck's motion that the peers are given."""

    def components(self) -> Components:
        return Components(*synthetic.components())


def engine(rows: int, motion: ShipMotion) -> Engine:
    """Rows of the paper's crane and load on a moving ship, or on one at rest."""
    made = Engine(rows, PERIOD, components=0, max_inner_step=INNER_STEP)
    vector = made.row_vector(Scenario(motion=motion, rope_damping=1.5e4))
    for row in range(rows):
        made.write_row(row, vector)
    return made


def steps(rows: int, motion: ShipMotion) -> Measurement:
    return stepping(engine(rows, motion), rows)


def stepping(made: Engine, rows: int) -> Measurement:
    commands = np.random.default_rng(0).uniform(-1.0, 1.0, rows)
    return speed(lambda: made.step(commands), rows)


def deep(kind: str) -> Measurement:
    """Rows with 100 t at 1,000 m in a sea, the inner step as by default."""
    scenario = Scenario(motion=SeaMotion(sea=Sea(hs=2.0, tp=9.0)), load_mass=100e3, target_level=-1000.0)
    if kind == "heavy":
        scenario = replace(scenario, crane=Crane(rope=Rope.six_strand()), water=Water(waves=False))
    elif kind == "everything":
        scenario = replace(
            scenario,
            crane=Crane(
                rope=Rope.six_strand(),
                winch=Winch(max_power=1e7, max_torque=2e6, inertia=5e4, drum_width=3.0),
                sheave_friction=0.02,
                compensator=Compensator(damping=2e5),
            ),
            water=Water(current=((0.0, 0.5, 0.1), (500.0, 0.1, 0.2)), seabed=Seabed(depth=1100.0)),
            load=LOADS["manifold"].shape,
            target_path=TargetPath.lowering(-50.0, 0.5),
        )
    made = Engine(DEEP_ROWS, PERIOD)
    vector = made.row_vector(scenario)
    for row in range(DEEP_ROWS):
        made.write_row(row, vector)
    return stepping(made, DEEP_ROWS)


if __name__ == "__main__":
    serve(
        {
            "sea": partial(steps, ROWS, SyntheticMotion()),
            "calm": partial(steps, ROWS, HarmonicMotion()),
            "one-row": partial(steps, 1, SyntheticMotion()),
            **{f"deep-{kind}": partial(deep, kind) for kind in ("massless", "heavy", "everything")},
        }
    )
