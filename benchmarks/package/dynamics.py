"""The engine's control step alone, without the task: ``Engine.step`` with and without a sea."""

from __future__ import annotations

from functools import partial

import numpy as np

from aframe_env import Scenario
from aframe_env.engine import Engine
from aframe_env.scenario.motion import Components, HarmonicMotion, ShipMotion
from benchmarks.peers import synthetic
from benchmarks.peers.serve import Measurement, serve, speed

ROWS = 4096
PERIOD = 0.1
INNER_STEP = 0.01


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
    made = engine(rows, motion)
    commands = np.random.default_rng(0).uniform(-1.0, 1.0, rows)
    return speed(lambda: made.step(commands), rows)


if __name__ == "__main__":
    serve(
        {
            "sea": partial(steps, ROWS, SyntheticMotion()),
            "calm": partial(steps, ROWS, HarmonicMotion()),
            "one-row": partial(steps, 1, SyntheticMotion()),
        }
    )
