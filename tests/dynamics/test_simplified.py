import math
from dataclasses import replace
from importlib.resources import files

import numpy as np
import oracle
import pytest

from aframe_env import Crane, HarmonicMotion, Rope, Scenario, Sea, SeaMotion, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine, timing
from aframe_env.motion import Components

REFERENCE = files("aframe_env") / "data" / "reference" / "dynamic_paper_rigid.csv"
PERIOD = 0.1


def run(scenario, commands, period=PERIOD, **options):
    """Load position, velocity and Ω1 (T + 1, 7) of one row."""
    engine = Engine(1, period, **options)
    engine.reset_row(0, scenario)

    def now():
        return np.concatenate([engine.read_many(at.LOAD_POSITION, 6)[0], engine.read(at.OMEGA1)])

    out = [now()]
    for command in commands:
        engine.step(np.array([command]))
        out.append(now())
    return np.array(out)


def expected(scenario, commands, period=PERIOD, **options):
    winch = scenario.crane.winch
    radius = winch.drum_diameter / 2
    drum, kinks = oracle.winch(
        commands, period, winch.max_rope_speed / radius, winch.max_rope_acceleration / radius, winch.lag
    )
    tip = oracle.pulley(
        oracle.of_components(scenario.motion.components()), scenario.crane.pulley_position, scenario.ramp
    )
    if np.any(commands):
        options["breaks"] = kinks
    return oracle.solve(scenario, np.arange(len(commands) + 1) * period, tip, drum, **options)


class AnyMotion:
    """Six-degree-of-freedom sum of harmonics with phases of its own."""

    def __init__(self, seed, components=12, scale=1.0):
        rng = np.random.default_rng(seed)
        size = np.array([1.0, 1.0, 1.5, 0.08, 0.05, 0.03]) * scale / math.sqrt(components)
        response = size * (rng.normal(size=(components, 6)) + 1j * rng.normal(size=(components, 6)))
        self._components = Components(rng.uniform(0.35, 1.6, components), response)

    def components(self):
        return self._components


STILL = np.zeros(600)
WAVING = 2.0 * np.sin(0.7 * np.arange(600) * PERIOD) + np.random.default_rng(3).normal(0, 0.7, 600)


@pytest.mark.parametrize(
    ("scenario", "commands", "bound"),
    [
        (Scenario.paper(), STILL, 1e-6),
        (Scenario.paper(initial="rest"), STILL, 1e-5),
        (Scenario.paper(initial="rest", rope_damping=2e4), STILL, 1e-6),
        (Scenario.paper(), WAVING, 1e-5),
        (Scenario(motion=AnyMotion(1), ramp=10.0, rope_damping=3e4), WAVING, 1e-5),
        (Scenario(motion=SeaMotion(sea=Sea(hs=2.5, tp=9.0, heading=2.5, seed=4))), WAVING, 1e-5),
        (
            Scenario(motion=AnyMotion(4), crane=Crane(winch=Winch(lag=0.3)), load_mass=7e4, rope_damping=2e4),
            WAVING,
            1e-5,
        ),
        # Undamped, soft rope, white noise for a command: the kinks of the drum's speed add up.
        (Scenario(motion=AnyMotion(2), load_mass=4e4, target_level=-900.0), WAVING, 2e-5),
    ],
    ids=["paper", "rest", "damped", "paper-drum", "six-dof", "sea", "lag", "deep-light"],
)
def test_load_follows_an_independent_integrator(scenario, commands, bound):
    got, want = run(scenario, commands), expected(scenario, commands)
    assert np.abs(got[:, :3] - want[:, :3]).max() < bound
    assert np.abs(got[:, 6] - want[:, 6]).max() < 1e-4 * max(1.0, want[-1, 6])


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
def test_slack_and_taut_again(mass, target, ratio, steps, events):
    """Rope paid out at 14 m/s², faster than the load falls, goes slack, and snatches when the drum brakes."""
    scenario = Scenario(motion=HarmonicMotion(), load_mass=mass, target_level=target, crane=FAST)
    scenario = replace(scenario, rope_damping=2 * ratio * mass * scenario.rope_frequency)
    commands = np.concatenate([np.zeros(10), np.full(8, 4.0), np.full(8, -2.0), np.zeros(74)])[:steps]
    engine = Engine(1, PERIOD)
    engine.reset_row(0, scenario)
    slack = []
    for command in commands:
        engine.step(np.array([command]))
        slack.append(bool(engine.read(at.SLACK)[0]))
    assert np.count_nonzero(np.diff(np.array(slack, int)) == -1) >= events
    got, want = run(scenario, commands), expected(scenario, commands, max_step=2e-3)
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-3


