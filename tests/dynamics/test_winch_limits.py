"""Power, torque, layers of rope, the pulley's friction and passive compensators, against closed forms and SciPy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aframe_env import Compensator, Crane, Harmonic, HarmonicMotion, InvalidValue, Rope, Scenario, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from train.verify.vertical import Lift

WEIGHT = 50e3 * 9.81
RADIUS = 0.75


def lift(crane: Crane, motion: HarmonicMotion | None = None, rope_damping: float = 2e5) -> Scenario:
    """50 t at 200 m below a ship at rest, on a rope so damped that it hardly bobs."""
    return Scenario(
        crane=crane,
        motion=motion or HarmonicMotion(),
        load_mass=50e3,
        target_level=-200.0,
        rope_damping=rope_damping,
    )


def drive(scenario: Scenario, speed: float, seconds: float, slots: tuple[int, ...]) -> np.ndarray:
    """Slots (T, len(slots)) at every control step of 0.1 s, the command held."""
    engine = Engine(1, 0.1)
    engine.reset_row(0, scenario)
    found = []
    for _ in range(round(seconds / 0.1)):
        engine.step(np.array([speed]))
        found.append([engine.read(slot)[0] for slot in slots])
    return np.array(found)


def test_power_limits_the_speed_at_which_the_load_comes_up() -> None:
    found = drive(lift(Crane(winch=Winch(max_power=4e5))), -4.0, 20.0, (at.DRUM_SPEED, at.TENSION))
    speed, tension = found[-1]
    assert -speed * RADIUS * tension == pytest.approx(4e5, rel=2e-3)
    assert -speed * RADIUS == pytest.approx(4e5 / WEIGHT, rel=2e-2)


def test_power_leaves_a_slow_drum_alone() -> None:
    limited = drive(lift(Crane(winch=Winch(max_power=4e5))), -0.5, 5.0, (at.DRUM_ANGLE,))
    free = drive(lift(Crane()), -0.5, 5.0, (at.DRUM_ANGLE,))
    assert limited == pytest.approx(free, abs=1e-12)


def test_torque_left_over_by_the_load_accelerates_drum() -> None:
    inertia, torque = 4e4, 1.2 * WEIGHT * RADIUS
    found = drive(lift(Crane(winch=Winch(max_torque=torque, inertia=inertia))), -4.0, 1.0, (at.DRUM_SPEED, at.TENSION))
    # The tension at the start of each control step holds over it.
    speed, tension = 0.0, WEIGHT
    for now, after in found:
        speed -= 0.1 * (torque - tension * RADIUS) / inertia
        assert now == pytest.approx(speed, rel=1e-9)
        tension = after


def test_load_overcomes_a_weak_drum() -> None:
    inertia, torque = 4e4, 0.9 * WEIGHT * RADIUS
    found = drive(lift(Crane(winch=Winch(max_torque=torque, inertia=inertia))), -4.0, 0.1, (at.DRUM_SPEED,))
    assert found[0, 0] == pytest.approx(0.1 * (WEIGHT * RADIUS - torque) / inertia, rel=1e-6)


def test_drum_gives_as_much_rope_a_turn_as_its_layers_have() -> None:
    crane = Crane(winch=Winch(drum_width=2.0, max_rope_length=600.0), rope=Rope(outer_diameter=0.07))
    scenario = lift(crane)
    found = drive(scenario, 3.0, 100.0, (at.DRUM_ANGLE, at.DRUM_RADIUS, at.FREE_LENGTH))
    angle, radius, free = found[-1]
    length = free + radius * angle
    # 28 turns a layer, 60.6 mm from layer to layer; the innermost full first.
    turns, height = 28, 0.07 * math.sqrt(0.75)
    full = [2.0 * math.pi * (RADIUS + k * height) * turns for k in range(9)]

    def turned(paid_out: float) -> float:
        left, angle = 600.0 - paid_out, 0.0
        for k in range(9):
            part = min(left, full[k])
            angle += part / (RADIUS + k * height)
            left -= part
        return -angle

    assert length - scenario.free_length > 200.0
    # A layer is found at the start of a control step: some 0.2 m of rope run off at the radius before.
    assert angle == pytest.approx(turned(length) - turned(scenario.free_length), abs=0.3 * 0.081 / RADIUS)
    assert np.unique(found[:, 1]).size == 3


@pytest.mark.parametrize(("speed", "side"), [(-0.2, 1.0), (0.2, -1.0)])
def test_pulley_takes_its_share_of_the_tension(speed: float, side: float) -> None:
    found = drive(lift(Crane(sheave_friction=0.03), rope_damping=1e6), speed, 30.0, (at.TENSION, at.LOAD_TENSION))
    tension, at_load = found[-1]
    assert at_load == pytest.approx(WEIGHT, rel=1e-3)
    creep = 0.2 * RADIUS / math.hypot(0.2 * RADIUS, 0.02)
    assert tension == pytest.approx(at_load * (1.0 + side * 0.03 * creep), rel=1e-3)


@pytest.mark.parametrize("damping", [2e4, 4e5])
def test_compensator_moves_as_gas_and_damper_let_it(damping: float) -> None:
    cylinder = Compensator(stroke=6.0, gas_length=60.0, damping=damping)
    heave = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=1.5, period=9.0),))
    scenario = lift(Crane(compensator=cylinder), heave)
    found = drive(scenario, 0.0, 40.0, (at.LOAD_POSITION + 2, at.STROKE))
    times = 0.1 * np.arange(1, 401)
    z, _, stroke = Lift(scenario, lambda t: 1.5 * math.sin(2.0 * math.pi * t / 9.0)).run(times)
    assert np.ptp(stroke) > 0.3
    assert found[:, 1] == pytest.approx(stroke, abs=2e-4)
    assert found[:, 0] == pytest.approx(z, abs=2e-4)


def test_compensator_stands_at_the_end_of_its_stroke() -> None:
    cylinder = Compensator(stroke=1.0, gas_length=60.0, damping=2e4)
    heave = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=2.0, period=9.0),))
    found = drive(lift(Crane(compensator=cylinder), heave), 0.0, 60.0, (at.STROKE,))
    assert np.abs(found).max() == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"winch": Winch(drum_width=2.0)}, "outer_diameter = 0.0 m"),
        ({"sheave_friction": 0.5}, "sheave_friction = 0.5"),
        ({"compensator": 3.0}, "compensator = 3.0"),
    ],
)
def test_crane_says_what_does_not_go_together(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        Crane(**changes)  # type: ignore[arg-type]


def test_torque_needs_an_inertia() -> None:
    with pytest.raises(InvalidValue, match="must both be 0, or neither"):
        Winch(max_torque=1e5)
