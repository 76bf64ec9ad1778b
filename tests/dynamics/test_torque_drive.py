"""A drum with inertia under torque: against SciPy's DOP853 on the same equations, limits, brake and energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import oracle
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp

from aframe_env import (
    Compensator,
    Crane,
    HarmonicMotion,
    InvalidValue,
    Rope,
    Scenario,
    Sea,
    SeaMotion,
    TorqueDrive,
    Winch,
)
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.env import AFrameHeaveEnv

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

    def start(self) -> oracle.FloatArray:
        """Load at its target, and the loop and its filter with what holds it."""
        tip, scenario = self.pulley(0.0), self.scenario
        start = np.zeros(10)
        start[:6] = tip
        start[2] -= scenario.crane.pulley_position[2] - scenario.target_level
        tension, _, pull = self.rope(0.0, start)
        drive = self.drive
        mean = 0.5 * (drive.hoisting_efficiency + 1.0 / drive.lowering_efficiency)
        start[8] = drive.tension_feedforward * RADIUS * tension - pull / mean
        start[9] = tension
        return start

    def solve(self) -> oracle.FloatArray:
        """States (T, 10)."""
        return oracle.integrate(self.slope, self.times, self.start(), self.kinks, max_step=0.02)


UNFILTERED = TorqueDrive(
    hoisting_efficiency=1.0, lowering_efficiency=1.0, tension_feedforward=0.9, tension_filter=0.0, damping_ratio=0.7
)


def hard(seed: int, steps: int) -> oracle.FloatArray:
    """Commands (steps,) rad/s held for half a second each, up to the limit of 4."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-4.0, 4.0, -(-steps // 5)), 5)[:steps]


@pytest.mark.parametrize(
    ("drive", "depth", "step"),
    [
        (TorqueDrive(), 300.0, None),
        (TorqueDrive(tension_feedforward=1.0), 300.0, None),
        (UNFILTERED, 1000.0, None),
        (TorqueDrive(motor_torque=2.2e4, motor_power=2.5e6), 300.0, 1e-3),
    ],
    ids=["default", "feed-forward", "unfiltered-without-losses", "at-its-limits"],
)
def test_drum_and_load_follow_an_independent_integrator(drive: TorqueDrive, depth: float, step: float | None) -> None:
    """With the default step (11 ms by the gear's friction, 20 ms without); with 1 ms where torque and power limit."""
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


IDEAL = TorqueDrive(
    bandwidth=400.0,
    motor_torque=1e8,
    motor_power=1e12,
    hoisting_efficiency=1.0,
    lowering_efficiency=1.0,
    tension_feedforward=1.0,
    tension_filter=0.0,
    brake_torque=0.0,
)


@pytest.mark.parametrize("rope", [STRONG, Rope.six_strand(breaking_load=1e9)], ids=["light", "heavy"])
def test_quick_and_strong_drive_makes_the_drum_go_as_it_is_told(rope: Rope) -> None:
    """The load is off by less than 0.1 mm, and sixteen times less than with a loop a quarter as quick."""

    def errors_of(bandwidth: float) -> oracle.FloatArray:
        winch = Winch(lag=0.2, drive=replace(IDEAL, bandwidth=bandwidth))
        got = run(replace(lift(None), crane=Crane(winch=winch, rope=rope)), commands)
        return np.asarray(np.abs(got - want)[:, [2, ANGLE]].max(axis=0))

    commands = hard(3, 200)
    want = run(replace(lift(None), crane=Crane(winch=Winch(lag=0.2), rope=rope)), commands)
    assert np.ptp(want[:, ANGLE]) > 5.0
    errors = errors_of(400.0)
    assert errors.max() < 1e-4
    np.testing.assert_allclose(errors_of(100.0), 16.0 * errors, rtol=0.05)


def test_brake_holds_the_drum_still() -> None:
    got, want = run(lift(TorqueDrive()), np.zeros(200), 5e-3), run(lift(None), np.zeros(200), 5e-3)
    assert not got[:, [ANGLE, SPEED]].any()
    assert not got[1:, [TORQUE, POWER]].any()
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-12


