"""Checks of a frame that luffs, against a multibody program and SciPy."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from aframe_env.rfem.beam import Array
from aframe_env.rfem.model import FrameModel, frame_model
from aframe_env.rfem.reference import time_series
from aframe_env.rfem.simulate import DynamicCase, simulate
from aframe_env.rfem.statics import LoadCase, static
from aframe_env.rfem.structure import Division
from aframe_env.scenario import Luffing, Scenario
from aframe_env.scenario.crane import Crane, Frame
from train.verify.cases import dynamic_columns
from train.verify.report import Check, Row
from train.verify.run_checks import EVERY_COLUMN, Comparison, stiffened

INBOARD, OUTBOARD = math.radians(-20.0), math.radians(25.0)
BEGIN, DURATION, RAMP = 1.0, 20.0, 5.0
"""When the swing begins, how long it takes, and over what the ship's motion builds up; s."""
DIVISION = Division(leg=20, beam=16)
FRAME_COLUMNS = ("uS1_m", "uS3_m", "S_R_N", "RAR1_N", "RAR2_N", "RAR3_N")
COLUMNS = ("xL1_m", "xL3_m", "T_rope_N", *FRAME_COLUMNS)
LITTLE_SECOND_ORDER = ("xL1_m", "xL3_m", "T_rope_N", "S_R_N", "RAR1_N", "RAR3_N")
"""Columns of which second order in the displacements is below 1 % of their range."""


def swing(stiffer: float = 1.0) -> Scenario:
    """100 t and the paper's motion while the frame swings outboard; its material ``stiffer`` times as stiff."""
    frame = stiffened(Frame(luffing_angle=INBOARD), stiffer)
    luffing = Luffing.swing(INBOARD, OUTBOARD, BEGIN, DURATION, max_speed=0.3)
    return Scenario.paper(crane=Crane(frame=frame), rope_damping=2e4, ramp=RAMP, luffing=luffing)


@cache
def swing_run(stiffer: float = 1.0, second_order: bool = False) -> Comparison:
    """Simulate the swing of a frame 1 or 10 times as stiff, 26 s, linear or with its geometric stiffness."""
    scenario = swing(stiffer)
    case = DynamicCase(scenario=scenario, duration=26.0, step=0.01, output_interval=0.1, second_order=second_order)
    result = simulate(case, model=frame_model(scenario.crane.frame, DIVISION))
    return Comparison(
        here={"t_s": result.time} | dynamic_columns(result),
        there=time_series("swing" if stiffer == 1.0 else "swing_stiff"),
    )


def forces_at_rest(angle: float, tension: float, *, second_order: bool) -> dict[str, float]:
    """The frame's columns in statics, at a luffing angle [rad] and a tension of the rope [N]."""
    crane = Crane(frame=Frame(luffing_angle=angle))
    case = LoadCase(rope_tension=tension, second_order=second_order, rope_follows=second_order)
    result = static(crane, case, model=_model(crane.frame))
    moved = result.displacement["S"]
    found = moved[0], moved[2], result.servomotor_tension["R"], *result.reactions["A_R"]
    return dict(zip(FRAME_COLUMNS, map(float, found), strict=True))


@cache
def _model(frame: Frame) -> FrameModel:
    return frame_model(frame, DIVISION)


@cache
def with_second_order() -> Comparison:
    """The reference crane's swing every second, and on the frame what second order adds in statics."""
    run = swing_run()
    here, there = ({name: column[::10].copy() for name, column in each.items()} for each in (run.here, run.there))
    for index, (angle, tension) in enumerate(zip(here["luffing_rad"], here["T_rope_N"], strict=True)):
        linear, second = (forces_at_rest(float(angle), float(tension), second_order=flag) for flag in (False, True))
        for name in FRAME_COLUMNS:
            here[name][index] += second[name] - linear[name]
    return Comparison(here=here, there=there)


def swings() -> list[Check]:
    """Check the full model's swing, of a frame ten times as stiff and of the reference crane."""
    name = "−20° to 25° in 20 s, 100 t, surge and heave, 26 s, 20/16 rfes, step 10 ms"
    return [
        swing_run(10.0).check(
            f"luffing {name}, frame 10 × stiffer",
            EVERY_COLUMN,
            COLUMNS,
            note="The multibody program's beams are geometrically exact. Ten times stiffer, they show a tenth of what "
            "a linear frame leaves out.",
        ),
        swing_run().check(
            "the same of the reference crane: load, rope, servomotors, feet outboard and upwards",
            "≤ 1 % of peak-to-peak",
            COLUMNS,
            judged=LITTLE_SECOND_ORDER,
            note="Deflection and the thrust between the feet are off by what is of second order in the displacements: "
            "see the next two checks.",
        ),
        with_second_order().check(
            "the same every second, with what second order adds in statics at that angle and tension",
            EVERY_COLUMN,
            COLUMNS,
        ),
        swing_run(second_order=True).check(
            "the same swing, the frame with the geometric stiffness of its state at rest at each angle of its modes",
            EVERY_COLUMN,
            COLUMNS,
        ),
    ]