def test_fourth_order():
    scenario = Scenario(motion=AnyMotion(6), initial="rest", rope_damping=1e4)
    want = expected(scenario, np.zeros(200))
    errors = [
        np.abs(run(scenario, np.zeros(200), max_inner_step=h)[:, :3] - want[:, :3]).max() for h in (0.1, 0.05, 0.025)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 3.7) & (orders < 4.5)), (errors, orders)


def energy(scenario, states):
    """Kinetic, potential and elastic energy (T,), J, the ship and the drum at rest."""
    crane = scenario.crane
    tip = np.array(crane.pulley_position)
    distance = np.linalg.norm(states[:, :3] - tip, axis=1)
    stretch = distance + math.dist(crane.pulley_position, crane.drum_position) - scenario.free_length
    stiffness = crane.rope.axial_stiffness / scenario.free_length
    kinetic = 0.5 * scenario.load_mass * (states[:, 3:6] ** 2).sum(axis=1)
    return (
        kinetic
        + scenario.load_mass * scenario.gravity * (states[:, 2] - scenario.target_level)
        + 0.5 * stiffness * np.maximum(stretch, 0.0) ** 2
    )


def swing(scenario, start, steps, **options):
    """States (T, 7) from ``start`` (position, velocity), ship and drum still."""
    engine = Engine(1, PERIOD, **options)
    engine.reset_row(0, scenario)
    row = engine.copy_row(0)
    row[at.LOAD_POSITION : at.LOAD_POSITION + 3] = start[:3]
    row[at.LOAD_VELOCITY : at.LOAD_VELOCITY + 3] = start[3:]
    engine.write_row(0, row)
    out = []
    for _ in range(steps):
        out.append(np.concatenate([engine.read_many(at.LOAD_POSITION, 6)[0], engine.read(at.OMEGA1)]))
        engine.step(np.zeros(1))
    return np.array(out)


CALM = Scenario(motion=HarmonicMotion())
REST = np.array([*CALM.crane.pulley_position[:2], CALM.target_level, 0.0, 0.0, 0.0])


def test_energy_is_kept_bobbing_and_swinging():
    start = REST + np.array([10.0, -5.0, 0.3, 0.2, 0.5, 1.0])
    states = swing(CALM, start, 600)
    total = energy(CALM, states)
    exchanged = 0.5 * CALM.load_mass * (states[:, 3:6] ** 2).sum(axis=1).max()
    assert np.ptp(total) < 1e-6 * total[0]
    assert np.ptp(total) < 1e-4 * exchanged


def test_energy_is_kept_through_bounces():
    """Thrown up, the load falls back into its rope, again and again."""
    scenario = replace(CALM, load_mass=2e4, target_level=-150.0)
    start = REST * [1, 1, 0, 0, 0, 0] + [0.0, 0.0, -150.0, 0.0, 0.0, 5.0]
    states = swing(scenario, start, 600)
    total = energy(scenario, states)
    tip = np.array(scenario.crane.pulley_position)
    taut = np.linalg.norm(states[:, :3] - tip, axis=1) > scenario.free_length - scenario.crane.drum_to_pulley
    assert np.count_nonzero(np.diff(taut)) > 20
    assert np.ptp(total) < 3e-3 * total[0]
    finer = energy(scenario, swing(scenario, start, 600, max_inner_step=0.002))
    assert np.ptp(finer) < 2e-4 * finer[0]


def crossings(values):
    """Times (in control steps) of upward zero crossings, interpolated by a cubic through four samples."""
    found = []
    for i in np.flatnonzero((values[1:-2] < 0) & (values[2:-1] >= 0)) + 1:
        cubic = np.polyfit(np.arange(-1, 3), values[i - 1 : i + 3], 3)
        roots = np.roots(cubic)
        real = roots[np.abs(roots.imag) < 1e-9].real
        found.append(i + real[(real >= 0) & (real <= 1)][0])
    return np.array(found)


