"""Ropes with mass and loads in water, against programs and closed forms that share no code with the package.

``tests/data/water``: a chain of 400 elements that agrees with MoorDyn (cases a, b) or with a chain of another kind
(e1, e2), and the closed forms of a bar with an end mass.
"""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
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
    SeaMotion,
    Water,
    Winch,
)
from aframe_env.dynamics import layout as at
from aframe_env.dynamics.step import step_kernels
from aframe_env.engine import Engine

FloatArray = npt.NDArray[np.float64]
DATA = Path(__file__).parents[1] / "data" / "water"
CASES = json.loads((DATA / "cases.json").read_text())["cases"]
MU, EA, G, RHO = 19.55, 2e8, 9.81, 1025.0
STILL = HarmonicMotion(harmonics=())
LONG_WINCH = Winch(max_rope_length=6000.0, max_rope_speed=10.0)


def read(name: str) -> list[dict[str, float]]:
    with (DATA / name).open() as file:
        return [{key: float(value) for key, value in line.items()} for line in csv.DictReader(file)]


def columns(name: str) -> dict[str, FloatArray]:
    lines = read(name)
    return {key: np.array([line[key] for line in lines]) for key in lines[0]}


def deep(below: float, mass: float, added: float = 0.0, rope: Rope | None = None, **changes: object) -> Scenario:
    """A steel load in still water, with ``below`` m of unstretched rope under the pulley."""
    rope = rope or Rope.six_strand()
    load = LoadShape(volume=mass / 7850.0, added_mass_vertical=added)
    weight = (mass - RHO * load.volume) * G
    w = rope.weight_per_length(G, RHO)
    hanging = below * (1.0 + weight / rope.axial_stiffness) + w * below**2 / (2.0 * rope.axial_stiffness)
    crane = Crane(rope=rope, winch=LONG_WINCH)
    arguments = dict(crane=crane, motion=STILL, load_mass=mass, water=Water(), load=load, initial="rest")
    arguments["target_level"] = crane.pulley_position[2] - hanging
    return Scenario(**(arguments | changes))


def case_scenario(name: str) -> Scenario:
    case = CASES[name]
    heave = tuple(
        Harmonic(coordinate="heave", amplitude=a, period=period, phase=phase + 0.5 * math.pi)
        for period, a, phase in case["heave"]["harmonics_T_a_phase"]
    )
    load = case["load"]
    return deep(
        case["L0_unstretched_below_S_m"],
        load["m_kg"],
        rope=Rope.six_strand(loss_time=case["beta_s"]),
        motion=HarmonicMotion(harmonics=heave),
        ramp=case["heave"]["t_r_s"],
        load=LoadShape(volume=load["V_m3"], added_mass_vertical=load["m_a_kg"], drag_area_vertical=load["CdA_m2"]),
        target_level=case["static"].get("z_load_m", columns(f"case_{name}.csv")["z_load_m"][0]),
    )


def paid_out(name: str, times: FloatArray) -> FloatArray:
    """The case's pay-out in excess of the start's, m."""
    case = CASES[name]
    if "pay_out" not in case:
        return np.zeros_like(times)
    law, heave = case["pay_out"], case["heave"]
    t = np.maximum(times - law["lag_s"], 0.0)
    s = np.minimum(t / heave["t_r_s"], 1.0)
    ramp = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    zeta = sum(a * np.cos(2.0 * np.pi * t / period + phase) for period, a, phase in heave["harmonics_T_a_phase"])
    u = (times - law["t0_s"]) / law["tv_s"]
    inside = np.clip(u, 0.0, 1.0)
    lowered = 2.5 * inside**4 - 3.0 * inside**5 + inside**6 + np.maximum(u - 1.0, 0.0)
    return np.asarray(law["gain"] * ramp * zeta + law["v_m_s"] * law["tv_s"] * lowered)