class RigidSwing:
    """The swing with the frame rigid, in its plane: kinematics from the triangle of foot, N and C, for SciPy."""

    def __init__(self) -> None:
        self.scenario = swing()
        self.frame = self.scenario.crane.frame
        self.lengths = self._length(INBOARD), self._length(OUTBOARD)

    def _length(self, angle: float) -> float:
        height, deck_x = self.frame.servomotor_height, self.frame.servomotor_deck_x
        return math.hypot(height * math.sin(angle) - deck_x, height * math.cos(angle))

    def angle(self, t: float) -> float:
        """Luffing angle, rad."""
        first, last = self.lengths
        wanted = first + (last - first) * _smooth((t - BEGIN) / DURATION)
        return float(brentq(lambda angle: self._length(angle) - wanted, -1.0, 1.0, xtol=1e-15))

    def places(self, t: float) -> Array:
        """Pulley and drum in the base frame, x and z each: (4,), m."""
        angle, grown = self.angle(t), _smooth(t / RAMP)
        deck = grown * math.sin(2.0 * math.pi * t / 6.0), grown * 2.0 * math.sin(2.0 * math.pi * t / 12.0)
        x, _, z = self.scenario.crane.drum_position
        pulley = self.frame.height * math.sin(angle), self.frame.height * math.cos(angle)
        return np.array([deck[0] + pulley[0], deck[1] + pulley[1], deck[0] + x, deck[1] + z])

    def rope(self, t: float, state: Array) -> tuple[float, float, float]:
        """Its tension, N, and its direction from the load, x and z."""
        h = 1e-3
        here = self.places(t)
        rates = (self.places(t + h) - self.places(t - h)) / (2.0 * h)
        line, over = here[:2] - state[:2], here[:2] - here[2:]
        hanging, behind = math.hypot(*line), math.hypot(*over)
        length = self.scenario.free_length
        stretch = hanging + behind - length
        rate = line @ (rates[:2] - state[2:]) / hanging + over @ (rates[:2] - rates[2:]) / behind
        stiffness = self.scenario.crane.rope.axial_stiffness / length
        tension = max(0.0, stiffness * stretch + self.scenario.rope_damping * float(rate))
        return tension, float(line[0]) / hanging, float(line[1]) / hanging

    def run(self, times: Array) -> Array:
        """Load's x and z, m, and the rope's tension, N, at ``times`` from 0 on: (3, k)."""

        def rates(t: float, state: Array) -> list[float]:
            tension, x, z = self.rope(t, state)
            pull = tension / self.scenario.load_mass
            return [state[2], state[3], pull * x, pull * z - self.scenario.gravity]

        start = [float(self.places(0.0)[0]), self.scenario.target_level, 0.0, 0.0]
        found = solve_ivp(rates, (0.0, float(times[-1])), start, "DOP853", times, rtol=1e-9, atol=1e-10, max_step=0.1)
        tensions = [self.rope(t, state)[0] for t, state in zip(times.tolist(), found.y.T, strict=True)]
        return np.vstack([found.y[:2], tensions])


def _smooth(x: float) -> float:
    x = min(max(x, 0.0), 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x**2)


def rigid_swing() -> Check:
    """Check the simplified model's swing against SciPy."""
    times = 0.1 * np.arange(261, dtype=np.float64)
    engine = Engine(1, 0.1)
    engine.reset_row(0, swing())
    slots, found = (at.LOAD_POSITION, at.LOAD_POSITION + 2, at.TENSION, at.LUFFING_ANGLE), []
    for _ in times:
        found.append([engine.read(slot)[0] for slot in slots])
        engine.step(np.zeros(1))
    here, peer = np.array(found).T, RigidSwing()
    there = np.vstack([peer.run(times), np.array([peer.angle(t) for t in times.tolist()])])
    gaps = np.abs(here - there).max(axis=1)
    load = float(gaps[:2].max())
    return Check(
        name="the same with the frame rigid, the environment at its default step against SciPy's DOP853",
        bar="load within 1 µm",
        measured=f"{1e6 * load:.2f} µm",
        passed=load <= 1e-6,
        rows=[
            Row.of_ranges(what, ours, theirs, f"{gap:.1e} {unit}")
            for what, ours, theirs, gap, unit in zip(
                ("xL1_m", "xL3_m", "T_rope_N", "luffing_rad"), here, there, gaps, ("m", "m", "N", "rad"), strict=True
            )
        ],
    )
