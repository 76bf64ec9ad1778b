"""Waves about the load, its way through the surface, and the seabed, against linear wave theory and SciPy."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from aframe_env import (
    Crane,
    Harmonic,
    HarmonicMotion,
    InvalidValue,
    LoadShape,
    Rope,
    Scenario,
    Sea,
    Seabed,
    SeaMotion,
    TargetPath,
    Vessel,
    Water,
)
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from train.verify.vertical import Lift

SEA = SeaMotion(sea=Sea(hs=3.0, tp=9.0, heading=2.4, components=24, seed=3, spreading=4))
BOX = LoadShape(
    volume=12.0,
    added_mass_vertical=40e3,
    added_mass_horizontal=20e3,
    drag_area_vertical=50.0,
    drag_area_horizontal=30.0,
    height=3.0,
    slam_area=100.0,
    exit_area=40.0,
)


def steps(scenario: Scenario, count: int, slots: tuple[int, ...], commands: np.ndarray | None = None) -> np.ndarray:
    """Slots (count, len(slots)) after each control step of 0.1 s."""
    engine = Engine(1, 0.1)
    engine.reset_row(0, scenario)
    found = []
    for k in range(count):
        engine.step(np.zeros(1) if commands is None else commands[k : k + 1])
        found.append([engine.read(slot)[0] for slot in slots])
    return np.array(found)


def particle(motion: SeaMotion, point: tuple[float, float, float], time: float) -> tuple[np.ndarray, float]:
    """Velocity (3,) on the deck's axes, and elevation, of linear waves at a place in the ship's axes."""
    waves, k = motion.sea.waves(), motion.sea.waves().frequency ** 2 / 9.81
    x, y, depth = point
    phase = waves.frequency * time + waves.phase - k * (x * np.cos(waves.direction) + y * np.sin(waves.direction))
    moved = waves.amplitude * waves.frequency * np.exp(-k * depth)
    forward, to_port = moved * np.cos(waves.direction), moved * np.sin(waves.direction)
    velocity = np.array(
        [-(forward * np.cos(phase)).sum(), -(to_port * np.cos(phase)).sum(), -(moved * np.sin(phase)).sum()]
    )
    return velocity, float((waves.amplitude * np.cos(phase)).sum())


def test_water_moves_about_the_load_as_linear_waves_have_it() -> None:
    scenario = Scenario(motion=SEA, load_mass=50e3, target_level=-20.0, water=Water(), load=BOX)
    slots = (at.LOAD_POSITION + 2, *range(at.FLOW, at.FLOW + 3), *range(at.FLOW_RATE, at.FLOW_RATE + 3))
    found = steps(scenario, 200, (*slots, at.SURFACE, at.SURFACE + 1))
    vessel, pulley = SEA.vessel, scenario.crane.pulley_position
    x = vessel.deck_position[0] - pulley[0] - vessel.reference_point[0]
    y = vessel.deck_position[1] - pulley[1] - vessel.reference_point[1]
    # What is held over a control step belongs to its start.
    for k in (40, 111, 199):
        point = (x, y, -5.0 - found[k - 1, 0])
        velocity, elevation = particle(SEA, point, 0.1 * k)
        before, after = (particle(SEA, point, 0.1 * k + h) for h in (-1e-4, 1e-4))
        assert found[k, 1:4] == pytest.approx(velocity, abs=1e-9)
        assert found[k, 4:7] == pytest.approx((after[0] - before[0]) / 2e-4, abs=1e-6)
        assert found[k, 7] == pytest.approx(-5.0 + elevation, abs=1e-9)
        assert found[k, 8] == pytest.approx((after[1] - before[1]) / 2e-4, abs=1e-6)


def test_waves_build_up_with_the_ship() -> None:
    scenario = Scenario(motion=SEA, load_mass=50e3, target_level=-20.0, water=Water(), load=BOX, ramp=10.0)
    plain = replace(scenario, ramp=0.0)
    slots = (at.SURFACE, at.LOAD_POSITION + 2)
    ramped, free = steps(scenario, 200, slots)[:, 0] + 5.0, steps(plain, 200, slots)[:, 0] + 5.0
    assert abs(ramped[2]) < 0.01 * abs(free[2])
    assert ramped[50] == pytest.approx(0.5 * free[50], rel=1e-9)
    assert ramped[-1] == pytest.approx(free[-1], abs=1e-12)


def test_waves_do_not_reach_deep_down() -> None:
    deep = Scenario(motion=SEA, load_mass=50e3, target_level=-900.0, water=Water(), load=BOX)
    still = replace(deep, water=Water(waves=False))
    slots = (at.LOAD_POSITION + 2, at.TENSION)
    assert steps(deep, 100, slots) == pytest.approx(steps(still, 100, slots), rel=1e-6)


def test_small_load_goes_round_with_the_water() -> None:
    """Held by almost nothing, a neutral load follows the orbit: radius a exp(-k d), whatever its drag."""
    wave = Sea(hs=2.0, tp=8.0, heading=math.pi, components=1, seed=1)
    vessel = replace(Vessel.supply(), response=0.0 * Vessel.supply().response)
    shape = LoadShape(
        volume=9.75, added_mass_vertical=9e3, added_mass_horizontal=9e3, drag_area_vertical=80, drag_area_horizontal=80
    )
    scenario = Scenario(
        crane=Crane(rope=Rope(axial_stiffness=200.0)),
        motion=SeaMotion(sea=wave, vessel=vessel),
        load_mass=10e3,
        target_level=-25.0,
        water=Water(),
        load=shape,
        initial="rest",
    )
    # Velocities: the place drifts with the slow bobbing, of six minutes.
    found = steps(scenario, 400, (at.LOAD_POSITION + 2, at.LOAD_VELOCITY, at.LOAD_VELOCITY + 2))[250:]
    waves, depth = wave.waves(), -5.0 - found[:, 0].mean()
    speed = waves.amplitude[0] * waves.frequency[0] * math.exp(-(waves.frequency[0] ** 2) / 9.81 * depth)
    assert 0.5 * np.ptp(found[:, 1]) == pytest.approx(speed, rel=0.04)
    assert 0.5 * np.ptp(found[:, 2]) == pytest.approx(speed, rel=0.04)


def heave(amplitude: float, period: float) -> HarmonicMotion:
    return HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=amplitude, period=period),))


def test_splash_in_calm_water() -> None:
    """From 6 m above the surface to 8 m below it at 0.8 m/s: buoyancy, added mass, drag and slam by hand."""
    scenario = Scenario(
        motion=heave(0.5, 7.0), load_mass=60e3, target_level=1.0, water=Water(), load=BOX, rope_damping=1e5
    )
    times = 0.1 * np.arange(1, 251)
    commands = np.full(250, 0.8 / 0.75)
    found = steps(scenario, 250, (at.LOAD_POSITION + 2, at.LOAD_VELOCITY + 2, at.TENSION), commands)

    def paid_out(t: float) -> float:
        # The drum gathers speed at 2 m/s².
        return 0.0 if t < 0.0 else t * t if t < 0.4 else 0.16 + 0.8 * (t - 0.4)

    oracle = Lift(scenario, lambda t: 0.5 * math.sin(2.0 * math.pi * t / 7.0), paid_out, lambda t: -5.0)
    z, v, _ = oracle.run(times)
    assert z[0] > 0.5
    assert z[-1] < -14.0
    assert found[:, 0] == pytest.approx(z, abs=1e-3)
    assert found[:, 1] == pytest.approx(v, abs=5e-3)
    # Under water the rope bears what is left of the weight, with what its drag takes off.
    assert found[-40:, 2].mean() == pytest.approx(scenario.load_mass * 9.81 - 1025 * 12 * 9.81, rel=0.1)


def test_splash_out_of_the_water_in_waves() -> None:
    """Hauled in through waves: the surface is the sea's own under the pulley."""
    vessel = replace(Vessel.supply(), response=0.0 * Vessel.supply().response)
    motion = SeaMotion(sea=replace(SEA.sea, hs=1.5), vessel=vessel)
    shape = replace(BOX, added_mass_horizontal=0.0, drag_area_vertical=0.0, drag_area_horizontal=0.0)
    scenario = Scenario(motion=motion, load_mass=60e3, target_level=-9.0, water=Water(), load=shape, rope_damping=1e5)
    slots = (at.LOAD_POSITION + 2, at.LOAD_TENSION, *range(at.SURFACE, at.SURFACE + 2))
    found = steps(scenario, 200, slots, np.full(200, -0.6 / 0.75))
    assert found[0, 0] < -8.5
    assert found[-1, 0] > 1.0
    dry = found[-20:, 1]
    assert dry.mean() == pytest.approx(60e3 * 9.81, rel=0.02)
    # Where the load is wholly under water, the rope carries weight, buoyancy, and the water's own acceleration.
    assert found[:20, 1].mean() == pytest.approx(60e3 * 9.81 - 1025 * 12 * 9.81, rel=0.1)


