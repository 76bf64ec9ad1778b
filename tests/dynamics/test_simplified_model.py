"""The simplified engine against SciPy's DOP853 on the same equations, conservation of energy, and closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.resources import files

import numpy as np
import oracle
import pytest

from aframe_env import Crane, HarmonicMotion, Rope, Scenario, ScenarioDistribution, Sea, SeaMotion, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine, timing

PERIOD = 0.1
STILL = np.zeros(600)
WAVING = 2.0 * np.sin(0.7 * np.arange(600) * PERIOD) + np.random.default_rng(3).normal(0, 0.7, 600)


def run(
    scenario: Scenario, commands: oracle.FloatArray, period: float = PERIOD, max_inner_step: float | None = None
) -> oracle.FloatArray:
    """Load position, velocity, Ω1, tension and slack flag (T + 1, 9) of one row."""
    engine = Engine(1, period, max_inner_step=max_inner_step)
    engine.reset_row(0, scenario)

    def now() -> oracle.FloatArray:
        rest = [engine.read(slot) for slot in (at.OMEGA1, at.TENSION, at.SLACK)]
        return np.concatenate([engine.read_many(at.LOAD_POSITION, 6)[0], *rest])

    out = [now()]
    for command in commands:
        engine.step(np.array([command]))
        out.append(now())
    return np.array(out)


def expected(
    scenario: Scenario, commands: oracle.FloatArray, period: float = PERIOD, max_step: float = 0.1
) -> oracle.FloatArray:
    """Load position, velocity, Ω1, tension (T + 1, 8) by the independent integrator."""
    winch = scenario.crane.winch
    radius = winch.drum_diameter / 2
    drum, kinks = oracle.winch(
        commands, period, winch.max_rope_speed / radius, winch.max_rope_acceleration / radius, winch.lag
    )
    tip = oracle.pulley(
        oracle.of_components(scenario.motion.components()), scenario.crane.pulley_position, scenario.ramp
    )
    times = np.arange(len(commands) + 1) * period
    states = oracle.solve(scenario, times, tip, drum, breaks=kinks if np.any(commands) else (), max_step=max_step)
    tensions = [oracle.forces(t, y, scenario, tip, drum)[0] for t, y in zip(times, states, strict=True)]
    return np.column_stack([states, tensions])


def sea(seed: int) -> SeaMotion:
    return SeaMotion(sea=Sea(hs=2.5, tp=9.0, heading=2.5, seed=seed))


@pytest.mark.parametrize(
    ("scenario", "commands"),
    [
        (Scenario.paper(), STILL),
        (Scenario.paper(initial="rest"), STILL),
        (Scenario.paper(initial="rest", rope_damping=2e4), STILL),
        (Scenario.paper(), WAVING),
        (Scenario.paper(initial="rest", rope_damping=5e3), WAVING),
        (Scenario(motion=oracle.SixDofMotion(1), ramp=10.0, rope_damping=3e4), WAVING),
        (Scenario(motion=sea(4)), WAVING),
        (Scenario(motion=sea(5), ramp=10.0, rope_damping=2e4), STILL),
        (Scenario(motion=sea(6), rope_damping=2.5e4, initial="rest"), WAVING),
        (ScenarioDistribution().draw(np.random.default_rng(7)), WAVING),
        (
            Scenario(motion=oracle.SixDofMotion(4), crane=Crane(winch=Winch(lag=0.3)), load_mass=7e4, rope_damping=2e4),
            WAVING,
        ),
    ],
    ids=[
        "paper",
        "paper-rest",
        "paper-rest-damped",
        "paper-drum",
        "paper-drum-rest-damped",
        "six-dof-ramp-drum",
        "sea-drum",
        "sea-ramp",
        "sea-rest-damped-drum",
        "drawn-drum",
        "lag-drum",
    ],
)
def test_load_follows_an_independent_integrator(scenario: Scenario, commands: oracle.FloatArray) -> None:
    got, want = run(scenario, commands), expected(scenario, commands)
    assert not got[:, 8].any()  # taut throughout
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-5
    assert np.abs(got[:, 6] - want[:, 6]).max() < 1e-6 * max(1.0, want[-1, 6])
    np.testing.assert_allclose(got[:, 7], want[:, 7], rtol=1e-4)


SNATCH = np.concatenate([np.zeros(10), np.full(8, 4.0), np.full(8, -2.0), np.zeros(74)])
"""Rope paid out at 14 m/s², faster than the load falls, goes slack, and snatches when the drum brakes."""
FAST = Crane(winch=Winch(max_rope_acceleration=14.0))


@pytest.mark.parametrize(
    ("mass", "target", "ratio", "steps", "events"),
    [
        (2e4, -150.0, 0.0, 32, 1),
        (2e4, -150.0, 0.01, 28, 1),
        (2e4, -150.0, 0.05, 100, 4),
        (1e5, -300.0, 0.02, 100, 3),
    ],
)
def test_load_through_slack_and_taut_again(mass: float, target: float, ratio: float, steps: int, events: int) -> None:
    scenario = Scenario(motion=HarmonicMotion(), load_mass=mass, target_level=target, crane=FAST)
    scenario = replace(scenario, rope_damping=2 * ratio * mass * scenario.rope_frequency)
    got, want = run(scenario, SNATCH[:steps]), expected(scenario, SNATCH[:steps], max_step=5e-3)
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-3
    slack = want[:, 7] == 0.0
    assert np.count_nonzero(np.diff(slack.astype(int)) == -1) >= events
    # Where both ends of a step are well taut or slack, the flag and the tension say which.
    weight = mass * scenario.gravity
    np.testing.assert_allclose(got[:, 7], want[:, 7], atol=0.02 * weight)
    both = slack[1:] & slack[:-1]
    assert both.any()
    assert (got[1:][both, 7] == 0.0).all()
    assert (got[1:][both, 8] == 1.0).all()
    assert (got[:10, 8] == 0.0).all()


def test_sea_slackens_the_rope_of_an_undamped_start() -> None:
    scenario = Scenario(motion=SeaMotion(sea=Sea(hs=3.0, tp=8.0, heading=2.0, seed=3)), initial="rest")
    got, want = run(scenario, WAVING), expected(scenario, WAVING, max_step=0.01)
    assert got[:, 8].any()
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-3


def test_integrator_is_of_fourth_order() -> None:
    scenario = Scenario(motion=oracle.SixDofMotion(6), initial="rest", rope_damping=1e4)
    want = expected(scenario, STILL[:200])[:, :3]
    errors = np.array(
        [np.abs(run(scenario, STILL[:200], max_inner_step=h)[:, :3] - want).max() for h in (0.1, 0.05, 0.025, 0.0125)]
    )
    ratios = errors[:-1] / errors[1:]
    assert np.all((ratios > 14.0) & (ratios < 20.0)), (errors, ratios)


CALM = Scenario(motion=HarmonicMotion())
REST = np.array([*CALM.crane.pulley_position[:2], CALM.target_level, 0.0, 0.0, 0.0])


def energy(scenario: Scenario, states: oracle.FloatArray) -> oracle.FloatArray:
    """Kinetic, potential and elastic energy (T,), J, the ship and the drum at rest."""
    length = oracle.free_length(scenario)
    reach = np.linalg.norm(states[:, :3] - scenario.crane.pulley_position, axis=1) + oracle.behind_pulley(scenario)
    stretch = np.maximum(reach - length, 0.0)
    kinetic = 0.5 * scenario.load_mass * (states[:, 3:6] ** 2).sum(axis=1)
    potential = scenario.load_mass * scenario.gravity * (states[:, 2] - scenario.target_level)
    return kinetic + potential + 0.5 * scenario.crane.rope.axial_stiffness / length * stretch**2


def swing(
    scenario: Scenario, start: oracle.FloatArray, steps: int, max_inner_step: float | None = None
) -> oracle.FloatArray:
    """Load position and velocity (T, 6) from ``start``, ship and drum still."""
    engine = Engine(1, PERIOD, max_inner_step=max_inner_step)
    row = engine.row_vector(scenario)
    row[at.LOAD_POSITION : at.LOAD_POSITION + 3] = start[:3]
    row[at.LOAD_VELOCITY : at.LOAD_VELOCITY + 3] = start[3:]
    engine.write_row(0, row)
    out = []
    for _ in range(steps):
        out.append(engine.read_many(at.LOAD_POSITION, 6)[0])
        engine.step(np.zeros(1))
    return np.array(out)


def test_energy_is_kept_bobbing_and_swinging() -> None:
    start = REST + np.array([10.0, -5.0, 0.3, 0.2, 0.5, 1.0])
    states = swing(CALM, start, 600)
    total = energy(CALM, states)
    kinetic = 0.5 * CALM.load_mass * (states[:, 3:6] ** 2).sum(axis=1)
    assert np.ptp(total) < 1e-6 * total[0]
    assert np.ptp(kinetic) > 1e-2 * total[0]


def test_energy_is_kept_through_bounces() -> None:
    """Thrown up, the load falls back into its rope, again and again."""
    scenario = replace(CALM, load_mass=2e4, target_level=-150.0)
    start = np.array([*REST[:2], -150.0, 0.0, 0.0, 5.0])
    states = swing(scenario, start, 600)
    total = energy(scenario, states)
    reach = np.linalg.norm(states[:, :3] - scenario.crane.pulley_position, axis=1) + oracle.behind_pulley(scenario)
    taut = reach > oracle.free_length(scenario)
    assert np.count_nonzero(np.diff(taut)) > 20
    # The corner in the rope's law costs RK4 its order: a few 1e-5 a bounce at the default step.
    assert np.ptp(total) < 3e-3 * total[0]
    finer = energy(scenario, swing(scenario, start, 600, max_inner_step=0.001))
    assert np.ptp(finer) < 1e-4 * finer[0]


def test_damping_takes_energy_away() -> None:
    scenario = replace(CALM, rope_damping=5e3)
    total = energy(scenario, swing(scenario, REST + np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0]), 300))
    assert (np.diff(total) < 1e-9 * total[0]).all()
    assert total[-1] < total[0] - 1e4


def crossings(values: oracle.FloatArray) -> oracle.FloatArray:
    """Times (in control steps) of upward zero crossings, interpolated by a cubic through four samples."""
    found = []
    for i in np.flatnonzero((values[1:-2] < 0) & (values[2:-1] >= 0)) + 1:
        roots = np.roots(np.polyfit(np.arange(-1, 3), values[i - 1 : i + 3], 3))
        real = roots[np.abs(roots.imag) < 1e-9].real
        found.append(i + real[(real >= 0) & (real <= 1)][0])
    return np.array(found)


def frequency(values: oracle.FloatArray) -> float:
    """Angular frequency, rad/s, of an oscillation about zero."""
    times = crossings(values)
    return float(2 * math.pi * (len(times) - 1) / ((times[-1] - times[0]) * PERIOD))


def test_static_stretch() -> None:
    assert np.abs(swing(CALM, REST, 50)[:, :3] - REST[:3]).max() < 1e-9
    engine = Engine(1, PERIOD)
    engine.reset_row(0, CALM)
    weight, length = 1e5 * 9.81, engine.read(at.FREE_LENGTH)[0]
    reach = oracle.behind_pulley(CALM) + CALM.crane.pulley_position[2] + 300.0
    assert engine.read(at.TENSION)[0] == pytest.approx(weight, rel=1e-12)
    assert reach - length == pytest.approx(weight * length / 2e8, rel=1e-12)


@pytest.mark.parametrize(("mass", "target"), [(1e5, -300.0), (2e4, -40.0), (1e5, -1489.0)])
def test_small_vertical_oscillation(mass: float, target: float) -> None:
    """√(c/m), the rope's free length being that between drum and load, over the pulley."""
    scenario = replace(CALM, load_mass=mass, target_level=target)
    height = swing(scenario, np.array([*REST[:2], target, 0.0, 0.0, 0.01]), 600)[:, 2] - target
    stiffness = 2e8 / oracle.free_length(scenario)
    assert frequency(height) == pytest.approx(math.sqrt(stiffness / mass), rel=2e-5)


