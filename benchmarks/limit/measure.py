"""The C++ limit: its speed at 4096 rows, and how far its trajectory is from the package's."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from aframe_env import Crane, Harmonic, HarmonicMotion, Rope, Scenario, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.scenario.motion import Components
from benchmarks.limit.library import Limit
from benchmarks.peers.serve import Measurement, cores, serve, speed

FloatArray = npt.NDArray[np.float64]

ROWS: Final = 4096
PERIOD: Final = 0.1
SUBSTEPS: Final = 10
EPISODE: Final = 600
"""Control steps."""
TOLERANCE: Final = 1e-5
"""Greatest difference allowed of the load's place from the package's over an episode, m: the package's own
error of the pulley's path between its knots is of this order, the rest is rounding."""


def set_up(limit: Limit, scenario: Scenario) -> None:
    """Set the parameters of a scenario in all rows, the load hanging right below the pulley of a ship at rest."""
    crane = scenario.crane
    values = {
        "mass": scenario.load_mass,
        "gravity": scenario.gravity,
        "target": scenario.target_level,
        "axial_stiffness": crane.rope.axial_stiffness,
        "rope_damping": scenario.rope_damping,
        "free_length": scenario.free_length,
        "drum_to_pulley": crane.drum_to_pulley,
        "drum_radius": crane.winch.drum_radius,
        "max_speed": crane.winch.max_speed,
        "max_acceleration": crane.winch.max_acceleration,
        "load_position": np.array([*crane.pulley_position[:2], scenario.target_level]),
    }
    for name, value in values.items():
        limit.write(name, value)


def quintic(begin: FloatArray, end: FloatArray, duration: float) -> FloatArray:
    """Coefficients 0..5 of the quintics through value, rate and acceleration, (3, axes), at both ends: (axes, 6)."""
    t = duration
    matrix = np.array(
        [
            [1, 0, 0, 0, 0, 0],
            [0, 1, 0, 0, 0, 0],
            [0, 0, 2, 0, 0, 0],
            [1, t, t**2, t**3, t**4, t**5],
            [0, 1, 2 * t, 3 * t**2, 4 * t**3, 5 * t**4],
            [0, 0, 2, 6 * t, 12 * t**2, 20 * t**3],
        ]
    )
    return np.linalg.solve(matrix, np.concatenate([begin, end])).T


def compared_scenario() -> Scenario:
    """A ship that surges, sways and heaves: its pulley moves as its deck does.

    The winch is quick enough to slacken the rope, and has rope enough for any command; the rope does not part.
    """
    terms = (("surge", 0.8, 7.1, 0.3), ("sway", 0.6, 9.3, 1.9), ("heave", 1.1, 8.2, 4.0), ("heave", 0.3, 5.3, 0.7))
    return Scenario(
        crane=Crane(
            rope=Rope(breaking_load=1e9),
            winch=Winch(max_rope_acceleration=20.0, min_rope_length=1.0, max_rope_length=1e5),
        ),
        motion=HarmonicMotion(
            harmonics=tuple(Harmonic(coordinate=c, amplitude=a, period=p, phase=f) for c, a, p, f in terms)
        ),
        rope_damping=1.5e4,
        initial="rest",
    )


def pulley_paths(components: Components, pulley: tuple[float, float, float], steps: int) -> FloatArray:
    """Coefficients of the pulley's path in each control step, (steps, 18), from the motion's definition."""
    deck = components.at(PERIOD * np.arange(steps + 1))[:, :, :3]
    deck[0] += pulley
    return np.array([quintic(deck[:, k], deck[:, k + 1], PERIOD).ravel() for k in range(steps)])


def trajectories(dtype: type = np.float64, rows: int = 64) -> tuple[FloatArray, FloatArray]:
    """Load, (steps, rows, 3) m, of the C++ limit and of the engine: random commands that exceed the winch's limits.

    Some rows are told so much that their rope goes slack.
    """
    scenario = compared_scenario()
    limit = Limit(rows, SUBSTEPS, PERIOD, dtype)
    engine = Engine(rows, PERIOD, max_inner_step=PERIOD / SUBSTEPS)
    set_up(limit, scenario)
    for row in range(rows):
        engine.reset_row(row, scenario)
    assert isinstance(scenario.motion, HarmonicMotion)
    paths = pulley_paths(scenario.motion.components(), scenario.crane.pulley_position, EPISODE)
    limit.write("load_position", engine.read_many(at.LOAD_POSITION, 3))
    rng = np.random.default_rng(0)
    most = np.linspace(0.1, 1.5, rows) * scenario.crane.winch.max_speed
    theirs, ours = np.empty((EPISODE, rows, 3)), np.empty((EPISODE, rows, 3))
    for k in range(EPISODE):
        commands = most * rng.uniform(-1.0, 1.0, rows)
        limit.write("path", paths[k])
        limit.step(commands.astype(dtype))
        engine.step(commands)
        theirs[k], ours[k] = limit.read("load_position"), engine.read_many(at.LOAD_POSITION, 3)
    return theirs, ours


def deviation() -> Measurement:
    """Greatest difference of the load's place from the package's over an episode, m."""
    theirs, ours = trajectories()
    return lambda: float(np.abs(theirs - ours).max())


def steps(dtype: type) -> Measurement:
    """Time control steps in which each row's pulley goes round one and the same closed quintic."""
    scenario = compared_scenario()
    limit = Limit(ROWS, SUBSTEPS, PERIOD, dtype, threads=cores())
    set_up(limit, scenario)
    path = np.zeros((3, 6))
    path[:, 0] = scenario.crane.pulley_position
    path[2, 2:5] = np.array([1.0, -2.0 / PERIOD, 1.0 / PERIOD**2]) * 0.01  # 0.01 t² (1 - t/T)²
    limit.write("path", path.ravel())
    commands = np.random.default_rng(0).uniform(-1.0, 1.0, ROWS).astype(dtype)
    return speed(lambda: limit.step(commands), ROWS)


if __name__ == "__main__":
    serve({"double": partial(steps, np.float64), "float": partial(steps, np.float32), "deviation": deviation})