@pytest.mark.parametrize(("name", "bar"), [("a", 2e-5), ("b", 3e-4), ("e1", 5e-5), ("e2", 3e-4)])
def test_reference_cases(name: str, bar: float) -> None:
    scenario, reference = case_scenario(name), columns(f"case_{name}.csv")
    radius, period = scenario.crane.winch.drum_radius, 0.005
    every = round((reference["t_s"][1] - reference["t_s"][0]) / period)
    # A drum whose speed is linear between these times, as the prescribed one is but for O(period²).
    times = np.arange((len(reference["t_s"]) - 1) * every + 1) * period
    lengths = paid_out(name, times)
    speeds = np.gradient(lengths, period, edge_order=2) / radius
    engine = Engine(1, period)
    engine.reset_row(0, scenario)
    found = []
    for k in range(len(times)):
        if k % every == 0:
            rows = (at.LOAD_POSITION + 2, at.LOAD_VELOCITY + 2, at.TENSION, at.LOAD_TENSION)
            found.append([engine.read(slot)[0] for slot in rows])
        if k + 1 < len(times):
            engine.blocks[0, at.MAX_ACCELERATION] = max(abs(speeds[k + 1] - speeds[k]) / period, 1e-9)
            engine.step(np.array([speeds[k + 1]]))
    z, v, top, load = np.array(found).T
    assert scenario.free_length == pytest.approx(CASES[name]["l0_paid_out_m"], abs=2e-6)
    assert z == pytest.approx(reference["z_load_m"], abs=bar)
    assert v == pytest.approx(reference["v_load_m_s"], abs=2e-4)
    for tension, column in ((top, "T_top_N"), (load, "T_load_N")):
        assert np.abs(tension - reference[column]).max() < 0.01 * np.ptp(reference[column])


@pytest.mark.parametrize("line", read("static.csv"), ids=lambda line: f"{line['L_m']:g}-{line['m_kg']:g}")
def test_statics(line: dict[str, float]) -> None:
    scenario = deep(line["L_m"], line["m_kg"])
    engine = Engine(1, 0.1)
    engine.reset_row(0, scenario)
    assert scenario.lengths[0] == pytest.approx(line["L_m"], abs=1e-5)
    assert scenario.rope_length == pytest.approx(line["load_below_S_m"], rel=1e-7)
    stretch = line["stretch_by_load_m"] + line["stretch_by_rope_weight_m"]
    assert scenario.rope_length - scenario.lengths[0] == pytest.approx(stretch, rel=1e-5)
    assert engine.read(at.TENSION)[0] == pytest.approx(line["T_top_N"], rel=1e-5)
    assert engine.read(at.LOAD_TENSION)[0] == pytest.approx(line["T_load_N"], rel=2e-5)
    start = engine.read_many(at.LIFT, at.LIFT_SIZE)[0]
    for _ in range(100):
        engine.step(np.zeros(1))
    assert engine.read_many(at.LIFT, at.LIFT_SIZE)[0] == pytest.approx(start, abs=1e-7)


