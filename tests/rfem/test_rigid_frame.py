"""Forces on the rigid frame, against Lagrange's equation of a cloud of masses, statics, and conservation of energy."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aframe_env import Crane, Frame, HarmonicMotion, Luffing, Rope, Scenario, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.rfem.rigid_frame import frame_forces
from aframe_env.scenario.cross_sections import FrameStructure, SolidRectangle

sys.path.insert(0, str(Path(__file__).parents[1] / "dynamics"))
import oracle

INBOARD, OUTBOARD = math.radians(-40.0), math.radians(25.0)
# Slender members, which points on their axes stand for.
THIN = SolidRectangle(side_2=0.05, side_3=0.05)
FRAME = Frame(luffing_angle=INBOARD, structure=FrameStructure(leg_section=THIN, beam_section=THIN))
LUFFING = Luffing.swing(INBOARD, OUTBOARD, 1.0, 30.0, max_speed=0.5)
SCENARIO = Scenario(
    # So soft that the load's bobbing is seen well at the steps of the test.
    crane=Crane(frame=FRAME, rope=Rope(axial_stiffness=2e6), winch=Winch(min_rope_length=5.0)),
    load_mass=2e3,
    target_level=-20.0,
    rope_damping=2e3,
    luffing=LUFFING,
)


def run(scenario: Scenario, commands: oracle.FloatArray, period: float) -> oracle.FloatArray:
    """Load's place and velocity, tension, drum's angle and speed, (T + 1, 9)."""
    engine = Engine(1, period, max_inner_step=0.005)
    engine.reset_row(0, scenario)
    slots = [*range(at.LOAD_POSITION, at.LOAD_POSITION + 6), at.TENSION, at.DRUM_ANGLE, at.DRUM_SPEED]
    out = [[engine.read(slot)[0] for slot in slots]]
    for command in commands:
        engine.step(np.array([command]))
        out.append([engine.read(slot)[0] for slot in slots])
    return np.array(out)


def masses() -> tuple[oracle.FloatArray, float]:
    """Points of equal mass along legs and beam in {F}, (n, 3) m, and the mass of each, kg."""
    share = (np.arange(320) + 0.5) / 320
    up, zero = 12.0 * share, 0.0 * share
    across = (10.0 * (np.arange(267) + 0.5) / 267) - 5.0
    legs = [np.stack([zero, zero + side, up], axis=1) for side in (-5.0, 5.0)]
    beam = np.stack([0.0 * across, across, 0.0 * across + 12.0], axis=1)
    points = np.concatenate([*legs, beam])
    return points, 34.0 * 0.05**2 * 7850.0 / len(points)


def test_servomotors_obey_lagrange_on_a_deck_that_moves_in_all_ways() -> None:
    scenario = replace(SCENARIO, motion=oracle.SixDofMotion(3))
    step, count = 0.1, 320
    found = run(scenario, np.zeros(count), step)
    forces = frame_forces(scenario, step, found[:, :3], found[:, 6])
    swing = LUFFING.at(FRAME, step * np.arange(count + 1))
    points, mass = masses()
    motion = scenario.motion.components()

    def places(t: float, angle: float) -> oracle.FloatArray:
        """Base frame, (n, 3)."""
        q = motion.at(np.array([t]))[0, 0]
        (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in q[3:].tolist())
        about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
        about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        c, s = math.cos(angle), math.sin(angle)
        luffed = points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
        return luffed @ (about_z @ about_y @ about_x).T + q[:3]

    h = 1e-4
    for k in (15, 80, 160, 240, 300):
        t, angle, rate, bend = step * k, swing.angle[k], swing.angle_rate[k], swing.angle_acceleration[k]
        path = [places(t + d, angle + rate * d + 0.5 * bend * d * d) for d in (-h, 0.0, h)]
        acceleration = (path[0] - 2.0 * path[1] + path[2]) / h**2
        slope = (places(t, angle + h) - places(t, angle - h)) / (2.0 * h)
        # d'Alembert and Lagrange: what is left for the servomotors of the virtual work of all the rest.
        virtual = mass * float(((acceleration + np.array([0.0, 0.0, 9.81])) * slope).sum())
        tip = np.array([oracle.pulley(oracle.of_components(motion), tuple(p))(t)[:3] for p in _tips(angle, h)])
        drum = oracle.pulley(oracle.of_components(motion), scenario.crane.drum_position)(t)[:3]
        rope = np.linalg.norm(found[k, :3] - tip, axis=1) + np.linalg.norm(drum - tip, axis=1)
        virtual += found[k, 6] * (rope[1] - rope[0]) / (2.0 * h)
        lengths = [math.hypot(4.8 * math.sin(a) + 5.0, 4.8 * math.cos(a)) for a in (angle - h, angle + h)]
        expected = virtual * 2.0 * h / (lengths[1] - lengths[0])
        assert forces.servomotor_force[k] == pytest.approx(expected, rel=2e-4)


def _tips(angle: float, h: float) -> list[tuple[float, float, float]]:
    return [(12.0 * math.sin(a), 0.0, 12.0 * math.cos(a)) for a in (angle - h, angle + h)]


def test_work_of_servomotors_drum_and_deck_is_the_change_of_energy() -> None:
    scenario = replace(SCENARIO, rope_damping=0.0, motion=HarmonicMotion.paper())
    step, count = 0.005, 7000
    found = run(scenario, 0.2 * np.sin(0.5 * step * np.arange(count)), step)
    times = step * np.arange(count + 1)
    forces = frame_forces(scenario, step, found[:, :3], found[:, 6])
    swing, deck = LUFFING.at(FRAME, times), scenario.motion.components().at(times)
    place, speed = deck[0, :, :3], deck[1, :, :3]  # no rotation in the paper's case
    points, mass = masses()
    s, c = np.sin(swing.angle)[:, None], np.cos(swing.angle)[:, None]
    x, z = points[:, 0] * c + points[:, 2] * s, points[:, 2] * c - points[:, 0] * s
    rate = swing.angle_rate[:, None]
    moving = 0.5 * mass * ((z * rate + speed[:, :1]) ** 2 + (speed[:, 2:] - x * rate) ** 2).sum(axis=1)
    height = 9.81 * mass * (z + place[:, 2:]).sum(axis=1)
    load = scenario.load_mass * (0.5 * (found[:, 3:6] ** 2).sum(axis=1) + 9.81 * found[:, 2])
    axial, length = scenario.crane.rope.axial_stiffness, scenario.free_length + 0.75 * found[:, 7]
    rope = 0.5 * found[:, 6] ** 2 * length / axial
    # Rope that is paid out under tension takes its strain along: c_R = E F / l grows softer by it.
    strain = found[:, 6] / axial
    drum = -found[:, 6] * (1.0 + 0.5 * strain) * 0.75 * found[:, 8]
    tip = swing.pulley
    to_drum = np.array(scenario.crane.drum_position) - tip
    to_drum /= np.linalg.norm(to_drum, axis=1)[:, None]
    along = 4.8 * tip / 12.0 - [-5.0, 0.0, 0.0]
    along /= np.linalg.norm(along, axis=1)[:, None]
    on_deck = forces.foot_reaction + forces.servomotor_force[:, None] * along + found[:, 6:7] * to_drum
    power = forces.luffing_power + drum + (on_deck * speed).sum(axis=1)
    energy = moving + height + load + rope
    work = np.concatenate([[0.0], np.cumsum(0.5 * step * (power[1:] + power[:-1]))])
    exchanged = float(np.abs(power).sum() * step)
    assert np.abs(energy - energy[0] - work).max() < 2e-5 * exchanged