def test_static_stretch():
    states = swing(CALM, REST, 50)
    assert np.abs(states[:, :3] - REST[:3]).max() < 1e-9
    engine = Engine(1, PERIOD)
    engine.reset_row(0, CALM)
    assert engine.read(at.TENSION)[0] == pytest.approx(1e5 * 9.81, rel=1e-12)
    length = engine.read(at.FREE_LENGTH)[0]
    reach = CALM.crane.drum_to_pulley + CALM.rope_length
    assert reach - length == pytest.approx(1e5 * 9.81 * length / 2e8, rel=1e-12)


@pytest.mark.parametrize(("mass", "target"), [(1e5, -300.0), (2e4, -40.0), (1e5, -1489.0)])
def test_small_oscillation_frequency(mass, target):
    scenario = replace(CALM, load_mass=mass, target_level=target)
    start = REST * [1, 1, 0, 0, 0, 0] + [0.0, 0.0, target, 0.0, 0.0, 0.01]
    height = swing(scenario, start, 600)[:, 2] - target
    at_times = crossings(height)
    measured = 2 * math.pi * (len(at_times) - 1) / ((at_times[-1] - at_times[0]) * PERIOD)
    assert measured == pytest.approx(math.sqrt(2e8 / scenario.free_length / mass), rel=2e-5)


def test_pendulum_frequency():
    """On a stiff rope, 1 cm aside: g / l with the stretched length."""
    scenario = replace(CALM, crane=Crane(rope=Rope(axial_stiffness=2e10)), target_level=-50.0)
    start = REST * [1, 1, 0, 0, 0, 0] + [0.0, 0.0, -50.0, 0.01, 0.0, 0.0]
    at_times = crossings(swing(scenario, start, 2000)[:, 0] - REST[0])
    measured = 2 * math.pi * (len(at_times) - 1) / ((at_times[-1] - at_times[0]) * PERIOD)
    assert measured == pytest.approx(math.sqrt(9.81 / scenario.rope_length), rel=1e-6)


def test_short_rope_and_light_load():
    """The stiffest corner of the default distribution, and beyond: the step follows the rope's frequency."""
    for length, mass in ((50.0, 20e3), (25.0, 5e3)):
        scenario = Scenario(
            motion=AnyMotion(8, scale=0.5),
            load_mass=mass,
            target_level=Crane().pulley_position[2] - length,
            rope_damping=1e3,
        )
        times = timing(scenario, PERIOD)
        assert times.inner_step * scenario.rope_frequency <= 0.1 + 1e-12
        got, want = run(scenario, STILL[:200]), expected(scenario, STILL[:200])
        assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-5


@pytest.mark.parametrize(
    ("period", "segments", "segment"), [(0.1, 1, 0.1), (0.2, 1, 0.2), (0.5, 3, 0.5 / 3), (2.0, 10, 0.2)]
)
def test_long_control_periods_are_divided(period, segments, segment):
    times = timing(CALM, period)
    assert (times.segments, times.segment) == (segments, pytest.approx(segment))
    assert times.inner_step <= 0.02 + 1e-12
    commands = np.resize([1.0, -1.5, 0.5], round(30 / period))
    scenario = Scenario(motion=AnyMotion(9))
    got, want = run(scenario, commands, period), expected(scenario, commands, period)
    assert np.abs(got[:, :3] - want[:, :3]).max() < 1e-5


def test_tension_of_the_reference():
    """Position and tension of an independent program's run of the paper's case."""
    table = np.genfromtxt(str(REFERENCE), delimiter=",", names=True)
    engine = Engine(1, PERIOD)
    engine.reset_row(0, Scenario.paper())
    for k in range(601):
        line = table[2 * k]
        got = engine.read_many(at.LOAD_POSITION, 3)[0]
        assert np.abs(got - [line["xL1_m"], line["xL2_m"], line["xL3_m"]]).max() < 1e-5
        assert engine.read(at.TENSION)[0] == pytest.approx(line["T_rope_N"], rel=1e-5)
        engine.step(np.zeros(1))
