"""Checks of waves, surface, seabed, winch and compensator against linear wave theory, SciPy and closed forms."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.scenario import (
    LOADS,
    Compensator,
    Crane,
    Harmonic,
    HarmonicMotion,
    LoadShape,
    Rope,
    Scenario,
    Sea,
    Seabed,
    SeaMotion,
    Water,
    Winch,
)
from train.verify.fine_chain import FineChain
from train.verify.report import Check
from train.verify.rope_checks import steel_load
from train.verify.vertical import FloatArray, Lift

PERIOD = 0.1
"""Control step, s."""


@dataclass(frozen=True)
class Episode:
    """A lift here, and by SciPy, at the ends of the control steps."""

    times: FloatArray
    z: FloatArray
    """Level of the load, m."""
    reference: FloatArray
    """By SciPy, m."""
    tension: FloatArray
    """At the load, N."""
    landings: int
    surface: float
    bed: float
    """Levels, m."""
    height: float
    """Of the load, m."""

    @property
    def gap(self) -> float:
        """Greatest difference, m."""
        return float(np.abs(self.z - self.reference).max())


def track(scenario: Scenario, commands: FloatArray, slots: tuple[int, ...]) -> FloatArray:
    """Slots (len(slots), T) after each control step."""
    engine = Engine(1, PERIOD)
    engine.reset_row(0, scenario)
    found = []
    for command in commands:
        engine.step(np.full(1, command))
        found.append([engine.read(slot)[0] for slot in slots])
    return np.array(found).T


def control_steps(seconds: float) -> FloatArray:
    """Ends of the control steps, s."""
    return np.asarray(PERIOD * np.arange(1, round(seconds / PERIOD) + 1), dtype=np.float64)


def heaving(amplitude: float, period: float) -> tuple[HarmonicMotion, Callable[[float], float]]:
    """A ship that heaves, and its heave [m] at a time [s]."""
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=amplitude, period=period),))
    return motion, lambda t: amplitude * math.sin(2.0 * math.pi * t / period)


def paying_out(speed: float, acceleration: float = 2.0) -> Callable[[float], float]:
    """Rope [m] that a winch has paid out at a time [s] which gathers ``speed`` [m/s] from rest."""
    ramp = speed / acceleration
    return lambda t: 0.0 if t < 0.0 else 0.5 * acceleration * min(t, ramp) ** 2 + speed * max(t - ramp, 0.0)


def lowered(scenario: Scenario, heave: Callable[[float], float], speed: float, seconds: float, fine: float) -> Episode:
    """Lower a load at ``speed`` m/s, here and by SciPy with steps of at most ``fine`` s."""
    times = control_steps(seconds)
    radius = scenario.crane.winch.drum_radius
    slots = (at.LOAD_POSITION + 2, at.LOAD_TENSION, at.LANDINGS)
    z, tension, landings = track(scenario, np.full(len(times), speed / radius), slots)
    assert scenario.water is not None
    bed = scenario.water.seabed
    ground = (scenario.bed_level, bed.stiffness, bed.damping) if bed is not None else (-1e9, 0.0, 0.0)
    surface = scenario.water.surface_level
    lift = Lift(scenario, heave, paying_out(speed), lambda t: surface, ground)
    reference = lift.run(times, fine)[0]
    return Episode(times, z, reference, tension, int(landings[-1]), surface, scenario.bed_level, scenario.load.height)


@cache
def splash() -> Episode:
    """Lower a manifold through the surface of calm water, from a ship that heaves by half a metre."""
    motion, heave = heaving(0.5, 7.0)
    ready = LOADS["manifold"]
    scenario = Scenario(
        motion=motion,
        load_mass=ready.mass,
        target_level=1.0,
        water=Water(),
        load=replace(ready.shape, added_mass_horizontal=0.0, exit_area=60.0),
        rope_damping=1e5,
    )
    return lowered(scenario, heave, 0.8, 25.0, 2e-3)


@cache
def landing() -> Episode:
    """Lower a load of 60 t onto the seabed, from a ship that heaves by 0.6 m."""
    motion, heave = heaving(0.6, 9.0)
    shape = LoadShape(volume=12.0, added_mass_vertical=40e3, drag_area_vertical=50.0, height=3.0)
    scenario = Scenario(
        motion=motion,
        load_mass=60e3,
        target_level=-198.2,
        water=Water(seabed=Seabed(depth=195.0, stiffness=1.5e6, damping=1.5e5)),
        load=shape,
        rope_damping=1e5,
    )
    return lowered(scenario, heave, 0.05, 40.0, 2e-3)


def surface() -> Check:
    """Check the way through the surface: buoyancy, added mass, drag and slam."""
    found = splash()
    return Check(
        name="manifold of 100 t through the surface at 0.8 m/s, heave of 0.5 m",
        bar="load within 2 mm of SciPy's",
        measured=f"{1e3 * found.gap:.2f} mm",
        passed=found.gap <= 2e-3,
    )


def seabed() -> Check:
    """Check touch-down and lift-off."""
    found = landing()
    low = found.reference - 0.5 * found.height < found.bed
    landings = int((low[1:] & ~low[:-1]).sum())
    return Check(
        name="60 t onto the seabed, heave of 0.6 m",
        bar="load within 2 mm of SciPy's, as many landings",
        measured=f"{1e3 * found.gap:.2f} mm, {found.landings} landings for {landings}",
        passed=found.gap <= 2e-3 and found.landings == landings > 1,
    )


def waves() -> Check:
    """Check the water's motion about the load and its surface against linear waves, term by term."""
    motion = SeaMotion(sea=Sea(hs=3.0, tp=9.0, heading=2.4, components=24, seed=3, spreading=4))
    scenario = Scenario(motion=motion, load_mass=50e3, target_level=-20.0, water=Water(), load=LOADS["rov-cage"].shape)
    slots = (at.LOAD_POSITION + 2, *range(at.FLOW, at.FLOW + 3), at.SURFACE)
    found = track(scenario, np.zeros(400), slots)
    vessel, sea, pulley = motion.vessel, motion.sea.waves(), scenario.crane.pulley_position
    number = sea.frequency**2 / scenario.gravity
    x = vessel.deck_position[0] - pulley[0] - vessel.reference_point[0]
    y = vessel.deck_position[1] - pulley[1] - vessel.reference_point[1]
    # What is found in a control step belongs to its start.
    times, level = PERIOD * np.arange(1, 400), found[0, :-1]
    phase = (
        np.outer(times, sea.frequency) + sea.phase - number * (x * np.cos(sea.direction) + y * np.sin(sea.direction))
    )
    moved = sea.amplitude * sea.frequency * np.exp(np.outer(level + 5.0, number))
    speeds = np.stack(
        [
            -(moved * np.cos(sea.direction) * np.cos(phase)).sum(axis=1),
            -(moved * np.sin(sea.direction) * np.cos(phase)).sum(axis=1),
            -(moved * np.sin(phase)).sum(axis=1),
        ]
    )
    elevation = (sea.amplitude * np.cos(phase)).sum(axis=1)
    gap = float(np.abs(found[1:4, 1:] - speeds).max())
    height = float(np.abs(found[4, 1:] + 5.0 - elevation).max())
    return Check(
        name="water about the load 15 m down, short-crested sea of 3 m, 40 s",
        bar="linear waves within 1e-9 m/s, surface within 1e-9 m",
        measured=f"{gap:.0e} m/s of up to {np.abs(speeds).max():.2f}; {height:.0e} m",
        passed=gap <= 1e-9 and height <= 1e-9,
    )


