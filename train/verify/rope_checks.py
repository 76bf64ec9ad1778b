"""Checks of heavy ropes and loads in water against other programs and closed forms.

The references: a chain of 400 elements that agrees with MoorDyn (cases a, b) or with a chain of another kind (e1, e2),
and the closed forms of a bar with an end mass, in ``aframe_env/data/reference/water``.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
import numpy.typing as npt

from aframe_env.dynamics import layout as at
from aframe_env.dynamics.step import step_kernels
from aframe_env.engine import Engine
from aframe_env.scenario import Crane, Harmonic, HarmonicMotion, LoadShape, Rope, Scenario, Sea, SeaMotion, Water, Winch
from train.verify.report import Check, Row
from train.verify.rope_cases import COLUMNS, rope_case

FloatArray = npt.NDArray[np.float64]

_DATA = files("aframe_env") / "data" / "reference" / "water"
STEEL = 7850.0
"""Density of the references' loads, kg/m³."""
BARS = {"a": 0.2e-3, "b": 5e-3, "e1": 0.3e-3, "e2": 1e-3}
"""Most that the load may be elsewhere in each case, m."""
TITLES = {
    "a": "1,000 m, 50 t, heave 1.5 m at 8 s",
    "b": "3,000 m, 100 t and 80 t of water, 12 harmonics",
    "e1": "a with the heave paid out exactly",
    "e2": "a with 0.9 of it 0.25 s late, lowering 42 m",
}


def table(name: str) -> list[dict[str, float]]:
    """Lines of a reference table."""
    lines = csv.DictReader((_DATA / f"{name}.csv").read_text(encoding="utf-8").splitlines())
    return [{key: float(value) for key, value in line.items()} for line in lines]


@cache
def reference_cases() -> dict[str, Any]:
    """Parameters and figures of the reference cases, by their names."""
    cases: dict[str, Any] = json.loads((_DATA / "cases.json").read_text(encoding="utf-8"))["cases"]
    return cases


def reference_columns(name: str) -> dict[str, FloatArray]:
    """Columns of a reference case, every half second."""
    lines = table(f"case_{name}")
    return {column: np.array([line[column] for line in lines]) for column in COLUMNS}


@cache
def histories(name: str) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """A case's columns here and in the reference, at the reference's times."""
    reference = reference_columns(name)
    columns = rope_case(reference_cases()[name], f"case {name}").run()
    every = round(reference["t_s"][1] / columns["t_s"][1])
    return {column: values[::every] for column, values in columns.items()}, reference


def steel_load(below: float, mass: float, added: float = 0.0, rope: Rope | None = None, **changes: Any) -> Scenario:
    """Return a load of steel at rest in still water, with ``below`` m of unstretched rope under the pulley."""
    rope, water = rope or Rope.six_strand(), Water()
    load = LoadShape(volume=mass / STEEL, added_mass_vertical=added)
    crane = Crane(rope=rope, winch=Winch(max_rope_length=6000.0, max_rope_speed=10.0))
    fields: dict[str, Any] = {"load_mass": mass, "water": water, "load": load, "initial": "rest", "crane": crane}
    fields |= {"motion": HarmonicMotion(harmonics=())} | changes
    probe = Scenario(**{"target_level": -0.5 * below, **fields})
    hanging = below * (1.0 + probe.weight / rope.axial_stiffness)
    hanging += 0.5 * probe.rope_weight * below**2 / rope.axial_stiffness
    return replace(probe, target_level=crane.pulley_position[2] - hanging)


def chain_masses(scenario: Scenario) -> tuple[float, FloatArray]:
    """Rope's mass that the load carries, kg, and those of the lumps, from below, (n,) kg."""
    lumps = scenario.springs - 1
    element = scenario.crane.rope.mass_per_length * scenario.lengths[0] / lumps
    masses = np.full(lumps, element)
    masses[0] *= 1.0 - lumps / (3.0 * (2 * lumps - 1))
    return element / 6.0, masses


