import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from aframe_env import Crane, InvalidValue, ScenarioDistribution, Winch
from aframe_env.config import TaskConfig
from aframe_env.scenario.crane import GRAVITY
from aframe_env.simulation import Simulation
from aframe_env.task import SENSED, STATE
from agents.control.feedback import Feedback
from agents.control.predictive import Planner, PlanningConfig, PredictiveControl
from agents.control.rope import RopeModel
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run

PERIOD = 0.1
HORIZON = 12
EFFORT = 0.02
WINCH = Winch(max_rope_speed=0.8, max_rope_acceleration=0.5)


def law(rows, crane):
    """The law once it has seen its first observations, and the models of its loads."""
    scenarios = held_out_scenarios(ScenarioDistribution(crane=crane), rows)
    config = PlanningConfig(sensors=None, horizon=HORIZON, effort=EFFORT)
    simulation = Simulation(rows, TaskConfig(scenario=scenarios[0]))
    simulation.reset_rows(np.arange(rows), [(scenario, 0) for scenario in scenarios])
    observation = simulation.observe()
    planner = Planner(rows, PERIOD, config)
    planner.start(observation, scenarios)
    tension, length = (observation[:, index(name)].astype(float) for name in ("rope_tension", "rope_length"))
    frequency = np.sqrt(crane.rope.axial_stiffness / (length * tension / GRAVITY))
    return planner, RopeModel.of(frequency, config.damping_ratio, PERIOD)


def index(name):
    return [quantity.name for quantity in STATE].index(name)


def situations(rows, seed):
    """States of the rope, pulley speeds to come and drum speeds for which the winch has too little."""
    rng = np.random.default_rng(seed)
    times = PERIOD * np.arange(HORIZON)
    phase, size = rng.uniform(0.0, 2.0 * np.pi, (2, rows, 1))
    pulley = 0.3 * size * np.cos(1.2 * times + phase)
    z = rng.standard_normal((rows, 4)) * [0.3, 0.3, 0.3, 0.1]
    return z, pulley, rng.uniform(-0.9, 0.9, rows) * WINCH.max_speed


def dense(model, row, z, pulley, drum_speed):
    """Hessian and gradient of the cost, and limits' matrix and bounds: by the model's powers, step by step."""
    a, b = model.a[row], model.b[row]
    cost_to_go = model.costs_to_go(np.full(len(model.b), EFFORT))[row]
    reach = np.zeros((HORIZON + 1, 4, HORIZON))
    free = np.zeros((HORIZON + 1, 4))
    free[0] = z
    for k in range(HORIZON):
        reach[k + 1] = a @ reach[k]
        reach[k + 1, :, k] += b
        free[k + 1] = a @ free[k]
    # The error at the horizon's end is among the cost to go already.
    errors = reach[:HORIZON, 0]
    hessian = 2.0 * (errors.T @ errors + EFFORT * np.eye(HORIZON) + reach[-1].T @ cost_to_go @ reach[-1])
    gradient = 2.0 * (errors.T @ free[:HORIZON, 0] + reach[-1].T @ cost_to_go @ free[-1])
    # The drum pays out by the pulley's speed less the rope end's, which each change moves from its step on.
    changes = np.tril(np.ones((HORIZON, HORIZON)))
    speed = pulley - z[3]
    before = np.concatenate([[WINCH.drum_radius * drum_speed], speed[:-1]])
    ramps = np.eye(HORIZON)
    most = np.full(HORIZON, PERIOD * WINCH.drum_radius * WINCH.max_acceleration)
    most[0] *= 0.5
    fastest = np.full(HORIZON, WINCH.drum_radius * WINCH.max_speed)
    matrix = -np.concatenate([ramps, changes])
    nominal = np.concatenate([speed - before, speed])
    bound = np.concatenate([most, fastest])
    return hessian, gradient, matrix, -bound - nominal, bound - nominal


