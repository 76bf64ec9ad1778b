"""Checks of the drum with inertia under torque: against SciPy, and on the flexible frame against stand-alone runs."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.integrate import cumulative_trapezoid, solve_ivp

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible.readout import DEFLECTION, SERVOMOTORS
from aframe_env.flexible_engine import FRAME_MODES, FlexibleEngine, Mesh
from aframe_env.rfem.model import frame_model
from aframe_env.rfem.simulate import DrivenDrum, DynamicCase, simulate
from aframe_env.rfem.structure import Division
from aframe_env.scenario import Crane, Rope, Scenario, TorqueDrive, Winch
from aframe_env.scenario.crane import Frame
from train.verify.report import Check, Row
from train.verify.run_checks import EVERY_COLUMN, Comparison, stiffened
from train.verify.vertical import FloatArray, Lift
from train.verify.water_checks import PERIOD, control_steps, heaving, track

HOLD = 5
"""Control steps for which a command holds."""
COLUMNS = ("xL1_m", "xL3_m", "drum_rad", "drum_rad_s", "T_rope_N", "uS1_m", "uS3_m", "S_R_N")
"""What a run of the full model is compared by."""


def wanted_speed(commands: FloatArray, acceleration: float) -> tuple[FloatArray, FloatArray]:
    """Times [s] and speeds [rad/s] between which the wanted speed is a straight line; each command is reached."""
    times, speeds, speed = [], [], 0.0
    for index in range(0, len(commands), HOLD):
        begin, command = PERIOD * index, float(commands[index])
        ramp = abs(command - speed) / acceleration
        assert ramp < HOLD * PERIOD
        times += [begin, begin + ramp]
        speeds += [speed, command]
        speed = command
    return np.array(times), np.array(speeds)


def through_gear(drive: TorqueDrive, radius: float, torque: float, speed: float) -> float:
    """Torque of the motors that comes through the gear to a drum of ``radius`` m at ``speed`` rad/s, N m."""
    # From hoisting to lowering within some centimetres a second.
    way = math.copysign(speed / math.hypot(speed, 0.02 / radius), torque * speed) if speed else 0.0
    hoisting, lowering = drive.hoisting_efficiency, 1.0 / drive.lowering_efficiency
    return torque * (0.5 * (1.0 + way) * hoisting + 0.5 * (1.0 - way) * lowering)


@dataclass(frozen=True)
class Hoist:
    """Load, drum, speed loop and load pin's filter by their equations; the brake up, the motors within limits."""

    lift: Lift
    wanted: tuple[FloatArray, FloatArray]

    @property
    def drive(self) -> TorqueDrive:
        """What turns the drum."""
        drive = self.lift.scenario.crane.winch.drive
        assert drive is not None
        return drive

    def rope(self, t: float, z: float, v: float, angle: float, speed: float) -> tuple[float, float]:
        """Tension [N] and torque on the drum [N m], which has the strain energy of rope that leaves it."""
        crane = self.lift.scenario.crane
        radius = crane.winch.drum_radius
        undamped = replace(self.lift, scenario=replace(self.lift.scenario, rope_damping=0.0))
        tension = self.lift.tension(t, z, v, radius * angle, radius * speed)
        elastic = undamped.tension(t, z, v, radius * angle, radius * speed)
        return tension, radius * (tension + 0.5 * elastic**2 / crane.rope.axial_stiffness)

    def motors(self, t: float, speed: float, integral: float, filtered: float) -> tuple[float, float]:
        """Torque of the motors, and of it what comes through the gear, N m at the drum."""
        drive, radius = self.drive, self.lift.scenario.crane.winch.drum_radius
        proportional = 2.0 * drive.damping_ratio * drive.bandwidth * drive.inertia
        error = float(np.interp(t, *self.wanted)) - speed
        torque = proportional * error + integral - drive.tension_feedforward * radius * filtered
        return torque, through_gear(drive, radius, torque, speed)

    def rates(self, t: float, state: FloatArray) -> list[float]:
        """Rates of level, velocity, drum angle, drum speed, integral and filtered tension."""
        z, v, angle, speed, integral, filtered = state.tolist()
        scenario, drive = self.lift.scenario, self.drive
        tension, pull = self.rope(t, z, v, angle, speed)
        error = float(np.interp(t, *self.wanted)) - speed
        return [
            v,
            tension / scenario.load_mass - scenario.gravity,
            speed,
            (pull + self.motors(t, speed, integral, filtered)[1]) / drive.inertia,
            drive.bandwidth**2 * drive.inertia * error,
            (tension - filtered) / drive.tension_filter,
        ]

    def run(self, times: FloatArray) -> FloatArray:
        """States at ``times``, and the torque at the drum and the power of the motors: (8, T)."""
        scenario, drive, h = self.lift.scenario, self.drive, 1e-5
        speed = (self.lift.heave(h) - self.lift.heave(-h)) / (2.0 * h)
        tension, pull = self.rope(0.0, scenario.target_level, speed, 0.0, 0.0)
        mean = 0.5 * (drive.hoisting_efficiency + 1.0 / drive.lowering_efficiency)
        relief = drive.tension_feedforward * scenario.crane.winch.drum_radius * tension
        state = np.array([scenario.target_level, speed, 0.0, 0.0, relief - pull / mean, tension])
        stops, found = np.unique(np.round(np.concatenate([times, self.wanted[0]]), 9)), []
        for begin, end in itertools.pairwise(stops):
            solved = solve_ivp(self.rates, (begin, end), state, "DOP853", rtol=1e-9, atol=1e-9)
            state = solved.y[:, -1]
            found.append(state)
        found = [found[index - 1] for index in np.searchsorted(stops, times - 1e-8)]
        motors = np.array([self.motors(t, *y[3:]) for t, y in zip(times.tolist(), found, strict=True)])
        states = np.array(found).T
        return np.vstack([states, motors[:, 1], motors[:, 0] * states[3]])


