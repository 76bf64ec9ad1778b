"""A drum with inertia below the flexible frame: the stand-alone model's, still under its brake, energy, limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from frame_energy import frame_energy
from scipy.integrate import cumulative_simpson

from aframe_env import HarmonicMotion, Scenario, TorqueDrive, Winch
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.env import AFrameHeaveEnv
from aframe_env.flexible_engine import FlexibleEngine, Mesh
from aframe_env.rfem.structure import Division
from train.verify.drive_checks import HOLD, driven_lift, flexible_run, stand_alone_run

COARSE = Division(leg=5, beam=2)
MESH = Mesh(COARSE, 8)
RADIUS = 0.75


def test_lift_on_a_soft_frame_is_that_of_the_stand_alone_model() -> None:
    """A frame a fifth as stiff, whose head moves by what the drum does."""
    scenario = driven_lift(0.2)
    commands = np.repeat(np.random.default_rng(1).uniform(-0.6, 0.6, 12), HOLD)
    here, there = flexible_run(scenario, commands, MESH), stand_alone_run(scenario, commands, COARSE)
    errors = {name: np.abs(here[name] - column).max() / np.ptp(column) for name, column in there.items()}
    assert np.ptp(there["uS3_m"]) > 0.01
    assert max(errors[name] for name in ("xL1_m", "xL3_m", "drum_rad", "drum_rad_s", "T_rope_N")) < 1e-3
    assert max(errors.values()) < 1e-2


def still_lift(rope_damping: float, **drive: float) -> Scenario:
    """The reference crane with 100 t below a deck at rest."""
    scenario = driven_lift()
    crane = replace(scenario.crane, winch=Winch(drive=TorqueDrive(**drive)))
    return replace(scenario, crane=crane, motion=HarmonicMotion(), rope_damping=rope_damping)


def energy(engine: FlexibleEngine, scenario: Scenario) -> float:
    """Energy of frame, light rope, load and drum above a still deck, J, by their definitions."""
    frame, row = engine.frames[0], engine.blocks[0]
    found, pulley = frame_energy(engine, scenario.gravity)
    position, velocity = row[at.LOAD_POSITION :][:3], row[at.LOAD_VELOCITY :][:3]
    distance = np.linalg.norm(position - pulley) + np.linalg.norm(frame[flex.DRUM : flex.DRUM + 3] - pulley)
    length = scenario.free_length + RADIUS * row[at.DRUM_ANGLE]
    stretch = max(distance - length, 0.0)
    drive = scenario.crane.winch.drive
    assert drive is not None
    kinetic = 0.5 * scenario.load_mass * velocity @ velocity + 0.5 * drive.inertia * row[at.DRUM_SPEED] ** 2
    strain = 0.5 * scenario.crane.rope.axial_stiffness * stretch**2 / length
    return float(found + kinetic + scenario.weight * position[2] + strain)


def test_the_drive_s_work_is_what_has_become_of_it() -> None:
    """Of frame, rope, load and drum together, none of them damped; every 10 ms, by Simpson's rule."""
    scenario, period = still_lift(0.0, brake_torque=0.0), 0.01
    engine = FlexibleEngine(1, period, MESH, max_inner_step=2.5e-3)
    engine.reset_row(0, scenario)
    stored, power, heads = [], [], []
    for k in range(601):
        stored.append(energy(engine, scenario))
        power.append(engine.read(at.DRIVE_TORQUE)[0] * engine.read(at.DRUM_SPEED)[0])
        heads.append(engine.read_frames()[0, 2])
        engine.step(np.full(1, -1.0 if k < 300 else 0.8))
    work = cumulative_simpson(power, dx=period, initial=0.0)
    assert np.ptp(heads) > 1e-3
    assert np.ptp(work) > 1e6
    assert np.abs(np.array(stored) - stored[0] - work).max() < 1e-5 * np.ptp(work)


def test_brake_holds_the_drum_still() -> None:
    """As in a lift whose drum goes as it is told, where a limit that is not met keeps to the same scheme."""
    commands = np.zeros(50)
    braked, told = (
        flexible_run(replace(driven_lift(), crane=replace(driven_lift().crane, winch=winch)), commands, MESH, 5e-3)
        for winch in (Winch(drive=TorqueDrive()), Winch(max_power=1e9))
    )
    assert not braked["drum_rad"].any()
    for name, column in told.items():
        assert braked[name] == pytest.approx(column, rel=1e-9, abs=1e-12), name


def test_limit_switch_stops_the_drum() -> None:
    scenario = replace(still_lift(1e5), target_level=-30.0)
    found = flexible_run(scenario, np.array([-3.0] * 200 + [1.0] * 30), MESH)
    length = scenario.free_length + RADIUS * found["drum_rad"]
    assert length.min() == pytest.approx(scenario.crane.winch.min_rope_length, abs=1e-9)
    assert found["drum_rad_s"][190:200] == pytest.approx(0.0, abs=0.05)
    assert found["drum_rad_s"][-10:].mean() == pytest.approx(1.0, abs=0.05)


def test_information_tells_torque_and_power() -> None:
    env = AFrameHeaveEnv(model="rfem", rfes=(5, 2), rfem_modes=8, scenario=still_lift(1e5))
    _, info = env.reset(seed=0)
    assert info["drive_torque"] == pytest.approx(-1e5 * 9.81 * RADIUS, rel=3e-3)
    assert info["drive_power"] == 0.0
    for _ in range(60):
        observation, _, _, _, info = env.step(np.array([-2.0], dtype=np.float32))
    assert observation[10] == pytest.approx(-2.0, abs=0.05)
    assert info["drive_power"] == pytest.approx(info["drive_torque"] * observation[10] / 0.95, rel=1e-3)