def compensator() -> Check:
    """Check a passive compensator under a load that follows a heaving ship."""
    worst, parts = 0.0, []
    motion, heave = heaving(1.5, 9.0)
    times = control_steps(40.0)
    for damping in (2e4, 4e5):
        cylinder = Compensator(stroke=6.0, gas_length=60.0, damping=damping)
        scenario = Scenario(
            crane=Crane(compensator=cylinder), motion=motion, load_mass=50e3, target_level=-200.0, rope_damping=2e5
        )
        z, stroke = track(scenario, np.zeros(400), (at.LOAD_POSITION + 2, at.STROKE))
        reference = Lift(scenario, heave).run(times)
        worst = max(worst, float(np.abs(z - reference[0]).max()), float(np.abs(stroke - reference[2]).max()))
        parts.append(f"{np.ptp(stroke):.2f} m of stroke")
    return Check(
        name="passive compensator, heave of 1.5 m at 9 s, damped little and much",
        bar="load and stroke within 0.2 mm of SciPy's",
        measured=f"{1e3 * worst:.3f} mm, with {' and '.join(parts)}",
        passed=worst <= 2e-4,
    )


def winch() -> Check:
    """Check power, torque, the layers' radii and the pulley's friction against their definitions."""
    weight, radius = 50e3 * 9.81, 0.75
    base = Scenario(motion=HarmonicMotion(), load_mass=50e3, target_level=-200.0, rope_damping=1e6)

    def errors() -> tuple[float, float, float]:
        limited = replace(base, crane=Crane(winch=Winch(max_power=4e5)))
        speed, tension = track(limited, np.full(200, -4.0), (at.DRUM_SPEED, at.TENSION))[:, -1]
        power = abs(-speed * radius * tension / 4e5 - 1.0)
        torque, inertia = 0.9 * weight * radius, 4e4
        weak = replace(base, crane=Crane(winch=Winch(max_torque=torque, inertia=inertia)))
        slip = track(weak, np.full(1, -4.0), (at.DRUM_SPEED,))[0, 0]
        overcome = abs(slip / (PERIOD * (weight * radius - torque) / inertia) - 1.0)
        rough = replace(base, crane=Crane(sheave_friction=0.03))
        tension, at_load = track(rough, np.full(300, -0.2), (at.TENSION, at.LOAD_TENSION))[:, -1]
        slide = 0.15 / math.hypot(0.15, 0.02)
        return power, overcome, abs(tension / at_load - 1.0 - 0.03 * slide) / 0.03

    power, overcome, friction = errors()
    layered = replace(
        base,
        crane=Crane(winch=Winch(drum_width=2.0, max_rope_length=600.0), rope=Rope(outer_diameter=0.07)),
    )
    angle, drum, free = track(layered, np.full(1000, 3.0), (at.DRUM_ANGLE, at.DRUM_RADIUS, at.FREE_LENGTH))[:, -1]
    height, turns = layered.crane.layer
    left, turned = [600.0 - layered.free_length, 600.0 - (free + drum * angle)], [0.0, 0.0]
    for end in range(2):
        for layer in range(9):
            part = min(left[end], 2.0 * math.pi * (radius + layer * height) * turns)
            turned[end] += part / (radius + layer * height)
            left[end] -= part
    gap = abs(angle - (turned[0] - turned[1]))
    return Check(
        name="winch: power, torque overcome, pulley's friction, three layers of rope",
        bar="0.5 %, 0.5 %, 1 %; 0.03 rad",
        measured=f"{power:.2%}, {overcome:.2%}, {friction:.2%}; {gap:.3f} rad of {angle:.0f}",
        passed=max(power, overcome) <= 5e-3 and friction <= 1e-2 and gap <= 0.03,
    )