class Linear:
    """The engine's vertical equations about rest, x' = A x + B (z_S, z_S'), by differences of what it computes.

    The drags of a table, ``load_drag`` [N s/m] and ``rope_drag`` [N s/m²], are linear ones of their own.
    """

    STEP = 1e-4
    """Of the differences, m and m/s: no spring goes slack."""

    def __init__(self, scenario: Scenario, load_drag: float = 0.0, rope_drag: float = 0.0) -> None:
        self._engine, lumps = Engine(1, 0.1), scenario.springs - 1
        chain = np.arange(1, lumps + 1)
        self._slots = np.concatenate(
            [chain, at.SPRINGS_MOST + chain, at.LOAD_POSITION - at.LIFT + 2 + np.array([0, 3])]
        )
        rest = self._engine.row_vector(scenario)
        self.a = np.stack([self._slope(partial_row(rest, at.LIFT + slot)) for slot in self._slots], axis=1)
        self.b = np.stack([self._slope(self._heaved(scenario, rest, turn)) for turn in (0.5 * math.pi, 0.0)], axis=1)
        carried, masses = chain_masses(scenario)
        speeds = range(lumps, 2 * lumps)
        self.a[speeds, speeds] -= rope_drag * scenario.lengths[0] / lumps / masses
        self.a[-1, -1] -= load_drag / (rest[at.LOAD_INERTIA + 1] + carried)

    def _heaved(self, scenario: Scenario, rest: FloatArray, phase: float) -> Callable[[float], FloatArray]:
        """Rows at rest but for the pulley's place (phase π/2) or velocity (phase 0)."""

        def row(size: float) -> FloatArray:
            turned = phase if size > 0.0 else phase + math.pi
            heave = Harmonic(coordinate="heave", amplitude=abs(size), period=2.0 * math.pi, phase=turned)
            moved = self._engine.row_vector(replace(scenario, motion=HarmonicMotion(harmonics=(heave,))))
            moved[at.LIFT : at.LIFT + at.LIFT_SIZE] = rest[at.LIFT : at.LIFT + at.LIFT_SIZE]
            return moved

        return row

    def _slope(self, row: Callable[[float], FloatArray]) -> FloatArray:
        return (self._rates(row(self.STEP)) - self._rates(row(-self.STEP))) / (2.0 * self.STEP)

    def _rates(self, row: FloatArray) -> FloatArray:
        """Rates of the state of a row, which the start kernel leaves behind."""
        components = (len(row) - at.ROW_SLOTS) // at.COMPONENT_SLOTS
        step_kernels(1, heavy=True).start(row[None], components, self._engine.records)
        return np.asarray(row[at.LIFT_SUM + self._slots])

    def response(self, omega: float) -> complex:
        """H: motion of the load over that of the pulley at ``omega`` rad/s."""
        right = self.b[:, 0] + 1j * omega * self.b[:, 1]
        return complex(np.linalg.solve(1j * omega * np.eye(len(self.a)) - self.a, right)[-2])

    def frequencies(self) -> FloatArray:
        """Natural frequencies, rad/s, ascending."""
        found = np.linalg.eigvals(self.a)
        return np.sort(np.abs(found[found.imag > 0.0]))


def partial_row(rest: FloatArray, slot: int) -> Callable[[float], FloatArray]:
    """Rows that differ from ``rest`` in one slot."""

    def row(size: float) -> FloatArray:
        moved = rest.copy()
        moved[slot] += size
        return moved

    return row


def cases() -> list[Check]:
    """Check the reference cases: where the load is, and the tensions at its end and at S."""
    checks = []
    for name, bar in BARS.items():
        here, there = histories(name)
        gap = float(np.abs(here["z_load_m"] - there["z_load_m"]).max())
        shares = [float(np.abs(here[c] - there[c]).max() / np.ptp(there[c])) for c in ("T_top_N", "T_load_N")]
        checks.append(
            Check(
                name=f"case {name}: {TITLES[name]}",
                bar=f"load within {1e3 * bar:g} mm; tensions at S and at the load within 1 % of their range",
                measured=f"{1e3 * gap:.3f} mm; {shares[0]:.3%}, {shares[1]:.3%}",
                passed=gap <= bar and max(shares) <= 0.01,
            )
        )
    return checks


