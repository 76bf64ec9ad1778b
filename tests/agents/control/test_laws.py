import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import solve_discrete_are

from aframe_env import (
    Crane,
    Harmonic,
    HarmonicMotion,
    InvalidValue,
    Scenario,
    ScenarioDistribution,
    Sea,
    SeaMotion,
    Sensors,
    TorqueDrive,
    Winch,
)
from aframe_env.task import SENSED, STATE
from agents.control.expected_waves import ExpectedWaves
from agents.control.feedback import Feedback
from agents.control.inverse_dynamics import InverseDynamics, RequiredRope
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.control.regulator import Gains
from agents.control.rope import RopeModel
from agents.control.winch import WinchModel
from agents.drives.objectives import Objective
from agents.learned.agent import output_zero
from agents.learned.features import FeatureConfig
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run

PERIOD = 0.1
HEAVE = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=1.0, period=9.0),))


def sinusoid(**changes):
    return Scenario(motion=HEAVE, load_mass=60.0e3, rope_damping=2.0e4, ramp=10.0, **changes)


def on_the_state():
    return Feedback(None)


def test_the_rope_model_is_the_solution_of_its_differential_equation():
    frequency, ratio = 3.0, 0.05
    model = RopeModel.of(np.array([1.0, frequency]), ratio, PERIOD)
    z, change = np.array([0.3, -0.2, 0.1, 0.4]), -0.25

    def rate(_, y):
        e, v, q, p = y
        return [v, frequency**2 * (q - e) + 2.0 * ratio * frequency * (p - v), p, 0.0]

    after = solve_ivp(rate, (0.0, PERIOD), z + np.array([0.0, 0.0, 0.0, change]), rtol=1e-10, atol=1e-12).y[:, -1]
    advanced = model.advance(np.stack([z, z]), np.array([0.0, change]))
    assert advanced[1] == pytest.approx(after, abs=1e-9)


def test_the_gains_are_the_best_there_are():
    """No other gains near them cost less over a long time, from any start."""
    model = RopeModel.of(np.array([2.0]), 0.03, PERIOD)
    effort = 0.01
    k = model.gains(np.array([effort]))
    cost = solve_discrete_are(model.a[0], model.b[0][:, None], np.diag([1.0, 0.0, 0.0, 0.0]), [[effort]])

    def spent(gains, start):
        z, total = start[None].copy(), 0.0
        for _ in range(3000):
            change = -(gains * z).sum(axis=1)
            total += z[0, 0] ** 2 + effort * change[0] ** 2
            z = model.advance(z, change)
        return total

    rng = np.random.default_rng(0)
    for start in np.eye(4):
        best = spent(k, start)
        assert best == pytest.approx(start @ cost @ start, rel=1e-6)
        for _ in range(3):
            assert spent(k * (1.0 + 0.1 * rng.standard_normal(4)), start) > best


@pytest.mark.parametrize("lag", [0.0, 0.08, 0.5])
def test_a_command_turns_the_drum_as_far_as_wanted(lag):
    """Against the environment's own winch."""
    scenario = sinusoid(crane=Crane(winch=Winch(lag=lag)))
    rng = np.random.default_rng(2)
    winch = WinchModel(1, PERIOD)
    winch.start([scenario.crane])
    turns, actual = [], []

    class Turn:
        name, knows = "turn", DrumStill.knows

        def reset(self, scenarios, control_period):
            pass

        def act(self, observation, time):
            actual.append(observation[0, 9:11])
            wanted = PERIOD * winch.speed + rng.uniform(-0.02, 0.02, 1) * (0.2 if lag else 1.0)
            command, turned = winch.command(wanted)
            turns.append((wanted[0], turned[0], winch.speed[0]))
            return command

    run(Turn(), [scenario], episode_duration=4.0)
    wanted, turned, speed = np.array(turns).T
    angle, drum_speed = np.array(actual, dtype=np.float64).T
    assert np.diff(angle) == pytest.approx(turned[:-1], abs=1e-6)
    assert drum_speed[1:] == pytest.approx(speed[:-1], abs=1e-6)
    reached = abs(turned - wanted) < 1e-9
    assert reached.mean() > (0.05 if lag == 0.5 else 0.3)
    assert np.ptp(drum_speed) > 0.1


def test_feed_forward_cancels_a_sinusoidal_heave():
    """The drum's speed is s'/r, and the load stands still to within the winch's steps."""
    scenario = sinusoid()
    episodes = run(Feedback(None), [scenario], episode_duration=60.0)
    times = PERIOD * np.arange(601)
    full = times > 11.0
    w = 2.0 * np.pi / 9.0
    expected = w * np.cos(w * times) / scenario.crane.winch.drum_radius
    # The commanded speed is held for a control step: it is that of a middle of it.
    assert abs(episodes.drum_speed[0] - expected)[full].max() < 0.6 * w**2 * PERIOD / 0.75
    assert abs(episodes.error[0]).max() < 5e-3
    assert abs(run(DrumStill(), [scenario], episode_duration=60.0).error[0]).max() > 0.9