def torque_drive() -> Check:
    """Check a drum that turns under the torque of its motors, gear and speed loop."""
    motion, heave = heaving(1.0, 9.0)
    winch = Winch(drive=TorqueDrive(tension_feedforward=0.5))
    scenario = Scenario(
        crane=Crane(winch=winch, rope=Rope(breaking_load=1e9)), motion=motion, target_level=-300.0, rope_damping=2e4
    )
    times = control_steps(30.0)
    held = np.random.default_rng(1).uniform(-0.6, 0.6, len(times) // HOLD)
    commands = np.repeat(held, HOLD)
    slots = (at.LOAD_POSITION + 2, at.DRUM_ANGLE, at.DRUM_SPEED, at.TENSION, at.DRIVE_TORQUE, at.DRIVE_POWER)
    here = track(scenario, commands, slots)
    wanted = wanted_speed(commands, winch.max_rope_acceleration / winch.drum_radius)
    hoist = Hoist(Lift(scenario, heave), wanted)
    states = hoist.run(times)
    tension = [hoist.rope(t, *y[:4])[0] for t, y in zip(times.tolist(), states.T, strict=True)]
    there = np.array([states[0], states[2], states[3], tension, states[6], states[7]])
    errors = np.abs(here - there).max(axis=1) / np.ptp(there, axis=1)
    worst, load = float(errors.max()), float(np.abs(here[0] - there[0]).max())
    return Check(
        name="drum with inertia under torque: 100 t, heave of 1 m at 9 s, commands of up to 0.6 rad/s, 30 s",
        bar="load within 10 µm of SciPy's DOP853; drum, tension, torque, power within 0.1 % of their ranges",
        measured=f"{1e6 * load:.2f} µm; {worst:.4%}",
        passed=load <= 1e-5 and worst <= 1e-3,
        rows=[
            Row.of_ranges(what, ours, theirs, f"{error:.4%}")
            for what, ours, theirs, error in zip(
                ("load, m", "drum angle, rad", "drum speed, rad/s", "tension, N", "torque, N m", "power, W"),
                here,
                there,
                errors,
                strict=True,
            )
        ],
    )


class LoopTorque:
    """Torque of a drive by time, drum angle and drum speed alone, as stand-alone runs ask for it.

    Within the motors' limits and without feed-forward the loop's integral part is by how much the drum is behind the
    one that goes as it is told.
    """

    def __init__(self, scenario: Scenario, wanted: tuple[FloatArray, FloatArray]) -> None:
        drive = scenario.crane.winch.drive
        assert drive is not None
        assert drive.tension_feedforward == 0.0
        self.drive, self.radius = drive, scenario.crane.winch.drum_radius
        self.times, self.speeds = wanted
        self.angles = cumulative_trapezoid(self.speeds, self.times, initial=0)
        # What hangs on the drum at rest, with the strain energy of rope that leaves it.
        pull = self.radius * scenario.weight * (1.0 + 0.5 * scenario.weight / scenario.crane.rope.axial_stiffness)
        self.held = -2.0 * pull / (drive.hoisting_efficiency + 1.0 / drive.lowering_efficiency)

    def __call__(self, t: float, angle: float, speed: float) -> float:
        """N m at the drum, positive pays out."""
        drive = self.drive
        index = int(np.searchsorted(self.times, t, side="right")) - 1
        told = float(np.interp(t, self.times, self.speeds))
        ahead = self.angles[index] + 0.5 * (self.speeds[index] + told) * (t - self.times[index])
        rate = drive.bandwidth * (2.0 * drive.damping_ratio * (told - speed) + drive.bandwidth * (ahead - angle))
        return through_gear(drive, self.radius, self.held + drive.inertia * rate, speed)


def driven_lift(stiffer: float = 1.0) -> Scenario:
    """100 t on a drum with inertia and the paper's motion, the frame's material ``stiffer`` times as stiff."""
    crane = Crane(frame=stiffened(Frame(), stiffer), rope=Rope(breaking_load=1e9), winch=Winch(drive=TorqueDrive()))
    return Scenario.paper(crane=crane, rope_damping=2e4)


def flexible_run(
    scenario: Scenario, commands: FloatArray, mesh: Mesh, max_inner_step: float | None = None
) -> dict[str, FloatArray]:
    """Load, drum, rope and head of the frame in the environment, every PERIOD from 0 on."""
    engine, found = FlexibleEngine(1, PERIOD, mesh, max_inner_step=max_inner_step), []
    engine.reset_row(0, scenario)
    slots = (at.LOAD_POSITION, at.LOAD_POSITION + 2, at.DRUM_ANGLE, at.DRUM_SPEED, at.TENSION)
    for command in [*commands, 0.0]:
        head, frame = DEFLECTION, engine.read_frames()[0]
        found.append([*(engine.read(slot)[0] for slot in slots), frame[head], frame[head + 2], frame[SERVOMOTORS]])
        engine.step(np.full(1, command))
    return dict(zip(COLUMNS, np.array(found).T, strict=True))


def stand_alone_run(scenario: Scenario, commands: FloatArray, division: Division) -> dict[str, FloatArray]:
    """The same of a stand-alone run, step 2.5 ms."""
    winch = scenario.crane.winch
    wanted = wanted_speed(commands, winch.max_rope_acceleration / winch.drum_radius)
    drive = winch.drive
    assert drive is not None
    plain = replace(scenario, crane=replace(scenario.crane, winch=replace(winch, drive=None)))
    case = DynamicCase(
        scenario=plain,
        drum=DrivenDrum(inertia=drive.inertia, torque=LoopTorque(scenario, wanted)),
        duration=PERIOD * len(commands),
        output_interval=PERIOD,
    )
    result = simulate(case, model=frame_model(scenario.crane.frame, division))
    head = result.frame.displacement("S")
    load, drum = result.load[:, ::2].T, (result.drum_angle, result.drum_rate)
    columns = (*load, *drum, result.tension, head[:, 0], head[:, 2], result.frame.servomotors()[:, 0])
    return dict(zip(COLUMNS, columns, strict=True))


@cache
def torque_run() -> Comparison:
    """The same drive below the flexible frame, in the environment and in a stand-alone run of the full model."""
    held = np.random.default_rng(1).uniform(-0.6, 0.6, 200 // HOLD)
    commands, division = np.repeat(held, HOLD), Division(leg=20, beam=16)
    scenario = driven_lift()
    here = flexible_run(scenario, commands, Mesh(division, FRAME_MODES))
    return Comparison(here=here, there=stand_alone_run(scenario, commands, division))


def torque_drive_on_flexible_frame() -> Check:
    """Check the drive below the flexible frame."""
    return torque_run().check(
        "drum with inertia under torque, the paper's motion, commands of up to 0.6 rad/s, 20 s, 20/16 rfes: "
        "the environment at its default step against a stand-alone run at 2.5 ms",
        EVERY_COLUMN,
        COLUMNS,
    )