def statics() -> Check:
    """Check the stretch at rest and both tensions."""
    worst, rows = 0.0, []
    for line in table("static"):
        scenario = steel_load(line["L_m"], line["m_kg"])
        engine = Engine(1, 0.1)
        engine.reset_row(0, scenario)
        stretch = scenario.rope_length - scenario.lengths[0]
        expected = line["stretch_by_load_m"] + line["stretch_by_rope_weight_m"]
        tension = engine.read(at.TENSION)[0]
        worst = max(worst, abs(stretch / expected - 1.0), abs(tension / line["T_top_N"] - 1.0))
        rows.append(
            Row(
                quantity=f"{line['L_m']:g} m, {line['m_kg'] / 1e3:g} t: stretch, m",
                measured=f"{stretch:.6f}",
                reference=f"{expected:.6f}",
                error=f"{stretch / expected - 1.0:.1e}",
            )
        )
    return Check(
        name="at rest: stretch and tension at S",
        bar="1e-5 relative",
        measured=f"{worst:.1e} at worst",
        passed=worst <= 1e-5,
        rows=rows,
    )


def frequencies() -> Check:
    """Check the first two natural frequencies, with and without added mass."""
    worst, rows = np.zeros(2), []
    for line in table("natural_frequencies"):
        # A hair's breadth more, for the shortest of them to be a chain.
        rope = Rope.six_strand(loss_time=0.0)
        found = Linear(steel_load(line["L_m"] * (1.0 + 1e-9), line["m_kg"], line["m_a_kg"], rope)).frequencies()[:2]
        expected = np.array([line["omega1_rad_s"], line["omega2_rad_s"]])
        errors = found / expected - 1.0
        worst = np.maximum(worst, np.abs(errors))
        rows.append(
            Row(
                quantity=f"{line['L_m']:g} m, {line['m_kg'] / 1e3:g} t and {line['m_a_kg'] / 1e3:g} t, rad/s",
                measured=f"{found[0]:.5g}, {found[1]:.5g}",
                reference=f"{expected[0]:.5g}, {expected[1]:.5g}",
                error=f"{errors[0]:.3%}, {errors[1]:.3%}",
            )
        )
    return Check(
        name="first two natural frequencies, 100 to 3,000 m",
        bar="1 %",
        measured=f"{worst[0]:.3%}, {worst[1]:.3%} at worst",
        passed=bool(worst.max() <= 0.01),
        rows=rows,
    )


@cache
def responses() -> tuple[FloatArray, FloatArray]:
    """Motion of the load over that of S here and in closed form, complex, for every line of ``transfer``."""
    systems: dict[tuple[float, ...], Linear] = {}
    found, expected = [], []
    for line in table("transfer"):
        key = (line["L_m"], line["m_kg"], line["m_a_kg"], line["c_L_Ns_m"], line["b_Ns_m2"])
        if key not in systems:
            systems[key] = Linear(steel_load(line["L_m"] * (1.0 + 1e-9), *key[1:3]), *key[3:])
        found.append(systems[key].response(2.0 * math.pi / line["T_s"]))
        expected.append(complex(line["H_re"], line["H_im"]))
    return np.array(found), np.array(expected)


def transfer() -> Check:
    """Check the motion of the load over that of S, resonances included."""
    found, expected = responses()
    gaps = np.abs(np.abs(found) - np.abs(expected))
    turned = np.abs(np.angle(found / expected, deg=True))
    share = gaps / np.abs(expected)
    within = (gaps <= np.maximum(0.01 * np.abs(expected), 1e-3)) & (turned <= 1.0)
    return Check(
        name="motion of the load over that of S, periods of 4 to 20 s",
        bar="magnitude within 1 % or 1e-3, phase within 1°, all 720",
        measured=f"{within.sum()} of {len(within)}; {share.max():.2%}, {turned.max():.2f}° at worst",
        passed=bool(within.all()) and len(within) == 720,
    )


