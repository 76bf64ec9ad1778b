"""A drum with inertia under torque: against SciPy's DOP853 on the same equations, limits, brake and energy."""

from __future__ import annotations

import math

import numpy as np
import oracle
import pytest

from aframe_env import Crane, Rope, Scenario, Sea, SeaMotion, TorqueDrive, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine

PERIOD = 0.1
RADIUS = 0.75
STRONG = Rope(breaking_load=1e9)


def lift(
    drive: TorqueDrive | None, depth: float = 300.0, hs: float = 2.0, damping: float = 1e5, **more: float
) -> Scenario:
    """100 t under a ship in waves."""
    return Scenario(
        crane=Crane(winch=Winch(drive=drive, **more), rope=STRONG),
        motion=SeaMotion(sea=Sea(hs=hs, tp=9.0, heading=2.5, seed=4)),
        target_level=-depth,
        rope_damping=damping,
    )


SLOTS = (
    *(at.LOAD_POSITION + k for k in range(3)),
    *(at.LOAD_VELOCITY + k for k in range(3)),
    at.DRUM_ANGLE,
    at.DRUM_SPEED,
    at.TENSION,
    at.DRIVE_TORQUE,
    at.DRIVE_POWER,
    at.SLACK,
)
ANGLE, SPEED, TENSION, TORQUE, POWER, SLACK = range(6, 12)


def run(scenario: Scenario, commands: oracle.FloatArray, max_inner_step: float | None = None) -> oracle.FloatArray:
    """Slots (T + 1, 12) of one row."""
    engine = Engine(1, PERIOD, max_inner_step=max_inner_step)
    engine.reset_row(0, scenario)
    out = [[engine.read(slot)[0] for slot in SLOTS]]
    for command in commands:
        engine.step(np.array([command]))
        out.append([engine.read(slot)[0] for slot in SLOTS])
    return np.array(out)


