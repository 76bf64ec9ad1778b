"""Drives for ropes with mass and loads in water."""

from __future__ import annotations

import numpy as np
import pytest

from aframe_env import Crane, Harmonic, HarmonicMotion, LoadShape, Rope, Scenario, Water, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine
from agents.drives.guesses import required_angle
from agents.drives.objectives import Objective
from agents.drives.optimisation import optimise


def deep(level: float = -1000.0) -> Scenario:
    heave = Harmonic(coordinate="heave", amplitude=1.2, period=8.0)
    surge = Harmonic(coordinate="surge", amplitude=0.5, period=11.0)
    return Scenario(
        crane=Crane(rope=Rope.six_strand(), winch=Winch(max_rope_length=4000.0)),
        motion=HarmonicMotion(harmonics=(heave, surge)),
        load_mass=5e4,
        target_level=level,
        ramp=8.0,
        water=Water(current=((0.0, 0.4, 0.1),)),
        load=LoadShape(volume=6.4, added_mass_vertical=3e4, drag_area_vertical=20.0, drag_area_horizontal=20.0),
        initial="rest",
    )


def test_objective_is_the_engine_s() -> None:
    scenario = deep()
    objective = Objective(scenario, 40.0, max_step=0.01)
    engine = Engine(1, 0.1, max_inner_step=0.01)
    engine.reset_row(0, scenario)
    errors = [engine.read(at.LOAD_POSITION + 2)[0] - scenario.target_level]
    for _ in range(400):
        engine.step(np.zeros(1))
        errors.append(engine.read(at.LOAD_POSITION + 2)[0] - scenario.target_level)
    still = objective.still()
    assert still.omega1 == pytest.approx(engine.read(at.OMEGA1)[0], rel=1e-4)
    assert objective.errors(np.zeros(objective.times.size), np.zeros(objective.times.size))[::10] == pytest.approx(
        np.array(errors), abs=1e-4
    )


def test_a_drum_that_starts_elsewhere_has_lowered_the_load() -> None:
    objective = Objective(deep(), 2.0)
    angle = np.full(objective.times.size, 2.0)
    errors = objective.errors(angle, np.zeros_like(angle))
    assert errors[:20] == pytest.approx(-1.5 * (1.0 + objective.scenario.hanging_weight / 2e8), abs=1e-4)


@pytest.mark.parametrize("optimiser", ["nelder-mead", "gauss-newton"])
def test_a_spline_holds_the_load(optimiser: str) -> None:
    scenario = deep()
    objective = Objective(scenario, 24.0)
    still = objective.still()
    assert still.amplitude > 1.2
    # What a light rope would ask for is not enough: the rope's own waves carry on what is left.
    guess = required_angle(objective)
    followed = objective.evaluate(guess, np.gradient(guess, objective.times))
    drive = optimise(
        "spline",
        scenario,
        "omega1",
        24.0,
        intervals=24,
        optimiser=optimiser,
        max_evaluations=3000,  # type: ignore[arg-type]
    )
    assert drive.omega1 < 0.3 * followed.omega1 < 0.01 * still.omega1
