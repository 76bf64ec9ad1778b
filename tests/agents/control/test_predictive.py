import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize

from aframe_env import InvalidValue, ScenarioDistribution
from aframe_env.task import SENSED
from agents.control.feedback import SensorFeedback
from agents.control.predictive import PredictiveControl, Problem
from agents.control.rope import RopeModel
from agents.policy import DrumStill
from agents.rollout import held_out_scenarios, run

PERIOD = 0.1


def problem(frequency=2.0, effort=0.02, horizon=12):
    model = RopeModel.of(np.array([frequency]), 0.03, PERIOD)
    return model, Problem(model.a[0], model.b[0], model.costs_to_go(effort)[0], effort, horizon)


def test_without_limits_the_regulator_solves_the_problem():
    model, program = problem()
    k, z = model.gains(0.02), np.array([0.2, -0.1, 0.3, 0.2])
    changes = np.linalg.solve(program.hessian, -program.gradient(z))
    state = z[None]
    for change in changes:
        assert change == pytest.approx(-(k @ state[0])[0], abs=1e-9)
        state = model.advance(state, np.array([change]))


def test_with_limits_the_solution_is_scipys():
    _, program = problem()
    rng = np.random.default_rng(4)
    bound = np.concatenate([np.full(12, 0.1), np.full(12, 0.25)])
    for _ in range(4):
        z = rng.standard_normal(4) * [0.3, 0.3, 0.3, 0.1]
        gradient = program.gradient(z)
        expected = minimize(
            lambda c, gradient=gradient: 0.5 * c @ program.hessian @ c + gradient @ c,
            np.zeros(12),
            jac=lambda c, gradient=gradient: program.hessian @ c + gradient,
            constraints=LinearConstraint(program.limits, -bound, bound),
            method="SLSQP",
            options={"ftol": 1e-12, "maxiter": 500},
        )
        found = program.solve(z, -bound, bound)
        value = 0.5 * found @ program.hessian @ found + gradient @ found
        assert (abs(program.limits @ found) <= bound + 1e-3).all()
        assert value == pytest.approx(expected.fun, rel=5e-3)
        assert found[0] == pytest.approx(expected.x[0], abs=5e-3)
        unlimited = np.linalg.solve(program.hessian, -gradient)
        assert (abs(program.limits @ unlimited) > bound).any()  # else this would be no test of limits


def test_acts_alike_alone_and_in_a_batch_and_removes_the_heave():
    scenarios = held_out_scenarios(ScenarioDistribution(), 8)
    still = run(DrumStill(), scenarios)
    together = run(PredictiveControl(), scenarios, observation="sensors")
    assert np.median(1.0 - together.rms / still.rms) > 0.95
    alone = run(PredictiveControl(), scenarios[:1], observation="sensors")
    assert alone.error[0] == pytest.approx(together.error[0], abs=1e-6)


def test_preview_helps_where_the_winchs_limits_are_met():
    scenarios = [s for s in held_out_scenarios(ScenarioDistribution(hs=(3.8, 4.0), tp=(7.0, 8.0), heading=1.57), 6)]
    still = run(DrumStill(), scenarios).rms
    predictive = run(PredictiveControl(), scenarios, observation="sensors").rms
    plain = run(SensorFeedback(), scenarios, observation="sensors").rms
    assert (predictive < still).all()
    assert np.median(predictive / plain) < 1.0


def test_bad_input_is_refused():
    with pytest.raises(InvalidValue, match="horizon = 1"):
        PredictiveControl(horizon=1)
    with pytest.raises(InvalidValue, match=f"the policy reads {len(SENSED)}"):
        run(PredictiveControl(), held_out_scenarios(ScenarioDistribution(), 1), observation="state")
