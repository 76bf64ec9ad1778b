import math
from dataclasses import replace

import numpy as np
import pytest

from aframe_env.rfem.energy import energy_balance
from aframe_env.rfem.model import frame_model
from aframe_env.rfem.modes import frame_modes
from aframe_env.rfem.reference import time_series
from aframe_env.rfem.release import release
from aframe_env.rfem.rope_law import rope_force
from aframe_env.rfem.simulate import DrivenDrum, DynamicCase, PrescribedDrum, simulate
from aframe_env.rfem.statics import LoadCase, static
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.cross_sections import Material, Servomotor
from aframe_env.scenario.motion import Harmonic, HarmonicMotion
from aframe_env.validation import InvalidValue, SmallRotationWarning
from train.verify import run_checks
from train.verify.cases import columns_of
from train.verify.frame_checks import CASES, model, order

STILL = Scenario.paper(motion=HarmonicMotion())


def test_paper_case_against_the_independent_program():
    for check in run_checks.paper_case():
        assert check.passed, check.measured


def test_release_of_the_load():
    # At half the reference's fineness; train.verify runs it at the same.
    history = release(Crane(), CASES["V"], ramp=0.1, step=2.5e-4, model=model(60, 50))
    both = run_checks.Comparison(here=columns_of(history), there=time_series("release_ramp"))
    for column in ("uS1_m", "uS3_m", *run_checks.REACTIONS):
        assert both.error(column) <= 0.01


def test_instant_release_is_a_sum_of_modes():
    frame = model(5, 2)
    history = release(Crane(), CASES["V"], duration=0.5, step=2e-5, output_interval=0.01, model=frame)
    modes = frame_modes(Crane(), 70, model=frame)
    amplitude = modes.shape.T @ (frame.mass @ history.position[0])
    swings = np.cos(np.outer(history.time, 2 * math.pi * modes.frequency))
    pulley = (swings * amplitude) @ (frame.to_deck @ frame.pulley @ modes.shape).T
    assert np.abs(history.displacement("S") - pulley).max() < 2e-3 * np.abs(pulley).max()


def test_release_of_too_great_a_load_warns_once():
    case = LoadCase(forces={"S": (0.0, 0.0, -3e7)})
    with pytest.warns(SmallRotationWarning) as caught:
        release(Crane(), case, duration=0.1, step=1e-3, output_interval=0.01, model=model(5, 2))
    assert len(caught) == 1


def test_damped_release_comes_to_rest_under_its_weight():
    frame = Crane().frame
    lossy = Material(normal_damping=2e9, tangential_damping=8e8)
    damped = Crane(frame=replace(frame, structure=replace(frame.structure, material=lossy)))
    case = replace(CASES["V"], own_weight=True)
    history = release(damped, case, duration=6.0, step=1e-3, output_interval=0.1)
    own = static(damped, CASES["G"]).displacement["S"]
    assert history.displacement("S")[-1] == pytest.approx(own, abs=2e-3 * np.abs(own).max())
    assert history.servomotors()[-1] == pytest.approx([126522.445] * 2, rel=2e-3)


def test_stiff_frame_moves_the_load_as_a_rigid_one():
    frame = Crane().frame
    material = replace(frame.structure.material, young_modulus=2.1e14, shear_modulus=8.1e13)
    stiff = replace(frame, structure=replace(frame.structure, material=material))
    scenario = Scenario.paper(crane=Crane(frame=stiff))
    result = simulate(DynamicCase(scenario=scenario, step=1e-3, duration=30.0))
    rigid = time_series("paper_rigid")["xL3_m"][: result.time.size]
    assert np.abs(result.load[:, 2] - rigid).max() <= 1e-4


def _balance(scenario, **case):
    step = 2.5e-3
    return energy_balance(
        simulate(DynamicCase(scenario=scenario, duration=10.0, step=step, output_interval=step, **case))
    )


def test_energy_balance_with_the_drum_still():
    balance = _balance(Scenario.paper("rest"))
    assert balance.error < 1e-5
    assert np.ptp(balance.input) > 1e6
    assert balance.dissipated[-1] == 0.0


def test_energy_balance_with_losses_everywhere():
    frame = Crane().frame
    made = replace(
        frame.structure,
        material=Material(normal_damping=2.1e8, tangential_damping=5e7),
        servomotor=Servomotor(stiffness=3e8, damping=2e5),
    )
    crane = Crane(frame=replace(frame, structure=made))
    balance = _balance(Scenario.paper("rest", rope_damping=5e4, crane=crane))
    assert balance.error < 1e-5
    assert balance.dissipated[-1] > 1e3