def test_load_lands_and_is_lifted_again() -> None:
    bed = Seabed(depth=195.0, stiffness=1.5e6, damping=1.5e5)
    scenario = Scenario(
        motion=heave(0.6, 9.0),
        load_mass=60e3,
        target_level=-198.2,
        water=Water(seabed=bed),
        load=replace(BOX, slam_area=0.0, exit_area=0.0),
        rope_damping=1e5,
    )
    times = 0.1 * np.arange(1, 401)
    found = steps(
        scenario,
        400,
        (at.LOAD_POSITION + 2, at.TENSION, at.LANDINGS, at.LIFT_OFFS, at.LANDING_SPEED, at.CONTACT),
        np.full(400, 0.05 / 0.75),
    )

    def paid_out(t: float) -> float:
        return 0.0 if t < 0.0 else t * t if t < 0.025 else 0.000625 + 0.05 * (t - 0.025)

    oracle = Lift(
        scenario,
        lambda t: 0.6 * math.sin(2.0 * math.pi * t / 9.0),
        paid_out,
        lambda t: -5.0,
        (-200.0, bed.stiffness, bed.damping),
    )
    z, v, _ = oracle.run(times, 2e-3)
    assert found[:, 0] == pytest.approx(z, abs=2e-3)
    on_bed = z - 1.5 < -200.0
    landings = int((on_bed[1:] & ~on_bed[:-1]).sum())
    assert landings >= 2
    assert found[-1, 2] == landings
    assert found[-1, 3] == int((~on_bed[1:] & on_bed[:-1]).sum())
    first = int(np.argmax(on_bed))
    assert found[first, 4] == pytest.approx(-v[first - 1], abs=0.15)
    # In the end the rope is slack and the ground bears all of it.
    assert found[-1, 1] == 0.0
    weight = (60e3 - 1025 * 12) * 9.81
    assert found[-1, 0] == pytest.approx(-198.5 - weight / bed.stiffness, abs=1e-3)
    assert found[-1, 5] == pytest.approx(weight, rel=1e-3)