def massless_limit() -> Check:
    """Check a rope of a gram a metre against the paper's, in a rough sea with the drum still."""
    motion = SeaMotion(sea=Sea(hs=4.0, tp=8.0, heading=2.0, seed=5))
    light = Scenario(motion=motion, load_mass=5e4, target_level=-280.0, rope_damping=2e4, ramp=5.0)
    tracks = []
    for rope in (Rope(), Rope(mass_per_length=1e-3), Rope(mass_per_length=2e-3)):
        engine = Engine(1, 0.1)
        engine.reset_row(0, replace(light, crane=replace(light.crane, rope=rope)))
        track = []
        for _ in range(600):
            engine.step(np.zeros(1))
            track.append(engine.read_many(at.LOAD_POSITION, 3)[0])
        tracks.append(np.array(track))
    # What the last gram does is as much as what the one before does: nothing is left at none.
    limit = float(np.abs(2.0 * tracks[1] - tracks[2] - tracks[0]).max())
    return Check(
        name="mass of the rope to nought, sea of 4 m, 60 s",
        bar="the paper's rope within 1e-6 m",
        measured=f"{limit:.1e} m (a gram a metre: {np.abs(tracks[1] - tracks[0]).max():.1e} m)",
        passed=limit <= 1e-6,
    )


def _energy(row: FloatArray, scenario: Scenario) -> float:
    """Kinetic, potential and elastic energy of load and rope under a pulley at rest, J, by their definitions."""
    lumps = scenario.springs - 1
    place, speed = row[at.LIFT :][: lumps + 1], row[at.LIFT + at.SPRINGS_MOST :][: lumps + 1]
    position, velocity = row[at.LOAD_POSITION :][:3], row[at.LOAD_VELOCITY :][:3]
    line = position - row[at.PULLEY : at.PULLEY + 3]
    distance = np.linalg.norm(line)
    axis = line / distance
    turn = (velocity - axis * (axis @ velocity)) / distance
    below, drum_part = scenario.lengths
    element = below / lumps
    carried, masses = chain_masses(scenario)
    kinetic = 0.5 * (scenario.load_mass + carried) * velocity @ velocity
    kinetic += 0.5 * masses @ (speed[1:] ** 2 + (place[1:] * np.linalg.norm(turn)) ** 2)
    potential = scenario.weight * position[2] + scenario.rope_weight * element * (place[1:] * axis[2]).sum()
    ends = np.concatenate([[distance], place[1:], [-scenario.crane.drum_to_pulley]])
    rests = np.full(lumps + 1, element)
    rests[0], rests[-1] = 0.5 * element, 0.5 * element + drum_part
    stretch = np.maximum(ends[:-1] - ends[1:] - rests, 0.0)
    return float(kinetic + potential + 0.5 * (scenario.crane.rope.axial_stiffness / rests) @ stretch**2)


def energy() -> Check:
    """Check the energy of a load that swings and bobs in air on a rope without damping."""
    offset, rope = 60.0, Rope.six_strand(loss_time=0.0)
    scenario = steel_load(900.0, 3e4, rope=rope, water=None, load=LoadShape())
    engine = Engine(1, 0.005)
    row = engine.row_vector(scenario)
    # On an arc about the pulley, and all of the rope with it: the integrator damps the short waves of a jerk.
    row[at.LOAD_POSITION] += offset
    row[at.LOAD_POSITION + 2] += scenario.rope_length - math.sqrt(scenario.rope_length**2 - offset**2)
    row[at.LOAD_VELOCITY : at.LOAD_VELOCITY + 3] += [0.0, 3.0, -1.0]
    chain = np.arange(1, scenario.springs)
    row[at.LIFT + at.SPRINGS_MOST + chain] = row[at.LIFT + chain] / scenario.rope_length
    engine.write_row(0, row)
    found = []
    for _ in range(12000):
        found.append(_energy(engine.copy_row(0), scenario))
        engine.step(np.zeros(1))
    exchanged = scenario.weight * (scenario.rope_length - math.sqrt(scenario.rope_length**2 - offset**2))
    share = float(np.ptp(found)) / exchanged
    return Check(
        name="energy, swinging and bobbing on 900 m, 60 s at 5 ms",
        bar="1e-5 of what is exchanged",
        measured=f"{share:.1e}",
        passed=share <= 1e-5,
    )