@pytest.mark.parametrize("policy", [on_the_state, InverseDynamics])
def test_what_a_sudden_start_stirs_is_calmed(policy):
    """The ship moves at once, the load is at rest: the regulator has to calm what that stirs, and not keep it up.

    The rope's damping holds on to the pulley when the load is weighed: it stays off by what that stretches the rope.
    """
    scenario = dataclasses.replace(
        sinusoid(),
        motion=HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=0.5, period=9.0),)),
        ramp=0.0,
        initial="rest",
    )
    episodes = run(policy(), [scenario], observation="state", episode_duration=60.0)
    assert abs(episodes.error[0, :100]).max() > 1e-2
    late = episodes.error[0, 300:]
    assert np.ptp(late) < 4e-3
    rope_length = scenario.crane.pulley_position[2] - scenario.target_level
    pull = scenario.rope_damping * 0.5 * 2.0 * np.pi / 9.0
    assert abs(late.mean()) < 1.5 * pull * rope_length / scenario.crane.rope.axial_stiffness


def test_required_rope_holds_the_load_without_feedback():
    """A drum that follows it exactly (Objective has no winch limits) leaves the load where it was."""
    scenario = ScenarioDistribution(rope_length=(200.0, 300.0)).draw(np.random.default_rng(5))
    objective = Objective(scenario, 30.0, 0.01)
    rope = RequiredRope([scenario], 0.01)
    rope_out = []
    for _ in objective.times:
        rope_out.append(rope.now()[0])
        rope.advance()
    angle = np.array(rope_out) / scenario.crane.winch.drum_radius
    outcome = objective.evaluate(angle, np.gradient(angle, objective.times, edge_order=2))
    assert outcome.omega2 < 1e-3 * objective.still().omega2


@pytest.mark.parametrize(
    ("policy", "observation", "least"),
    [(on_the_state, "state", 0.99), (InverseDynamics, "state", 0.99), (Feedback, "sensors", 0.95)],
)
def test_policies_act_alike_alone_and_in_a_batch_and_remove_the_heave(policy, observation, least):
    scenarios = held_out_scenarios(ScenarioDistribution(), 12)
    still = run(DrumStill(), scenarios, episode_duration=60.0)
    together = run(policy(), scenarios, observation=observation, episode_duration=60.0)
    assert np.median(1.0 - together.rms / still.rms) > least
    alone = run(policy(), scenarios[:1], observation=observation, episode_duration=60.0)
    assert alone.error[0] == pytest.approx(together.error[0], abs=1e-6)


@pytest.mark.parametrize("delay", [0.0, 0.3])
def test_the_delay_is_bridged(delay):
    """Ideal sensors, only late: the prediction makes good what a pure delay would leave, 2 sin(π τ / T)."""
    scenario = sinusoid()
    sensors = dataclasses.replace(Sensors.ideal(), delay=delay)
    episodes = run(Feedback(sensors), [scenario], observation=sensors, episode_duration=60.0)
    still = run(DrumStill(), [scenario], episode_duration=60.0)
    left = episodes.rms[0] / still.rms[0]
    assert left < 0.02
    assert left < 0.25 * 2.0 * np.sin(np.pi * 0.3 / 9.0)


def test_the_winchs_limits_are_survived():
    """A sea that asks for far more than the winch has: no winding up, and still better than the drum left alone."""
    motion = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=3.0, period=6.0),))
    scenario = dataclasses.replace(sinusoid(), motion=motion)
    still = run(DrumStill(), [scenario], episode_duration=60.0)
    for policy, observation in ((Feedback(None), "state"), (Feedback(), "sensors")):
        assert run(policy, [scenario], observation=observation).rms[0] < still.rms[0]


SENSED_LAWS = {
    "feedback": Feedback,
    "predictive control": PredictiveControl,
    "output zero on sensors": lambda: output_zero(FeatureConfig(sensors=Sensors())),
}
STATE_LAWS = {
    "feedback": on_the_state,
    "predictive control": lambda: PredictiveControl(PlanningConfig(sensors=None)),
    "output zero": lambda: output_zero(FeatureConfig()),
}


class Misinformed:
    """A policy that is told another mass of the load."""

    def __init__(self, policy, observation, factor):
        self.name, self.knows = policy.name, policy.knows
        self._policy, self._factor = policy, factor
        quantities = SENSED if observation == "sensors" else STATE
        self._column = [quantity.name for quantity in quantities].index("load_mass")

    def reset(self, scenarios, control_period):
        self._policy.reset(scenarios, control_period)

    def act(self, observation, time):
        told = observation.copy()
        told[:, self._column] *= self._factor
        return self._policy.act(told, time)