def test_small_pendulum() -> None:
    """√(g/|LS|) with the stretched length, on the elastic rope as on a stiff one."""
    for stiffness in (2e8, 2e10):
        scenario = replace(CALM, crane=Crane(rope=Rope(axial_stiffness=stiffness)), target_level=-50.0)
        start = np.array([*REST[:2], -50.0, 0.01, 0.0, 0.0])
        aside = swing(scenario, start, 2000)[:, 0] - REST[0]
        length = scenario.crane.pulley_position[2] + 50.0
        assert frequency(aside) == pytest.approx(math.sqrt(9.81 / length), rel=1e-6)


@pytest.mark.parametrize(("length", "mass"), [(50.0, 20e3), (25.0, 5e3), (9.0, 100.0), (9.0, 1.0)])
def test_step_follows_the_ropes_frequency(length: float, mass: float) -> None:
    """The default distribution's stiffest corner, and shorter and lighter: down to 1 kg on the shortest rope."""
    scenario = Scenario(
        motion=oracle.SixDofMotion(8, scale=0.25),
        load_mass=mass,
        target_level=Crane().pulley_position[2] - length,
        initial="rest",
    )
    scenario = replace(scenario, rope_damping=0.01 * 2 * mass * scenario.rope_frequency)
    steps = 300 if mass > 1e3 else 10
    got, want = run(scenario, STILL[:steps]), expected(scenario, STILL[:steps], max_step=0.02)
    slack = got[:, 8].any()
    assert slack == (mass < 20e3)
    assert np.abs(got[:, :3] - want[:, :3]).max() < (1e-3 if slack else 1e-5)


def test_control_period_does_not_change_the_physics() -> None:
    scenario = Scenario(motion=oracle.SixDofMotion(9))
    for period, segments in ((0.02, 1), (0.2, 1), (0.5, 3), (2.0, 10)):
        assert timing(scenario, period).segments == segments
        commands = np.resize([1.0, -1.5, 0.5], round(30 / period))
        got, want = run(scenario, commands, period), expected(scenario, commands, period)
        assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-5


def test_tension_of_the_reference() -> None:
    """Position and tension of an independent program's run of the paper's case."""
    path = files("aframe_env") / "data" / "reference" / "dynamic_paper_rigid.csv"
    table = np.genfromtxt(str(path), delimiter=",", names=True)[::2]
    got = run(Scenario.paper(), STILL)
    assert np.abs(got[:, :3] - np.stack([table["xL1_m"], table["xL2_m"], table["xL3_m"]], axis=1)).max() < 1e-5
    np.testing.assert_allclose(got[:, 7], table["T_rope_N"], rtol=1e-5)