class Coupled:
    """Load, drum, speed loop and filter, from their equations; the brake up."""

    def __init__(self, scenario: Scenario, commands: oracle.FloatArray) -> None:
        winch = scenario.crane.winch
        assert winch.drive is not None
        self.scenario, self.drive = scenario, winch.drive
        self.set_drum, self.kinks = oracle.winch(
            commands, PERIOD, winch.max_rope_speed / RADIUS, winch.max_rope_acceleration / RADIUS, winch.lag
        )
        motion = oracle.of_components(scenario.motion.components())
        self.pulley = oracle.pulley(motion, scenario.crane.pulley_position)
        self.times = np.arange(len(commands) + 1) * PERIOD

    def rope(self, t: float, y: oracle.FloatArray) -> tuple[float, tuple[float, ...], float]:
        """Tension, force on the load, and torque on the drum with the strain energy that rope takes along."""
        angle, speed = float(y[6]), float(y[7])
        tension, *force = oracle.forces(t, y, self.scenario, self.pulley, lambda _: (angle, speed))
        axial = self.scenario.crane.rope.axial_stiffness
        length = oracle.free_length(self.scenario) + RADIUS * angle
        reach = float(np.linalg.norm(y[:3] - self.pulley(t)[:3])) + oracle.behind_pulley(self.scenario)
        elastic = max(0.0, axial / length * (reach - length))
        return tension, tuple(force), RADIUS * (tension + elastic**2 / (2.0 * axial))

    def torques(self, t: float, y: oracle.FloatArray) -> tuple[float, float, float]:
        """Torque asked of the motors, what they give, and what comes through the gear, N m at the drum."""
        drive, speed = self.drive, float(y[7])
        proportional = 2.0 * drive.damping_ratio * drive.bandwidth * drive.inertia
        measured = float(y[9]) if drive.tension_filter else self.rope(t, y)[0]
        relief = drive.tension_feedforward * RADIUS * measured
        asked = proportional * (self.set_drum(t)[1] - speed) + float(y[8]) - relief
        most = drive.gear_ratio * min(drive.motor_torque, drive.motor_power / max(abs(speed) * drive.gear_ratio, 1e-9))
        given = min(max(asked, -most), most)
        # From lowering to hoisting, or the other way, within some centimetres a second.
        way = speed / math.hypot(speed, 0.02 / RADIUS)
        sense = math.copysign(way, given * way) if given else 0.0
        motoring, generating = drive.hoisting_efficiency, 1.0 / drive.lowering_efficiency
        return asked, given, given * (0.5 * (1.0 + sense) * motoring + 0.5 * (1.0 - sense) * generating)

    def slope(self, t: float, y: oracle.FloatArray) -> list[float]:
        drive, mass = self.drive, self.scenario.load_mass
        tension, force, pull = self.rope(t, y)
        asked, given, torque = self.torques(t, y)
        integral_gain = drive.bandwidth**2 * drive.inertia
        error = self.set_drum(t)[1] - float(y[7])
        unwinding = (given - asked) * drive.bandwidth / (2.0 * drive.damping_ratio)
        filtering = (tension - y[9]) / drive.tension_filter if drive.tension_filter else 0.0
        return [
            *y[3:6],
            force[0] / mass,
            force[1] / mass,
            force[2] / mass - self.scenario.gravity,
            y[7],
            (pull + torque) / drive.inertia,
            integral_gain * error + unwinding,
            filtering,
        ]

    def solve(self) -> oracle.FloatArray:
        """States (T, 10)."""
        tip, scenario = self.pulley(0.0), self.scenario
        start = np.zeros(10)
        start[:6] = tip
        start[2] -= scenario.crane.pulley_position[2] - scenario.target_level
        tension, _, pull = self.rope(0.0, start)
        drive = self.drive
        mean = 0.5 * (drive.hoisting_efficiency + 1.0 / drive.lowering_efficiency)
        start[8] = drive.tension_feedforward * RADIUS * tension - pull / mean
        start[9] = tension
        return oracle.integrate(self.slope, self.times, start, self.kinks, max_step=0.02)


def hard(seed: int, steps: int) -> oracle.FloatArray:
    """Commands (steps,) rad/s held for half a second each, up to the limit of 4."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-4.0, 4.0, -(-steps // 5)), 5)[:steps]


@pytest.mark.parametrize(
    ("drive", "depth", "step"),
    [
        (TorqueDrive(), 300.0, None),
        (TorqueDrive(tension_feedforward=0.0), 300.0, None),
        (TorqueDrive(tension_filter=0.0, hoisting_efficiency=1.0, lowering_efficiency=1.0), 1000.0, None),
        (TorqueDrive(motor_torque=2.2e4, motor_power=2.5e6), 300.0, 2.5e-3),
    ],
    ids=["default", "without-feed-forward", "unfiltered-without-losses", "at-its-limits"],
)
def test_drum_and_load_follow_an_independent_integrator(drive: TorqueDrive, depth: float, step: float | None) -> None:
    """With the default step (11 ms by the gear's friction, 20 ms without); with 2.5 ms where torque and power limit."""
    scenario, commands = lift(drive, depth), hard(1, 400)
    coupled = Coupled(scenario, commands)
    got, want = run(scenario, commands, step), coupled.solve()
    assert not got[:, SLACK].any()
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-5
    assert np.abs(got[:, ANGLE] - want[:, 6]).max() < 1e-5
    torques = np.array([coupled.torques(t, y) for t, y in zip(coupled.times, want, strict=True)])
    np.testing.assert_allclose(got[:, TORQUE], torques[:, 2], atol=200.0)
    np.testing.assert_allclose(got[:, POWER], torques[:, 1] * want[:, 7], atol=1e3)
    limited = np.abs(torques[:, 0] - torques[:, 1]) > 1.0
    assert limited.mean() > 0.2 if step else not limited.any()
