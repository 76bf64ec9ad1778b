"""Ropes with mass and loads in water below the flexible frame: the simplified model's, closed forms, energy."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from frame_energy import frame_energy

from aframe_env import (
    LOADS,
    Compensator,
    Crane,
    HarmonicMotion,
    InvalidValue,
    LoadShape,
    Rope,
    Scenario,
    Sea,
    Seabed,
    SeaMotion,
    TargetPath,
    TorqueDrive,
    Water,
    Winch,
)
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.flexible import layout as flex
from aframe_env.dynamics.flexible.readout import DEFLECTION
from aframe_env.engine import Engine
from aframe_env.env import AFrameHeaveEnv
from aframe_env.flexible_engine import FlexibleEngine, Mesh
from aframe_env.rfem.model import frame_model
from aframe_env.rfem.simulate import DynamicCase
from aframe_env.rfem.statics import LoadCase, static
from aframe_env.rfem.structure import Division
from aframe_env.scenario.cross_sections import Material
from train.verify.rope_checks import chain_masses, steel_load

FloatArray = npt.NDArray[np.float64]
COARSE = Division(leg=5, beam=2)
MESH = Mesh(COARSE)
LOSSLESS = Rope.six_strand(loss_time=0.0)
MU, G = 19.55, 9.81
WET = {
    "water": Water(current=((5.0, 0.5, 0.1), (90.0, -0.2, 0.3))),
    "load": LoadShape(
        volume=2.0,
        added_mass_vertical=2e4,
        added_mass_horizontal=5e3,
        drag_area_vertical=20.0,
        drag_area_horizontal=9.0,
    ),
}


def crane(stiffness: float = 1.0, rope: Rope | None = None) -> Crane:
    frame = Crane().frame
    material = Material(young_modulus=2.1e11 * stiffness, shear_modulus=8.1e10 * stiffness)
    return Crane(
        rope=rope or Rope.six_strand(breaking_load=6e6),
        winch=Winch(max_rope_length=6000.0, max_rope_speed=10.0),
        frame=replace(frame, structure=replace(frame.structure, material=material)),
    )


def at_sea(length: float, mass: float, stiffness: float = 1.0, **changes: object) -> Scenario:
    motion = SeaMotion(sea=Sea(hs=4.0, tp=8.0, seed=2))
    made = {"crane": crane(stiffness), "motion": motion, "load_mass": mass, "target_level": -length, "ramp": 2.0}
    return Scenario(**{**made, **WET, **changes})  # type: ignore[arg-type]


def still(length: float, mass: float, stiffness: float = 1.0) -> Scenario:
    """A load at rest in air on an undamped rope under a still deck."""
    scenario = steel_load(length, mass, rope=LOSSLESS, water=None, load=LoadShape())
    return replace(scenario, crane=crane(stiffness, LOSSLESS))


def track(engine: Engine, scenario: Scenario, commands: FloatArray) -> FloatArray:
    """Load, and tensions at pulley and load, (k, 5)."""
    engine.reset_row(0, scenario)
    found = []
    for command in commands:
        tensions = engine.read(at.TENSION), engine.read(at.LOAD_TENSION)
        found.append(np.concatenate([engine.read_many(at.LOAD_POSITION, 3)[0], *tensions]))
        engine.step(np.full(1, command))
    return np.array(found)


@pytest.mark.parametrize(
    ("length", "mass", "dry"), [(60.0, 2e4, False), (120.0, 4e4, False), (1000.0, 5e4, False), (2900.0, 1e5, True)]
)
def test_a_stiff_frame_is_the_simplified_model_s(length: float, mass: float, dry: bool) -> None:
    commands = 1.5 * np.sin(0.07 * np.arange(300))
    air = {"water": None, "load": LoadShape()} if dry else {}
    scenario = at_sea(length, mass, 1e4, **air)
    rigid, stiff = (track(engine, scenario, commands) for engine in (Engine(1, 0.1), FlexibleEngine(1, 0.1, MESH)))
    error, extent = np.abs(stiff - rigid).max(axis=0), np.ptp(rigid, axis=0)
    assert error[:3].max() < 1e-4
    assert (error[3:] < 1e-3 * extent[3]).all()
    # The frame as it is moves the load by far more: the comparison is of something.
    soft = track(FlexibleEngine(1, 0.1, MESH), at_sea(length, mass, **air), commands)
    assert np.abs(soft - rigid)[:, 2].max() > 5e-3


BEYOND = {
    "winch": {
        "crane": replace(crane(), sheave_friction=0.03, winch=Winch(max_power=3e5, drum_width=2.0)),
        "target_path": TargetPath.lowering(-3.0, 0.3, start=2.0),
    },
    "compensator": {"crane": replace(crane(), compensator=Compensator())},
    "drive": {"crane": replace(crane(), winch=Winch(drive=TorqueDrive()))},
    "splash": {"load": replace(LOADS["template"].shape, exit_area=100.0), "target_level": 0.0},
    "seabed": {
        "load": replace(WET["load"], height=3.0),
        "water": Water(seabed=Seabed(depth=117.5, stiffness=4e5, damping=2e5)),
    },
}


@pytest.mark.parametrize("name", BEYOND)
def test_a_stiff_frame_is_the_simplified_model_s_in_all_else(name: str) -> None:
    commands = np.full(200, 1.0) if name in ("splash", "seabed") else 1.5 * np.sin(0.1 * np.arange(200))
    scenario = at_sea(120.0, 4e4, **BEYOND[name])
    frame = crane(1e4).frame
    scenario = replace(scenario, crane=replace(scenario.crane, frame=frame))
    engines = Engine(1, 0.1), FlexibleEngine(1, 0.1, MESH)
    rigid, stiff = (track(engine, scenario, commands) for engine in engines)
    error, extent = np.abs(stiff - rigid).max(axis=0), np.ptp(rigid, axis=0)
    # Surface and ground meet the load within an inner step, which is another one in the full model; and the power that
    # is left goes by the tension at the start of a step.
    assert error[:3].max() < {"compensator": 1e-4, "drive": 1e-4, "winch": 5e-4, "splash": 5e-3, "seabed": 1e-3}[name]
    assert (error[3:] < 5e-3 * extent[3]).all()
    slots = (at.TARGET, at.LANDINGS, at.LIFT_OFFS, at.DRUM_RADIUS)
    assert [engines[0].read(slot)[0] for slot in slots] == [engines[1].read(slot)[0] for slot in slots]
    if name == "seabed":
        assert engines[0].read(at.LANDINGS)[0] >= 1.0


@pytest.mark.parametrize("length", [60.0, 1000.0])
def test_at_rest_the_head_bears_load_and_rope(length: float) -> None:
    scenario = steel_load(length, 5e4)
    engine = FlexibleEngine(1, 0.1, MESH)
    engine.reset_row(0, scenario)
    tension = scenario.weight + scenario.rope_weight * scenario.lengths[0]
    assert engine.read(at.TENSION)[0] == pytest.approx(tension, rel=1e-5)
    assert engine.read(at.LOAD_TENSION)[0] == pytest.approx(scenario.weight, rel=1e-9)
    deflection = engine.read_frames()[0, DEFLECTION : DEFLECTION + 3]
    to_drum = np.array(scenario.crane.drum_position) - np.array(scenario.crane.pulley_position) - deflection
    force = tension * (to_drum / np.linalg.norm(to_drum) - np.array([0.0, 0.0, 1.0]))
    case = LoadCase(own_weight=True, forces={"S": tuple(force.tolist())})
    expected = static(scenario.crane, case, model=frame_model(scenario.crane.frame, COARSE))
    assert deflection == pytest.approx(expected.displacement["S"], rel=1e-4)
    before = engine.read_many(at.LOAD_POSITION, 3)
    for _ in range(50):
        engine.step(np.zeros(1))
    assert engine.read_many(at.LOAD_POSITION, 3) == pytest.approx(before, abs=1e-8)


def swung(engine: FlexibleEngine, scenario: Scenario, offset: float, axis: int) -> None:
    """Put the load beside the plumb line, on an arc about the pulley, all of the rope with it."""
    row = engine.row_vector(scenario)
    own = row[len(row) - at.slots(engine._components) :]
    own[at.LOAD_POSITION + axis] += offset
    own[at.LOAD_POSITION + 2] += scenario.rope_length - math.sqrt(scenario.rope_length**2 - offset**2)
    engine.write_row(0, row)


def test_the_head_bears_a_swinging_rope_sideways() -> None:
    """A rod with an end mass that is let go of pulls its pivot by all masses times their accelerations."""
    scenario, mass, offset = still(1000.0, 3e4, 1e4), 3e4, 20.0
    engine = FlexibleEngine(1, 0.05, MESH)
    swung(engine, scenario, offset, 1)
    engine.step(np.zeros(1))
    rope = MU * scenario.lengths[0]
    angle = offset / scenario.rope_length
    expected = G * angle * (mass + 0.5 * rope) ** 2 / (mass + rope / 3.0)
    pull = engine.frames[0, flex.PULL + 1]
    assert pull == pytest.approx(expected, rel=5e-3)
    assert expected < 0.9 * angle * (mass + rope) * G, "the tension alone pulls by more"


def energy(engine: FlexibleEngine, scenario: Scenario) -> float:
    """Energy of frame, rope and load above a still deck, J, by their definitions."""
    frame, row = engine.frames[0], engine.blocks[0]
    found, pulley = frame_energy(engine, scenario.gravity)
    lumps, softness = scenario.springs - 1, 1.0 / scenario.crane.rope.axial_stiffness
    below, speed = row[at.LIFT :][: lumps + 1], row[at.LIFT + at.SPRINGS_MOST :][: lumps + 1]
    position, velocity = row[at.LOAD_POSITION :][:3], row[at.LOAD_VELOCITY :][:3]
    line = position - pulley
    distance = np.linalg.norm(line)
    axis = line / distance
    across = np.linalg.norm(velocity - axis * (axis @ velocity)) / distance
    drum_part = row[at.DRUM_PART]
    inboard = np.linalg.norm(frame[flex.DRUM : flex.DRUM + 3] - pulley)
    over = row[at.DRUM_TO_PULLEY] - inboard
    element = (scenario.free_length + over - drum_part) / lumps
    carried, masses = chain_masses(scenario)
    kinetic = 0.5 * (scenario.load_mass + carried) * velocity @ velocity
    kinetic += 0.5 * masses @ (speed[1:] ** 2 + (below[1:] * across) ** 2)
    potential = scenario.weight * position[2]
    potential += scenario.rope_weight * (element * (pulley[2] + below[1:] * axis[2]).sum() - over * pulley[2])
    ends = np.concatenate([[distance], below[1:], [-row[at.DRUM_TO_PULLEY]]])
    rests = np.full(lumps + 1, element)
    rests[0], rests[-1] = 0.5 * element, 0.5 * element + drum_part
    stretch = np.maximum(ends[:-1] - ends[1:] - rests, 0.0)
    return float(found + kinetic + potential + 0.5 * (stretch**2 / rests).sum() / softness)


def test_energy_of_a_swinging_load_stays() -> None:
    scenario, offset = still(900.0, 3e4), 60.0
    engine = FlexibleEngine(1, 0.05, MESH, max_inner_step=0.00625)
    swung(engine, scenario, offset, 0)
    found, heads = [], []
    for _ in range(600):
        engine.step(np.zeros(1))
        found.append(energy(engine, scenario))
        heads.append(engine.read_frames()[0, DEFLECTION])
    exchanged = scenario.weight * (scenario.rope_length - math.sqrt(scenario.rope_length**2 - offset**2))
    assert np.ptp(heads) > 1e-3
    assert np.ptp(found) < 1e-4 * exchanged


def test_rows_side_by_side_are_rows_alone() -> None:
    scenarios = [
        at_sea(60.0, 5e3),
        at_sea(300.0, 1e5, 0.5),
        at_sea(2900.0, 3e5, water=None, load=LoadShape()),
        at_sea(700.0, 4e3, initial="rest"),
        Scenario.paper(),
        at_sea(120.0, 4e4, **BEYOND["drive"]),
        Scenario.paper("rest", 2e4, motion=SeaMotion(sea=Sea(hs=4.0, tp=8.0, seed=2))),
    ]
    commands = np.random.default_rng(1).uniform(-3.0, 3.0, (30, len(scenarios)))
    mesh = Mesh(COARSE, 6)
    many = FlexibleEngine(len(scenarios), 0.1, mesh)
    alone = [FlexibleEngine(1, 0.1, mesh) for _ in scenarios]
    for i, scenario in enumerate(scenarios):
        many.reset_row(i, scenario)
        alone[i].reset_row(0, scenario)
    slots = (at.LIFT, at.LIFT_SIZE), (at.OMEGA1, 4), (at.PEAK_TENSION, 2), (at.LOAD_TENSION, 1)
    for command in commands:
        many.step(command)
        for i, engine in enumerate(alone):
            engine.step(command[i : i + 1])
        for slot, size in slots:
            side_by_side = many.read_many(slot, size)
            assert np.isfinite(side_by_side).all()
            for i, engine in enumerate(alone):
                assert side_by_side[i].tobytes() == engine.read_many(slot, size)[0].tobytes(), (i, slot)
    frames = many.read_frames()
    for i, engine in enumerate(alone):
        assert frames[i].tobytes() == engine.read_frames()[0].tobytes()


def test_a_slack_rope_pulls_nothing() -> None:
    heave = SeaMotion(sea=Sea(hs=9.0, tp=8.0, seed=2))
    load = LoadShape(volume=0.1, added_mass_vertical=2e4, drag_area_vertical=40.0)
    scenario = at_sea(60.0, 2e3, crane=crane(rope=Rope()), motion=heave, load=load)
    engine = FlexibleEngine(1, 0.05, Mesh(COARSE, 6))
    engine.reset_row(0, scenario)
    slack, tensions, pulls = [], [], []
    for _ in range(600):
        engine.step(np.zeros(1))
        slack.append(engine.read(at.SLACK)[0])
        tensions.append(engine.read(at.TENSION)[0])
        pulls.append(np.linalg.norm(engine.frames[0, flex.PULL : flex.PULL + 3]))
    assert 0.05 < np.mean(slack) < 0.95
    nothing = np.array(tensions) == 0.0
    assert nothing.any()
    np.testing.assert_array_equal(np.array(pulls)[nothing], 0.0)
    assert max(tensions) > 2.0 * scenario.hanging_weight


def test_states_and_copies_go_on_alike() -> None:
    env = AFrameHeaveEnv(model="rfem", rfes=(5, 2), rfem_modes=6, scenario=at_sea(1000.0, 5e4))
    _, info = env.reset(seed=3)
    assert info["rope_tension"] == pytest.approx(env.simulation.source.hanging_weight, rel=1e-3)
    action = np.ones(1, dtype=np.float32)
    for _ in range(5):
        env.step(action)
    state, other = env.get_state(), copy.deepcopy(env)
    expected = [env.step(action)[0] for _ in range(5)]
    copied = [other.step(action)[0] for _ in range(5)]
    env.set_state(state)
    again = [env.step(action)[0] for _ in range(5)]
    np.testing.assert_array_equal(copied, expected)
    np.testing.assert_array_equal(again, expected)


def test_stand_alone_runs_refuse_them() -> None:
    with pytest.raises(InvalidValue, match=r"mass_per_length = 19\.55 kg/m.*stand-alone runs of the full model"):
        DynamicCase(scenario=at_sea(1000.0, 5e4, motion=HarmonicMotion()))