def slipping(coupled: Coupled, torque: float) -> oracle.FloatArray:
    """Load and drum (T, 8) under a fallen brake, split where it begins to slip and where it holds again."""

    def slips(t: float, y: oracle.FloatArray) -> float:
        return coupled.rope(t, y)[2] - torque

    def stops(t: float, y: oracle.FloatArray) -> float:
        return float(y[7])

    slips.terminal = stops.terminal = True  # type: ignore[attr-defined]
    slips.direction, stops.direction = 1.0, -1.0  # type: ignore[attr-defined]
    scenario, slip = coupled.scenario, False
    mass = scenario.load_mass

    def slope(t: float, y: oracle.FloatArray) -> list[float]:
        _, force, pull = coupled.rope(t, y)
        turning = (pull - torque) / coupled.drive.inertia if slip else 0.0
        return [*y[3:6], force[0] / mass, force[1] / mass, force[2] / mass - scenario.gravity, y[7], turning]

    y, now, end, out = coupled.start()[:8], 0.0, coupled.times[-1], np.zeros((len(coupled.times), 8))
    slip = coupled.rope(0.0, y)[2] > torque
    while now < end - 1e-9:
        event = stops if slip else slips
        found = solve_ivp(
            slope, (now, end), y, "DOP853", rtol=1e-10, atol=1e-11, max_step=0.02, events=event, dense_output=True
        )
        inside = (coupled.times >= now) & (coupled.times <= found.t[-1])
        out[inside] = found.sol(coupled.times[inside]).T
        now, y = found.t[-1], found.y[:, -1].copy()
        if found.status == 1:
            # A step on, so that it is not the same event again.
            slip = not slip
            y[7] = 0.0
    return out


def test_brake_slips_above_its_torque_and_holds_again() -> None:
    """Weight and strain energy ask for 0.738 MN m; waves for more, and then for less."""
    scenario = lift(TorqueDrive(brake_torque=0.75e6), damping=3e5)
    coupled = Coupled(scenario, np.zeros(400))
    want, got = slipping(coupled, 0.75e6), run(scenario, np.zeros(400), 2.5e-3)
    moving = want[:, 7] > 1e-6
    assert np.count_nonzero(np.diff(moving.astype(int)) == 1) >= 4
    assert 0.1 < moving.mean() < 0.9
    assert want[-1, 6] > 5.0
    assert np.abs(got[:, ANGLE] - want[:, 6]).max() < 1e-5
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-5


def test_brake_rises_without_a_jerk() -> None:
    """The loop is ready for what the brake has borne."""
    scenario = replace(lift(TorqueDrive(tension_feedforward=0.5)), motion=HarmonicMotion())
    got = run(scenario, np.array([0.0] * 20 + [-1e-9] * 20))
    assert got[20, SPEED] == 0.0
    assert np.abs(got[:, ANGLE]).max() * RADIUS < 1e-6


def test_work_of_drive_and_deck_is_what_has_become_of_it() -> None:
    """Kinetic, potential, elastic and the drum's energy, and the loss in the rope; every 10 ms, by Simpson's rule."""
    period, count = 0.01, 3000
    scenario = lift(TorqueDrive(), damping=5e4)
    engine = Engine(1, period)
    engine.reset_row(0, scenario)
    commands = np.repeat(hard(2, 300), 10)
    slots = (*SLOTS[:11], *(at.PULLEY + k for k in range(6)))
    states = []
    for k in range(count + 1):
        states.append([engine.read(slot)[0] for slot in slots])
        engine.step(np.array([commands[min(k, count - 1)]]))
    s = np.array(states)
    angle, speed, tension, torque, motors = s[:, ANGLE], s[:, SPEED], s[:, TENSION], s[:, TORQUE], s[:, POWER]
    mass, rope, drive = scenario.load_mass, scenario.crane.rope, scenario.crane.winch.drive
    assert drive is not None
    line, gap = s[:, :3] - s[:, 11:14], s[:, 3:6] - s[:, 14:17]
    away = np.linalg.norm(line, axis=1)
    axis = line / away[:, None]
    length = oracle.free_length(scenario) + RADIUS * angle
    stretch = away + oracle.behind_pulley(scenario) - length
    stretching = (axis * gap).sum(1) - RADIUS * speed
    assert (stretch > 0.0).all()
    stored = 0.5 * mass * (s[:, 3:6] ** 2).sum(1) + mass * scenario.gravity * s[:, 2] + 0.5 * drive.inertia * speed**2
    stored += 0.5 * rope.axial_stiffness / length * stretch**2
    lost = scenario.rope_damping * stretching**2
    deck = -tension * (axis * s[:, 14:17]).sum(1)
    work = cumulative_simpson(torque * speed + deck - lost, dx=period, initial=0.0)
    exchanged = np.ptp(cumulative_simpson(torque * speed, dx=period, initial=0.0))
    assert exchanged > 5e6
    assert np.abs(stored - stored[0] - work).max() < 1e-4 * exchanged
    # The gear takes something either way, between what its two efficiencies say.
    taken = motors - torque * speed
    fast = np.abs(speed) > 0.5
    assert (taken[fast] > 0.04 * np.abs(motors[fast])).all()
    assert (taken[fast] < 0.07 * np.abs(motors[fast])).all()


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_torque_at_its_limit_does_not_wind_the_loop_up(share: float) -> None:
    """100 t from rest to 3 m/s, with a fifth more torque than holds it: 4 s at the limit, and 2 % beyond the speed."""
    drive = TorqueDrive(motor_torque=2.2e4, tension_feedforward=share)
    speed = run(replace(lift(drive), motion=HarmonicMotion()), np.full(80, -4.0))
    limit = 0.95 * drive.torque
    assert np.count_nonzero(speed[:, TORQUE] < -0.999 * limit) > 30
    # While the gear's friction builds up a little more comes through.
    assert speed[:, TORQUE].min() > -1.001 * limit
    assert -4.08 < speed[:, SPEED].min() < -4.0
    assert speed[-10:, SPEED] == pytest.approx(-4.0, abs=0.02)


