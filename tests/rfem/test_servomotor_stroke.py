"""Rigid servomotors that change their lengths: geometry, statics, energy."""

from dataclasses import replace

import numpy as np
import pytest

from aframe_env.rfem.constraints import luffing_rotation
from aframe_env.rfem.energy import energy_balance
from aframe_env.rfem.model import SMALL_ROTATION, frame_model
from aframe_env.rfem.servomotor_stroke import Stroke, strokes_at
from aframe_env.rfem.simulate import DynamicCase, simulate
from aframe_env.rfem.statics import solve
from aframe_env.rfem.structure import Division
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.cross_sections import Material, Servomotor
from aframe_env.scenario.motion import HarmonicMotion
from aframe_env.validation import InvalidValue, SmallRotationWarning
from train.verify import run_checks
from train.verify.frame_checks import model

LIGHT = Scenario.paper(motion=HarmonicMotion(), load_mass=500.0)
STROKE = 20e-3
"""m; with the other servomotor held it twists the frame."""


def length(angle):
    """|NC| with the frame luffed to ``angle``, m."""
    frame = Crane().frame
    end = luffing_rotation(angle) @ [0.0, 0.0, frame.servomotor_height]
    return np.linalg.norm(end - [frame.servomotor_deck_x, 0.0, 0.0])


@pytest.mark.parametrize("layout", ["one_chain", "three_beams"])
@pytest.mark.parametrize("leg", [1, 5])
def test_equal_strokes_luff_the_frame_as_a_rigid_body(layout, leg):
    frame = frame_model(Crane().frame, Division(leg=leg, beam=2), layout=layout)
    angle, turned = frame.frame.luffing_angle, 1e-5
    stroke = length(angle + turned) - length(angle - turned)
    moved = solve(frame, np.zeros(frame.structure.size), np.full(2, stroke))
    for name in ("N_R", "B_L", "S"):
        place = frame.structure.points[name][1]
        expected = (luffing_rotation(angle + turned) - luffing_rotation(angle - turned)) @ place
        found = frame.to_deck @ frame.structure.translation(name) @ moved
        assert found == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())
    assert np.abs(frame.deformation @ moved).max() < 1e-12 * stroke
    assert np.abs(frame.stiffness @ moved).max() < 1.0


def test_range_of_a_stroke_is_as_stated():
    frame = model(5, 2)
    angle, turned = frame.frame.luffing_angle, SMALL_ROTATION
    stroke = length(angle + turned) - length(angle)
    assert stroke == pytest.approx(0.13, abs=0.005)
    moved = solve(frame, np.zeros(frame.structure.size), np.full(2, stroke))
    found = frame.to_deck @ frame.structure.translation("S") @ moved
    reach = np.array([0.0, 0.0, frame.frame.height])
    assert np.linalg.norm(luffing_rotation(angle) @ reach + found) - reach[2] == pytest.approx(15e-3, abs=2e-3)


def test_a_stroke_beyond_its_range_warns_once():
    strokes = (Stroke.smooth(0.2, 0.5), Stroke.smooth(0.2, 0.5))
    with pytest.warns(SmallRotationWarning, match=r"turned by 0\.0[67]\d* rad") as caught:
        simulate(DynamicCase(scenario=LIGHT, strokes=strokes, duration=0.6, step=5e-3), model=model(5, 2))
    assert len(caught) == 1


def test_slow_stroke_ends_in_the_static_solution():
    # Held against the saddle-point system of (23)-(30), solved as it stands.
    frame = model(5, 2)
    strokes = (Stroke.smooth(STROKE, 4.0), Stroke.smooth(0.0, 1.0))
    history = simulate(DynamicCase(scenario=LIGHT, strokes=strokes, duration=5.0, step=5e-3), model=frame).frame
    matrix, size = frame.constraints.matrix, frame.structure.size
    system = np.block([[frame.stiffness.toarray(), -matrix.T], [matrix, np.zeros((len(matrix),) * 2)]])
    scale = np.concatenate([np.full(size, 1e-4), np.full(len(matrix), 1e4)])
    target = np.zeros(len(matrix))
    target[0] = -STROKE
    right = np.concatenate([history.force[-1], target])
    expected = scale * np.linalg.solve(scale[:, None] * system * scale, scale * right)
    assert history.position[-1] == pytest.approx(expected[:size], abs=1e-4 * STROKE)
    assert history.reactions()[-1] == pytest.approx(expected[size:], abs=1e-3 * np.abs(expected[size:]).max())
    assert np.ptp(history.servomotors()[:, 0]) > 1e4
    assert history.constraint_violation() < 1e-12


@pytest.mark.parametrize("sea", [False, True])
def test_energy_balance_with_the_work_of_the_servomotors(sea):
    frame = Crane().frame
    lossy = replace(frame.structure, material=Material(normal_damping=2.1e8, tangential_damping=5e7))
    crane = Crane(frame=replace(frame, structure=lossy))
    motion = HarmonicMotion.paper() if sea else HarmonicMotion()
    scenario = Scenario.paper("rest", motion=motion, crane=crane)
    strokes = (Stroke.smooth(STROKE, 1.5), Stroke.smooth(-0.5 * STROKE, 1.0))
    step = 2.5e-3
    case = DynamicCase(scenario=scenario, strokes=strokes, duration=4.0, step=step, output_interval=step)
    balance, held = (energy_balance(simulate(item)) for item in (case, replace(case, strokes=None)))
    assert balance.error < 1e-5
    assert np.abs(balance.input - held.input).max() > 1e3


def test_halving_the_step_is_second_order():
    strokes = (Stroke.smooth(STROKE, 1.0),) * 2
    scenario = Scenario.paper(motion=run_checks.rough_sea(), rope_damping=2e4)
    runs = [
        simulate(DynamicCase(scenario=scenario, strokes=strokes, duration=2.0, step=step), model=model(3, 2)).load
        for step in (0.01, 0.005, 0.0025)
    ]
    coarse, fine = (np.abs(a - b).max() for a, b in ((runs[0], runs[1]), (runs[1], runs[2])))
    assert 0.2 < fine / coarse < 0.3


def test_smooth_stroke():
    times = np.linspace(0.0, 3.0, 3001)
    change, rate, acceleration = strokes_at((Stroke.smooth(STROKE, 2.0), Stroke.smooth(0.0, 1.0)), times)
    assert change[0] == pytest.approx([0.0, 0.0])
    assert change[-1] == pytest.approx([STROKE, 0.0])
    assert np.gradient(change[:, 0], times)[1:-1] == pytest.approx(rate[1:-1, 0], abs=1e-6)
    assert np.gradient(rate[:, 0], times)[1:-1] == pytest.approx(acceleration[1:-1, 0], abs=1e-4)


def test_elastic_servomotors_take_no_stroke():
    frame = Crane().frame
    elastic = replace(frame.structure, servomotor=Servomotor(stiffness=3e8))
    scenario = Scenario.paper(crane=Crane(frame=replace(frame, structure=elastic)))
    with pytest.raises(InvalidValue, match=r"strokes: must be None with elastic servomotors"):
        DynamicCase(scenario=scenario, strokes=(Stroke.smooth(0.01, 1.0),) * 2)