def test_without_limits_the_regulator_solves_the_problem():
    planner, model = law(3, Crane(winch=Winch(max_rope_speed=90.0, max_rope_acceleration=900.0)))
    rng = np.random.default_rng(1)
    z, pulley, still = rng.standard_normal((3, 4)) * 0.2, rng.standard_normal((3, HORIZON)), np.zeros(3)
    k, state = model.gains(np.full(len(model.b), EFFORT)), z
    changes, _ = planner.problem(z, pulley, still).solve()
    for step in range(HORIZON):
        wanted = -(k * state).sum(axis=1)
        assert changes[:, step] == pytest.approx(wanted, abs=1e-6)
        state = model.advance(state, wanted)
    assert planner.plan_for(z, pulley, still).change[:, 0] == pytest.approx(-(k * z).sum(axis=1), abs=1e-9)


def test_with_limits_the_solution_is_scipys():
    rows = 6
    planner, model = law(rows, Crane(winch=WINCH))
    z, pulley, drum_speed = situations(rows, 4)
    first = planner.plan_for(z, pulley, drum_speed).change[:, 0]
    limited = 0
    for row in range(rows):
        hessian, gradient, matrix, low, high = dense(model, row, z[row], pulley[row], drum_speed[row])
        expected = minimize(
            lambda c, h=hessian, g=gradient: 0.5 * c @ h @ c + g @ c,
            np.zeros(HORIZON),
            jac=lambda c, h=hessian, g=gradient: h @ c + g,
            constraints=LinearConstraint(matrix, low, high),
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 1000},
        )
        assert expected.success
        found = planner.problem(z, pulley, drum_speed).rows(np.array([row])).solve()[0][0]
        assert (matrix @ found >= low - 1e-7).all()
        assert (matrix @ found <= high + 1e-7).all()
        assert 0.5 * found @ hessian @ found + gradient @ found == pytest.approx(expected.fun, rel=1e-6, abs=1e-8)
        assert found == pytest.approx(expected.x, abs=1e-4)
        assert first[row] == pytest.approx(expected.x[0], abs=1e-4)
        unlimited = matrix @ np.linalg.solve(hessian, -gradient)
        limited += bool(((unlimited < low - 1e-3) | (unlimited > high + 1e-3)).any())
    assert limited >= rows - 1  # else this would be no test of limits


@pytest.mark.parametrize(("observation", "least"), [("sensors", 0.95), ("state", 0.98)])
def test_acts_alike_alone_and_in_a_batch_and_removes_the_heave(observation, least):
    scenarios = held_out_scenarios(ScenarioDistribution(), 8)
    still = run(DrumStill(), scenarios)

    def policy():
        return PredictiveControl() if observation == "sensors" else PredictiveControl(PlanningConfig(sensors=None))

    together = run(policy(), scenarios, observation=observation)
    assert np.median(1.0 - together.rms / still.rms) > least
    alone = run(policy(), scenarios[:1], observation=observation)
    assert alone.error[0] == pytest.approx(together.error[0], abs=1e-6)


def test_preview_helps_where_the_winchs_limits_are_met():
    scenarios = [s for s in held_out_scenarios(ScenarioDistribution(hs=(3.8, 4.0), tp=(7.0, 8.0), heading=1.57), 6)]
    still = run(DrumStill(), scenarios).rms
    for observation, predictive, plain in (
        ("sensors", PredictiveControl(), Feedback()),
        ("state", PredictiveControl(PlanningConfig(sensors=None)), Feedback(None)),
    ):
        left = run(predictive, scenarios, observation=observation).rms
        assert (left < still).all()
        assert np.median(left / run(plain, scenarios, observation=observation).rms) < 1.0


def test_bad_input_is_refused():
    with pytest.raises(InvalidValue, match="horizon = 1"):
        PlanningConfig(horizon=1)
    with pytest.raises(InvalidValue, match=f"the policy reads {len(SENSED)}"):
        run(PredictiveControl(), held_out_scenarios(ScenarioDistribution(), 1), observation="state")