def test_limit_switch_stops_the_drum() -> None:
    scenario = replace(lift(TorqueDrive(), depth=30.0), motion=HarmonicMotion())
    got = run(scenario, np.array([-3.0] * 200 + [1.0] * 30))
    winch = scenario.crane.winch
    length = scenario.free_length + RADIUS * got[:, ANGLE]
    assert length.min() == pytest.approx(winch.min_rope_length, abs=1e-9)
    assert got[190:200, SPEED] == pytest.approx(0.0, abs=0.05)
    assert got[-10:, SPEED].mean() == pytest.approx(1.0, abs=0.03)


def test_rows_are_what_they_are_alone() -> None:
    """In a batch of all kinds, beside and between rows of the paper; to the bit."""
    kinds = [
        lift(TorqueDrive()),
        lift(None),
        replace(lift(None), crane=Crane(winch=Winch(drive=TorqueDrive(bandwidth=5.0)), rope=Rope.six_strand())),
        lift(TorqueDrive(brake_torque=0.8e6), depth=1000.0),
        Scenario.paper(crane=Crane(winch=Winch(drive=TorqueDrive(), drum_width=2.0), rope=Rope(outer_diameter=0.07))),
        Scenario.paper(crane=Crane(winch=Winch(drive=TorqueDrive()), compensator=Compensator(), sheave_friction=0.02)),
    ]
    heavy = [kind for kind in kinds if not kind.is_light]
    slots = (at.LIFT, at.LIFT_SIZE), (at.OMEGA1, 4), (at.DRIVE_TORQUE, 2), (at.BRAKED, 1)
    commands = hard(5, 60)
    commands[20:30] = 0.0
    for group in (kinds, heavy):
        batch = Engine(70, PERIOD)
        for row in range(70):
            batch.reset_row(row, group[row % len(group)])
        for command in commands:
            batch.step(np.full(70, command))
        for row, scenario in enumerate(group):
            alone = Engine(1, PERIOD)
            alone.reset_row(0, scenario)
            for command in commands:
                alone.step(np.array([command]))
            for first, size in slots:
                own = alone.read_many(first, size)[0]
                np.testing.assert_array_equal(batch.read_many(first, size)[row], own)
                np.testing.assert_array_equal(batch.read_many(first, size)[row + 10 * len(group)], own)


def test_information_tells_torque_and_power() -> None:
    env = AFrameHeaveEnv(scenario=replace(lift(TorqueDrive()), motion=HarmonicMotion()))
    _, info = env.reset(seed=0)
    assert info["drive_torque"] == pytest.approx(-1e5 * 9.81 * RADIUS, rel=3e-3)
    assert info["drive_power"] == 0.0
    for _ in range(60):
        observation, _, _, _, info = env.step(np.array([-2.0], dtype=np.float32))
    assert observation[10] == pytest.approx(-2.0, abs=0.03)
    assert info["drive_power"] == pytest.approx(info["drive_torque"] * observation[10] / 0.95, rel=1e-3)
    assert info["drive_power"] > 1.3e6


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TorqueDrive(inertia=0.0), "inertia = 0.0 kg m²"),
        (lambda: TorqueDrive(hoisting_efficiency=1.1), "hoisting_efficiency = 1.1"),
        (lambda: Winch(drive=3.0), "drive = 3.0"),  # type: ignore[arg-type]
        (lambda: Winch(drive=TorqueDrive(), max_power=1e6), "max_power = 1000000.0 W"),
        (lambda: lift(TorqueDrive(inertia=1.0)), "seabed, compensator, drive"),
    ],
)
def test_says_what_does_not_go_together(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        make()