@pytest.mark.parametrize(
    ("make", "observation"),
    [*((make, "sensors") for make in SENSED_LAWS.values()), *((make, "state") for make in STATE_LAWS.values())],
    ids=[*SENSED_LAWS, *(f"{name} (state)" for name in STATE_LAWS)],
)
def test_the_told_mass_is_of_no_account(make, observation):
    """The load is weighed: 20 % more or less on the manifest changes not a bit."""
    scenarios = held_out_scenarios(ScenarioDistribution(), 4)
    plain, low, high = (
        run(Misinformed(make(), observation, factor), scenarios, observation=observation, episode_duration=15.0)
        for factor in (1.0, 0.8, 1.2)
    )
    assert plain.error.any()
    for told in (low, high):
        np.testing.assert_array_equal(told.error, plain.error)
        np.testing.assert_array_equal(told.drum_speed, plain.drum_speed)


@pytest.mark.parametrize("make", SENSED_LAWS.values(), ids=SENSED_LAWS)
def test_a_mass_that_is_not_told_is_not_missed(make):
    scenarios = held_out_scenarios(ScenarioDistribution(), 3)
    told, untold = (
        run(make(), scenarios, observation=Sensors(mass_told=known), episode_duration=10.0) for known in (True, False)
    )
    np.testing.assert_array_equal(told.error, untold.error)


@pytest.mark.parametrize("make", SENSED_LAWS.values(), ids=SENSED_LAWS)
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_load_pin_that_is_off_by_a_tenth_is_borne(make, factor):
    scenarios = held_out_scenarios(ScenarioDistribution(), 12)
    column = [quantity.name for quantity in SENSED].index("rope_tension")

    class Pinned(Misinformed):
        def act(self, observation, time):
            told = observation.copy()
            told[:, column] *= factor
            return self._policy.act(told, time)

    still = run(DrumStill(), scenarios)
    off, right = (
        run(policy, scenarios, observation="sensors") for policy in (Pinned(make(), "sensors", factor), make())
    )
    assert np.median(off.rms / right.rms) < 1.1
    # There is no feedback beneath an agent: it is the share that an output of zero leaves anyhow.
    assert np.median(1.0 - off.rms / still.rms) > (0.9 if "zero" in make().name else 0.95)


@pytest.mark.parametrize(
    "make",
    [
        lambda sensors, waves: Feedback(sensors, waves=waves),
        lambda sensors, waves: PredictiveControl(PlanningConfig(sensors=sensors, waves=waves)),
    ],
    ids=["feedback", "predictive control"],
)
def test_a_ship_that_moves_already_costs_the_sensors_little(make):
    """Most of what is left is the task's: the load begins off its level. Told of it, the filters add little to that."""
    source = ScenarioDistribution(ramp=0.0)
    scenarios = held_out_scenarios(source, 96)
    expected, from_rest = (ExpectedWaves.of(each) for each in (source, ScenarioDistribution()))
    assert (expected.build_up, from_rest.build_up) == (0.0, ScenarioDistribution().ramp)
    sensed, seen, misled = (
        run(make(sensors, waves), scenarios, observation="state" if sensors is None else "sensors")
        for sensors, waves in ((Sensors(), expected), (None, expected), (Sensors(), from_rest))
    )
    assert np.median((sensed.rms / seen.rms)[:24]) < 1.5
    assert np.median((sensed.rms / misled.rms)[:24]) < 0.95
    still = run(DrumStill(), scenarios)
    late, still_late = (
        np.sqrt(np.mean(np.square(each.error[:, 300:], dtype=np.float64), axis=1)) for each in (sensed, still)
    )
    assert np.median(late / still_late) < 0.03


def test_bad_input_is_refused():
    with pytest.raises(InvalidValue, match=r"effort = 0.0 s²: must be in \[1e-08, 1e\+08\] s²"):
        Gains(effort=0.0, share=0.1)
    with pytest.raises(InvalidValue, match="share = 2"):
        Gains(effort=1.0, share=2.0)
    with pytest.raises(InvalidValue, match="the policy reads 14"):
        run(Feedback(None), held_out_scenarios(ScenarioDistribution(), 1), observation="sensors")


@pytest.mark.parametrize(
    ("policy", "most"),
    [
        (Feedback(None), 0.012),
        (PredictiveControl(PlanningConfig(sensors=None)), 0.006),
        (Feedback(Sensors()), 0.04),
        (PredictiveControl(PlanningConfig(sensors=Sensors())), 0.03),
        (InverseDynamics(), 0.011),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_laws_take_a_drum_with_inertia_as_it_is(policy, most):
    """Of the metre by which the load moves with the drum still."""
    sea = SeaMotion(sea=Sea(hs=2.0, tp=8.0, heading=2.5, seed=0))
    driven, told = (
        Scenario(crane=Crane(winch=Winch(drive=drive)), motion=sea, ramp=10.0, rope_damping=3e4)
        for drive in (TorqueDrive(), None)
    )
    observation = "state" if policy.name.endswith("(state)") or policy.name == "inverse dynamics" else "sensors"
    with_drive = run(policy, [driven], observation=observation).rms[0]
    assert run(policy, [told], observation=observation).rms[0] < with_drive < most


def test_drives_are_not_optimised_for_a_drum_with_inertia():
    with pytest.raises(InvalidValue, match="drive = TorqueDrive"):
        Objective(sinusoid(crane=Crane(winch=Winch(drive=TorqueDrive()))), 10.0)