def test_energy_balance_with_a_prescribed_drum():
    drum = PrescribedDrum(angle=lambda t: 1.5 * (1.0 - math.cos(0.7 * t)), rate=lambda t: 1.05 * math.sin(0.7 * t))
    assert _balance(Scenario.paper(), drum=drum).error < 1e-5


def test_energy_balance_with_a_driven_drum():
    drum = DrivenDrum(inertia=5e4, torque=lambda t, a, w: -0.75 * 981e3 * (1 + 0.1 * math.sin(t)) - 2e5 * w - 1e5 * a)
    assert _balance(Scenario.paper(), drum=drum).error < 1e-5


def test_halving_the_step_is_second_order():
    runs = [
        simulate(DynamicCase(step=h, duration=10.0, output_interval=0.1), model=model(5, 2)).load[:, 2]
        for h in (0.02, 0.01, 0.005)
    ]
    gaps = [np.abs(a - b).max() for a, b in ((runs[0], runs[1]), (runs[1], runs[2]))]
    assert order(*gaps) > 1.9


def test_without_motion_nothing_moves():
    result = simulate(DynamicCase(scenario=STILL, duration=2.0, step=5e-3))
    assert np.abs(result.load - result.load[0]).max() < 1e-7
    assert result.tension == pytest.approx(981e3, rel=1e-8)
    pulley = result.frame.displacement("S")
    assert np.abs(pulley - pulley[0]).max() < 1e-9


def test_drum_pays_out_with_positive_angle():
    drum = PrescribedDrum(angle=lambda t: 0.5 * t, rate=lambda t: 0.5)
    result = simulate(DynamicCase(scenario=STILL, drum=drum, duration=4.0, step=5e-3))
    assert result.load[-1, 2] < result.load[0, 2] - 0.5


def test_rope_goes_slack_and_never_pushes():
    heave = HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=4.0, period=4.5),))
    scenario = Scenario.paper(motion=heave, rope_damping=2e4)
    result = simulate(DynamicCase(scenario=scenario, duration=10.0, step=2.5e-3), model=model(5, 2))
    assert result.tension.min() == 0.0
    assert result.tension.max() > 2e6
    assert np.isfinite(result.load).all()


def test_feet_and_cylinders_do_not_drift():
    scenario = Scenario.paper(motion=run_checks.rough_sea())
    result = simulate(DynamicCase(scenario=scenario, duration=20.0, step=0.02, output_interval=0.1), model=model(5, 2))
    assert result.frame.constraint_violation() < 1e-12
    assert np.ptp(result.frame.displacement("S")[:, 2]) > 1e-4
    # What the linear length leaves out is what the displacements say: |u|²/(2 length).
    beyond = run_checks.second_order_lengths(result)["servomotors C–N"].max()
    moved = max(np.linalg.norm(result.frame.displacement(f"N_{side}"), axis=1).max() for side in "RL")
    assert beyond == pytest.approx(moved**2 / (2.0 * 8.266), rel=0.02)
    assert beyond > 1e-6


def test_stress_follows_the_static_one():
    frame = model(20, 16)
    result = simulate(DynamicCase(scenario=STILL, duration=0.1, step=5e-3), model=frame)
    peak = max(station.von_mises for station in static(Crane(), CASES["L1"], model=frame).along())
    assert result.frame.von_mises()[0].max() == pytest.approx(peak, rel=0.1)


def test_rope_law():
    pull = rope_force(
        geometric=10.1, geometric_rate=0.2, unstretched=10.0, unstretched_rate=0.5, stiffness=1e5, damping=1e4
    )
    assert pull.tension == pytest.approx(1e4 - 3e3)
    assert pull.elastic == pytest.approx(1e4)
    slack = rope_force(
        geometric=9.9, geometric_rate=0.2, unstretched=10.0, unstretched_rate=0.0, stiffness=1e5, damping=1e4
    )
    assert slack.tension == 0.0


def test_bad_input_is_named():
    with pytest.raises(InvalidValue, match=r"output_interval.*\(0, 1\] s"):
        DynamicCase(duration=1.0, output_interval=2.0)
    with pytest.raises(InvalidValue, match=r"step = 0.5 s: must be smaller"):
        simulate(DynamicCase(scenario=Scenario(load_mass=100.0), step=0.5, output_interval=0.5), model=model(5, 2))
    with pytest.raises(InvalidValue, match="frame"):
        simulate(model=frame_model(replace(Crane().frame, height=13.0)))