def test_rope_of_any_kind_lands() -> None:
    """In a block of ropes of all kinds each row lands as it does alone, to the bit."""
    rng, water = np.random.default_rng(1), Water(seabed=Seabed(depth=1000.0))
    heavy = Scenario(
        crane=Crane(rope=Rope.six_strand()),
        motion=SEA,
        load_mass=50e3,
        target_level=-1000.0,
        water=water,
        load=BOX,
        target_path=TargetPath.lowering(-3.4, 1.0, start=2.0),
    )
    others = [
        heavy,
        Scenario(motion=SEA, load_mass=50e3, target_level=-1000.0, water=water, load=BOX),
        Scenario(motion=SEA, load_mass=50e3, target_level=-300.0),
        Scenario(motion=SEA, load_mass=50e3, target_level=2.0, water=Water(), load=BOX, ramp=5.0),
    ]
    together = Engine(len(others), 0.1)
    alone = [Engine(1, 0.1) for _ in others]
    for k, scenario in enumerate(others):
        together.reset_row(k, scenario)
        alone[k].reset_row(0, scenario)
    for _ in range(150):
        commands = np.array([1.5, 1.0, 0.2, 1.0]) * rng.uniform(0.5, 1.0, 4)
        together.step(commands)
        for k, engine in enumerate(alone):
            engine.step(commands[k : k + 1])
    slots = (at.LOAD_POSITION, at.LOAD_POSITION + 2, at.TENSION, at.LANDINGS, at.CONTACT, at.SURFACE, at.OMEGA1)
    for slot in slots:
        assert together.read(slot).tolist() == [engine.read(slot)[0] for engine in alone]
    assert together.read(at.LANDINGS)[0] >= 1.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Water(waves=1), "waves = 1"),  # type: ignore[arg-type]
        (lambda: Seabed(depth=0.0), "depth = 0.0"),
        (lambda: LoadShape(slam_area=3.0), "height = 0.0 m"),
        (lambda: LoadShape(height=-1.0), "height = -1.0"),
    ],
)
def test_water_says_what_is_wrong(make, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidValue, match=message):
        make()