def _rough(length: float, mass: float, added: float, drag_area: float, amplitude: float, period: float) -> FloatArray:
    """Load [m] and tension at S [N] here and by many elements, 60 s from rest: (2, 2, T)."""
    motion, heave = heaving(amplitude, period)
    scenario = steel_load(length, mass, added, Rope.six_strand(breaking_load=1e8), motion=motion)
    scenario = replace(scenario, load=replace(scenario.load, drag_area_vertical=drag_area))
    times, omega = control_steps(60.0), 2.0 * math.pi / period
    here = track(scenario, np.zeros(len(times)), (at.LOAD_POSITION + 2, at.TENSION))
    chain = FineChain(scenario, heave, lambda t: omega * amplitude * math.cos(omega * t))
    return np.array([here, chain.run(times)])


def resonance() -> Check:
    """Check a load at its resonance, which only the drag of the water limits."""
    here, there = _rough(3000.0, 5e4, 4e4, 40.0, 1.5, 8.0)
    gap, extent = float(np.abs(here[0] - there[0]).max()), float(np.ptp(there[0]))
    return Check(
        name="resonance limited by drag: 3,000 m, 50 t and 40 t of water, heave of 1.5 m at 8 s",
        bar="load within 0.1 % of its range of 60 elements'",
        measured=f"{1e3 * gap:.1f} mm of {extent:.1f} m",
        passed=gap <= 1e-3 * extent,
    )


def snap() -> Check:
    """Check a light load whose rope goes slack and snaps taut with every wave."""
    here, there = _rough(1000.0, 2e4, 2e4, 60.0, 3.0, 5.0)
    gap, extent = float(np.abs(here[0] - there[0]).max()), float(np.ptp(there[0]))
    peak = float(here[1].max() / there[1].max() - 1.0)
    return Check(
        name="slack and snap: 1,000 m, 20 t and 20 t of water, heave of 3 m at 5 s",
        bar="load within 2 % of its range of 60 elements', greatest tension within 5 %",
        measured=f"{1e3 * gap:.0f} mm of {extent:.1f} m, {peak:.1%}",
        passed=gap <= 0.02 * extent and abs(peak) <= 0.05,
    )


CHECKS = (resonance, snap, surface, seabed, waves, compensator, winch)
