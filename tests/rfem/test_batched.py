"""The full model in its modes, for many rows at once, against the full model as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.readout import FEET, ROTATION, SERVOMOTORS, UTILISATION
from aframe_env.engine import Engine
from aframe_env.flexible_engine import FlexibleEngine, Mesh
from aframe_env.rfem.model import SMALL_ROTATION, frame_model
from aframe_env.rfem.reduction import modal_frame
from aframe_env.rfem.reference import time_series
from aframe_env.rfem.simulate import DynamicCase, DynamicResult, simulate
from aframe_env.rfem.structure import Division
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.cross_sections import Material, Servomotor
from aframe_env.scenario.motion import Harmonic, HarmonicMotion
from aframe_env.validation import SmallRotationWarning
from train.verify import run_checks

COARSE = Division(leg=5, beam=2)
STILL = np.zeros(1)
PERIOD = 0.05


def crane_of(material: Material | None = None, servomotor: Servomotor | None = None) -> Crane:
    frame = Crane().frame
    made = frame.structure
    made = replace(made, material=material or made.material, servomotor=servomotor or made.servomotor)
    return Crane(frame=replace(frame, structure=made))


def stiff(factor: float) -> Crane:
    return crane_of(Material(young_modulus=2.1e11 * factor, shear_modulus=8.1e10 * factor))


def run(scenario, duration, mesh, step=None, command=0.0):
    """Load (k, 3), tension (k,), readout (k, READOUTS) every PERIOD."""
    engine = FlexibleEngine(1, PERIOD, mesh, max_inner_step=step)
    engine.reset_row(0, scenario)
    rows = []
    for _ in range(round(duration / PERIOD) + 1):
        rows.append((engine.read_many(at.LOAD_POSITION, 3)[0], engine.read(at.TENSION)[0], engine.read_frames()[0]))
        engine.step(np.full(1, command))
    return tuple(np.array(column) for column in zip(*rows, strict=True))


def readout_of(result: DynamicResult) -> np.ndarray:
    history = result.frame
    stress = history.von_mises().max(axis=1) / Material().yield_strength
    parts = [history.displacement("S"), history.feet().reshape(-1, 6), history.servomotors(), stress[:, None]]
    rotation = np.linalg.norm(history.position.reshape(len(stress), -1, 6)[:, :, 3:], axis=2).max(axis=1)
    return np.hstack([*parts, np.where(rotation > SMALL_ROTATION, rotation, 0.0)[:, None]])


def assert_like(result: DynamicResult, run_of_engine, load: float, share: float) -> None:
    """Load within ``load`` m; readout within ``share`` of its range (or of 1e-3 of the largest of its kind)."""
    positions, tension, readout = run_of_engine
    assert np.abs(positions - result.load).max() < load
    assert np.abs(tension - result.tension).max() < share * np.ptp(result.tension)
    expected = readout_of(result)
    error, scale = np.abs(readout - expected).max(axis=0), np.ptp(expected, axis=0)
    for kind in (slice(0, 3), slice(FEET, FEET + 6), slice(SERVOMOTORS, UTILISATION), slice(UTILISATION, ROTATION)):
        assert (error[kind] <= share * np.maximum(scale[kind], 0.1 * scale[kind].max())).all()


@pytest.mark.parametrize("modes", [None, 8])
def test_paper_case_is_that_of_the_full_model(modes):
    expected = simulate(DynamicCase(duration=5.0, step=2.5e-3), model=frame_model(Crane().frame, COARSE))
    assert_like(expected, run(Scenario.paper(), 5.0, Mesh(COARSE, modes)), 1e-6, 0.01)


def test_rotation_of_a_soft_frame_is_that_of_the_full_model():
    scenario = Scenario.paper(crane=stiff(0.07))
    with pytest.warns(SmallRotationWarning):
        result = simulate(
            DynamicCase(scenario=scenario, duration=5.0, step=2.5e-3), model=frame_model(scenario.crane.frame, COARSE)
        )
    expected = readout_of(result)[:, ROTATION]
    found = run(scenario, 5.0, Mesh(COARSE))[2][:, ROTATION]
    assert expected.max() > 0.05
    assert found == pytest.approx(expected, rel=1e-3)
    assert not run(Scenario.paper(), 1.0, Mesh(COARSE))[2][:, ROTATION].any()


def test_rough_sea_is_that_of_the_full_model():
    # Damped: a sudden start makes an undamped frame ring, and no coarse step gets the ringing's phase right.
    crane = crane_of(Material(normal_damping=2.1e9, tangential_damping=8.1e8))
    scenario = Scenario.paper(initial="rest", rope_damping=2e4, motion=run_checks.rough_sea(), crane=crane)
    case = DynamicCase(scenario=scenario, duration=3.0, step=2.5e-3)
    expected = simulate(case, model=frame_model(crane.frame, COARSE))
    assert_like(expected, run(scenario, 3.0, Mesh(COARSE), 2.5e-3), 1e-5, 0.005)


def test_a_deck_that_turns_fast_moves_the_displaced_frame_too():
    # So fast that the terms of the displacement count: without them the error is some ten times the bound.
    roll = HarmonicMotion(harmonics=(Harmonic(coordinate="roll", amplitude=0.4, period=2.0),))
    scenario = Scenario.paper(initial="rest", motion=roll)
    case = DynamicCase(scenario=scenario, duration=2.0, step=1e-3)
    expected = simulate(case, model=frame_model(Crane().frame, COARSE))
    _, _, readout = run(scenario, 2.0, Mesh(COARSE), 2e-3)
    error = np.abs(readout - readout_of(expected)).max(axis=0)
    assert (error[:3] < 2e-3 * np.ptp(readout_of(expected)[:, 1])).all()


def test_damping_that_couples_the_modes():
    crane = crane_of(Material(normal_damping=2.1e9, tangential_damping=5e7), Servomotor(stiffness=3e8, damping=2e5))
    assert modal_frame(crane.frame, COARSE, None).couples
    scenario = Scenario.paper(initial="rest", crane=crane)
    case = DynamicCase(scenario=scenario, duration=3.0, step=2.5e-3)
    expected = simulate(case, model=frame_model(crane.frame, COARSE))
    assert_like(expected, run(scenario, 3.0, Mesh(COARSE), 2.5e-3), 1e-5, 0.01)
    assert_like(expected, run(scenario, 3.0, Mesh(COARSE, 20), 2.5e-3), 1e-4, 0.01)


def test_damping_in_the_ratio_of_the_moduli_does_not_couple_them():
    crane = crane_of(Material(normal_damping=2.1e8, tangential_damping=8.1e7))
    assert not modal_frame(crane.frame, COARSE, None).couples
    scenario = Scenario.paper(initial="rest", crane=crane)
    case = DynamicCase(scenario=scenario, duration=2.0, step=2.5e-3)
    expected = simulate(case, model=frame_model(crane.frame, COARSE))
    assert_like(expected, run(scenario, 2.0, Mesh(COARSE), 2.5e-3), 1e-5, 0.01)


def test_paper_case_against_the_independent_program():
    there = time_series("paper_flexible")
    load, _, readout = run(Scenario.paper(), 60.0, Mesh(Division(), 10))
    assert np.abs(load[:, 2] - there["xL3_m"]).max() < 2e-3
    for column, name in ((FEET + 2, "RAR3_N"), (SERVOMOTORS, "S_R_N")):
        assert np.abs(readout[:, column] - there[name]).max() < 0.01 * np.ptp(there[name])


def test_stiff_frame_is_the_simplified_model():
    engine = Engine(1, PERIOD)
    scenario = Scenario.paper(crane=stiff(1000.0))
    engine.reset_row(0, scenario)
    rigid = []
    for _ in range(601):
        rigid.append(engine.read_many(at.LOAD_POSITION, 3)[0])
        engine.step(STILL)
    assert np.abs(run(scenario, 30.0, Mesh(Division()))[0] - np.array(rigid)).max() < 1e-4


def test_reduced_frame_is_the_full_one():
    scenario = Scenario.paper(motion=run_checks.rough_sea(), ramp=10.0)
    full, reduced = (run(scenario, 30.0, Mesh(Division(), modes)) for modes in (None, 5))
    assert np.abs(full[0] - reduced[0]).max() < 1e-3 * np.ptp(full[0][:, 2])
    error, scale = np.abs(full[2] - reduced[2]).max(axis=0), np.ptp(full[2], axis=0)
    assert (error[FEET:ROTATION] < 0.01 * scale[FEET:ROTATION]).all()


def test_halving_the_step_is_second_order():
    scenario = Scenario.paper(initial="rest")
    runs = [run(scenario, 10.0, Mesh(COARSE), step)[0][:, 2] for step in (0.0125, 0.00625, 0.003125)]
    coarse, fine = (np.abs(a - b).max() for a, b in ((runs[0], runs[1]), (runs[1], runs[2])))
    assert fine < 0.3 * coarse
    assert coarse < 1e-4


def test_energy_is_kept():
    """The drum swings the load on a still deck; then it is held, and nothing is lost."""
    scenario = Scenario.paper(motion=HarmonicMotion())
    crane, mesh = scenario.crane, Mesh(COARSE)
    modal = modal_frame(crane.frame, COARSE, None)
    weight = modal.project(modal.uniform) @ np.array([0.0, 0.0, -scenario.gravity])
    engine = FlexibleEngine(1, 0.1, mesh)
    engine.reset_row(0, scenario)
    for command in (3.0,) * 5 + (0.0,) * 15:
        engine.step(np.full(1, command))
    assert engine.read(at.DRUM_SPEED)[0] == 0.0
    energies, kinetic = [], []
    for _ in range(600):
        modes = engine.frames.reshape(-1)[flex.MODES :].reshape(-1, flex.MODE_SLOTS)[: modal.count]
        place, rate = modes[:, flex.POSITION], modes[:, flex.RATE]
        velocity = engine.read_many(at.LOAD_VELOCITY, 3)[0]
        length = scenario.free_length + crane.winch.drum_radius * engine.read(at.DRUM_ANGLE)[0]
        moving = 0.5 * scenario.load_mass * velocity @ velocity + 0.5 * rate @ rate
        stored = 0.5 * engine.read(at.TENSION)[0] ** 2 * length / crane.rope.axial_stiffness
        stored += 0.5 * modal.square @ place**2 - weight @ place
        stored += scenario.weight * engine.read_many(at.LOAD_POSITION, 3)[0, 2]
        energies.append(moving + stored)
        kinetic.append(moving)
        engine.step(STILL)
    assert np.ptp(kinetic) > 1e3
    gap = np.abs(np.array(energies) - energies[0])
    # The scheme keeps an energy that differs from the true one by second order in the step; it does not drift.
    assert gap.max() < 2e-2 * np.ptp(kinetic)
    assert abs(np.mean(gap[-100:]) - np.mean(gap[:100])) < 5e-3 * np.ptp(kinetic)