class Linear:
    """The engine's vertical equations about rest, x' = A x + B (z_S, z_S'), by differences of what it computes."""

    def __init__(self, scenario: Scenario, c_load: float = 0.0, c_rope: float = 0.0) -> None:
        self.lumps = n = scenario.springs - 1
        self.slots = [*range(1, n + 1), *range(at.SPRINGS_MOST + 1, at.SPRINGS_MOST + n + 1)]
        self.slots += [2 * at.SPRINGS_MOST + 2, 2 * at.SPRINGS_MOST + 5]
        engine = Engine(1, 0.1)
        self.kernels, self.records = step_kernels(1, heavy=True), engine.records
        rest = engine.row_vector(scenario)
        step, size = 1e-4, len(self.slots)
        self.a, self.b = np.zeros((size, size)), np.zeros((size, 2))
        self.tension = np.zeros(size)
        for k, slot in enumerate(self.slots):
            ends = []
            for sign in (1.0, -1.0):
                row = rest.copy()
                row[at.LIFT + slot] += sign * step
                ends.append(self.rates(row))
            self.a[:, k] = (ends[0] - ends[1]) / (2.0 * step)
        for k, phase in enumerate((0.5 * math.pi, 0.0)):
            ends = []
            for amplitude in (step, -step):
                heave = Harmonic(coordinate="heave", amplitude=abs(amplitude), period=2.0 * math.pi, phase=phase)
                if amplitude < 0.0:
                    heave = replace(heave, phase=phase + math.pi)
                row = engine.row_vector(replace(scenario, motion=HarmonicMotion(harmonics=(heave,))))
                row[at.LIFT : at.LIFT + at.LIFT_SIZE] = rest[at.LIFT : at.LIFT + at.LIFT_SIZE]
                ends.append(self.rates(row))
            self.b[:, k] = (ends[0] - ends[1]) / (2.0 * step)
        # Linear drags of the tables, on the masses that the engine has.
        element = MU * scenario.lengths[0] / max(n, 1)
        masses = np.full(n, element)
        if n:
            masses[0] *= 1.0 - 2.0 * n / (6.0 * (2 * n - 1))
        self.a[range(n, 2 * n), range(n, 2 * n)] -= c_rope * scenario.lengths[0] / max(n, 1) / masses
        self.a[-1, -1] -= c_load / (rest[at.LOAD_INERTIA + 1] + element / 6.0)

    def rates(self, row: FloatArray) -> FloatArray:
        """Rates of the state of a row, which its start kernel leaves behind."""
        row = row.copy()
        self.kernels.start(row[None], (len(row) - at.ROW_SLOTS) // at.COMPONENT_SLOTS, self.records)
        return row[[at.LIFT_SUM + slot for slot in self.slots]]

    def response(self, omega: float) -> complex:
        """H: motion of the load over that of the pulley."""
        right = self.b[:, 0] + 1j * omega * self.b[:, 1]
        return complex(np.linalg.solve(1j * omega * np.eye(len(self.a)) - self.a, right)[-2])

    def frequencies(self) -> FloatArray:
        found = np.linalg.eigvals(self.a)
        return np.sort(np.abs(found[found.imag > 0.0]))


@pytest.mark.parametrize("line", read("natural_frequencies.csv"), ids=lambda k: f"{k['L_m']:g}-{k['m_kg']:g}")
def test_natural_frequencies(line: dict[str, float]) -> None:
    rope = Rope.six_strand(loss_time=0.0)
    # A hair's breadth more, for the shortest of them to be a chain.
    scenario = deep(line["L_m"] * (1.0 + 1e-9), line["m_kg"], line["m_a_kg"], rope)
    assert scenario.springs > 1
    found = Linear(scenario).frequencies()
    assert found[0] == pytest.approx(line["omega1_rad_s"], rel=2e-3)
    assert found[1] == pytest.approx(line["omega2_rad_s"], rel=1e-2)


def test_transfer_function() -> None:
    lines = read("transfer.csv")
    systems: dict[tuple[float, ...], Linear] = {}
    worst, turned = 0.0, 0.0
    for line in lines:
        key = (line["L_m"], line["m_kg"], line["m_a_kg"], line["c_L_Ns_m"], line["b_Ns_m2"])
        if key not in systems:
            scenario = deep(line["L_m"] * (1.0 + 1e-9), line["m_kg"], line["m_a_kg"])
            systems[key] = Linear(scenario, line["c_L_Ns_m"], line["b_Ns_m2"])
        found, expected = systems[key].response(2.0 * math.pi / line["T_s"]), complex(line["H_re"], line["H_im"])
        worst = max(worst, abs(abs(found) - abs(expected)) / max(abs(expected), 0.1))
        turned = max(turned, abs(math.degrees(np.angle(found / expected))))
    assert len(lines) == 720
    assert worst < 0.005
    assert turned < 0.5


def test_rope_without_mass_is_the_simplified_model() -> None:
    motion = SeaMotion(sea=Sea(hs=4.0, tp=8.0, heading=2.0, seed=5))
    light = Scenario(motion=motion, load_mass=5e4, target_level=-280.0, rope_damping=2e4, ramp=5.0)
    heavy = replace(light, crane=replace(light.crane, rope=Rope(mass_per_length=1e-3)))
    commands = np.random.default_rng(0).uniform(-2.0, 2.0, 600)
    found = []
    for scenario in (light, heavy):
        engine = Engine(1, 0.1)
        engine.reset_row(0, scenario)
        track = []
        for command in commands:
            engine.step(np.array([command]))
            track.append(engine.read_many(at.LOAD_POSITION, 3)[0])
        found.append(np.array(track))
    assert heavy.springs == 1
    # A gram a metre: some 0.1 kg swing with 50 t.
    assert found[1] - found[1][0] == pytest.approx(found[0] - found[0][0], abs=2e-5)


def energy(row: FloatArray, scenario: Scenario) -> float:
    """Kinetic, potential and elastic energy of load and rope with the pulley at rest, by the definitions."""
    n = scenario.springs - 1
    place, speed = row[at.LIFT : at.LIFT + n + 1], row[at.LIFT + at.SPRINGS_MOST :][: n + 1]
    position, velocity = row[at.LOAD_POSITION : at.LOAD_POSITION + 3], row[at.LOAD_VELOCITY : at.LOAD_VELOCITY + 3]
    line = position - row[at.PULLEY : at.PULLEY + 3]
    distance = np.linalg.norm(line)
    axis = line / distance
    turn = (velocity - axis * (axis @ velocity)) / distance
    below, drum_part = scenario.lengths
    element = below / n
    masses = np.full(n, MU * element)
    masses[0] *= 1.0 - 2.0 * n / (6.0 * (2 * n - 1))
    lumps, load = place[1:], scenario.load_mass + MU * element / 6.0
    kinetic = 0.5 * load * velocity @ velocity
    kinetic += 0.5 * masses @ (speed[1:] ** 2 + (lumps * np.linalg.norm(turn)) ** 2)
    weight = scenario.rope_weight * element
    potential = scenario.weight * position[2] + weight * (lumps * axis[2]).sum()
    ends = np.concatenate([[distance], lumps, [-scenario.crane.drum_to_pulley]])
    rests = np.full(n + 1, element)
    rests[0], rests[-1] = 0.5 * element, 0.5 * element + drum_part
    stretch = np.maximum(ends[:-1] - ends[1:] - rests, 0.0)
    return float(kinetic + potential + 0.5 * (EA / rests) @ stretch**2)


def test_energy_of_a_swinging_bobbing_load() -> None:
    rope = Rope.six_strand(loss_time=0.0)
    scenario = Scenario(
        crane=Crane(rope=rope, winch=LONG_WINCH), motion=STILL, load_mass=3e4, target_level=-900.0, initial="rest"
    )
    engine = Engine(1, 0.005)
    row = engine.row_vector(scenario)
    # On an arc about the pulley, and all of the rope with it: the integrator damps the short waves of a jerk.
    row[at.LOAD_POSITION] += 60.0
    row[at.LOAD_POSITION + 2] += scenario.rope_length - math.sqrt(scenario.rope_length**2 - 60.0**2)
    row[at.LOAD_VELOCITY : at.LOAD_VELOCITY + 3] += [0.0, 3.0, -1.0]
    places = slice(at.LIFT + 1, at.LIFT + scenario.springs)
    speeds = slice(at.LIFT + at.SPRINGS_MOST + 1, at.LIFT + at.SPRINGS_MOST + scenario.springs)
    row[speeds] = row[places] / scenario.rope_length
    engine.write_row(0, row)
    found = []
    for _ in range(12000):
        found.append(energy(engine.copy_row(0), scenario))
        engine.step(np.zeros(1))
    swing = scenario.weight * 2.0
    assert np.ptp(found) < 1e-5 * swing
    assert engine.read(at.OMEGA2)[0] > 1.0


def test_pendulum() -> None:
    scenario = deep(1000.0, 5e4, crane=Crane(rope=Rope.six_strand(loss_time=0.1), winch=LONG_WINCH))
    added = 3e4
    scenario = replace(scenario, load=replace(scenario.load, added_mass_horizontal=added))
    engine = Engine(1, 0.1)
    row = engine.row_vector(scenario)
    row[at.LOAD_POSITION] += 5.0
    engine.write_row(0, row)
    track = []
    for _ in range(3000):
        engine.step(np.zeros(1))
        track.append(engine.read(at.LOAD_POSITION)[0] - scenario.crane.pulley_position[0])
    x = np.array(track)
    crossings = np.nonzero(x[:-1] * x[1:] < 0.0)[0]
    times = 0.1 * (crossings + x[crossings] / (x[crossings] - x[crossings + 1]))
    # A rod with an end mass, of the stretched length, about the pulley.
    length, w = scenario.rope_length, scenario.rope_weight
    inertia, lever = 5e4 + added + MU * 1000.0 / 3.0, scenario.weight + 0.5 * w * 1000.0
    assert 2.0 * np.diff(times).mean() == pytest.approx(2.0 * math.pi * math.sqrt(inertia * length / lever), rel=1e-3)


def test_fall_reaches_terminal_velocity() -> None:
    load = LoadShape(volume=2.0, added_mass_vertical=1e4, drag_area_vertical=12.0)
    scenario = deep(60.0, 2e4, load=load, rope=Rope())
    engine = Engine(1, 0.1)
    row = engine.row_vector(scenario)
    row[at.PARTED] = 1.0
    engine.write_row(0, row)
    for _ in range(600):
        engine.step(np.zeros(1))
    terminal = math.sqrt(scenario.weight / (0.5 * RHO * 12.0))
    assert engine.read(at.LOAD_VELOCITY + 2)[0] == pytest.approx(-terminal, rel=1e-3)


def mixed() -> list[Scenario]:
    motion = SeaMotion(sea=Sea(hs=5.0, tp=7.0, seed=2))
    shape = LoadShape(volume=1.0, added_mass_vertical=2e4, added_mass_horizontal=5e3, drag_area_vertical=20.0)
    shape = replace(shape, drag_area_horizontal=9.0)
    found = []
    for length, mass in ((60.0, 5e3), (120.0, 2e3), (300.0, 1e5), (700.0, 3e3), (2900.0, 1.5e3), (2900.0, 3e5)):
        for water, load in ((None, LoadShape()), (Water(), shape)):
            crane = Crane(rope=Rope.six_strand(breaking_load=6e6), winch=LONG_WINCH)
            found.append(
                Scenario(
                    crane=crane, motion=motion, load_mass=mass, target_level=-length, water=water, load=load, ramp=2.0
                )
            )
    return [*found, replace(Scenario.paper(), motion=motion), Scenario.paper()]


@pytest.mark.parametrize("kinds", ["mixed", "all with mass"])
def test_rows_side_by_side_are_rows_alone(kinds: str) -> None:
    scenarios = mixed() if kinds == "mixed" else mixed()[:-2]
    commands = np.random.default_rng(1).uniform(-3.0, 3.0, (60, len(scenarios)))
    many = Engine(len(scenarios), 0.1)
    alone = [Engine(1, 0.1) for _ in scenarios]
    for i, scenario in enumerate(scenarios):
        many.reset_row(i, scenario)
        alone[i].reset_row(0, scenario)
    slots = (at.LIFT, at.LIFT_SIZE), (at.OMEGA1, 4), (at.PEAK_TENSION, 1), (at.LOAD_TENSION, 1), (at.SLACK, 3)
    for command in commands:
        many.step(command)
        for i, engine in enumerate(alone):
            engine.step(command[i : i + 1])
        for slot, size in slots:
            side_by_side = many.read_many(slot, size)
            assert np.isfinite(side_by_side).all()
            for i, engine in enumerate(alone):
                assert side_by_side[i].tobytes() == engine.read_many(slot, size)[0].tobytes(), (i, slot)


def test_light_load_goes_slack_and_snaps() -> None:
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=4.0, period=6.0),))
    load = LoadShape(volume=0.1, added_mass_vertical=2e4, drag_area_vertical=40.0)
    scenario = deep(200.0, 2e3, motion=motion, load=load, ramp=6.0)
    engine = Engine(1, 0.1)
    engine.reset_row(0, scenario)
    slack, tensions = [], []
    for _ in range(300):
        engine.step(np.zeros(1))
        slack.append(engine.read(at.SLACK)[0])
        tensions.append(engine.read(at.PEAK_TENSION)[0])
    assert 0.1 < np.mean(slack) < 0.9
    assert max(tensions) > 4.0 * scenario.hanging_weight
    assert min(tensions) >= 0.0


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: Water(density=100.0), r"density = 100.0 kg/m³: must be in \[900, 1300\] kg/m³"),
        (lambda: LoadShape(volume=-1.0), r"volume = -1.0 m³: must be in \[0, 10000\] m³"),
        (lambda: Rope(mass_per_length=2e3), r"mass_per_length = 2000.0 kg/m: must be 0, or in \[0.001, 1000\] kg/m"),
        (lambda: deep(300.0, 1e4, load=LoadShape(volume=20.0)), r"volume = 20.0 m³: a load of 10000 kg floats"),
        (lambda: deep(300.0, 1e4, water=None), "goes with water"),
        (
            lambda: deep(300.0, 1e4, rope=Rope(mass_per_length=1.0, solid_diameter=0.056)),
            r"solid_diameter = 0.056 m: the rope floats.*must be at most 0.035",
        ),
        (
            lambda: deep(3000.0, 1e5, rope=Rope.six_strand(breaking_load=1e6)),
            r"target_level.*a rope that weighs 167.\d+ N/m would bear 1.35\d+e\+06 N .*must be below 1e\+06 N",
        ),
        (
            lambda: deep(300.0, 1e4, rope=Rope(mass_per_length=0.06, axial_stiffness=1e12)),
            "mass_per_length = 0.06 kg/m: the waves in the rope",
        ),
    ],
)
def test_bad_input_is_named(build, words) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InvalidValue, match=words):
        build()
