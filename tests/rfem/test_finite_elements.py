"""The frame of corrected elements against beam elements, and its shocks against their histories."""

import numpy as np
import pytest
from finite_elements import Frame

from aframe_env.rfem.constraints import servomotor_direction
from aframe_env.rfem.modes import frame_modes
from aframe_env.rfem.release import release
from aframe_env.scenario import Scenario
from aframe_env.scenario.crane import Crane
from train.verify import run_checks
from train.verify.frame_checks import CASES, model


def elements(leg, beam):
    frame = Crane().frame
    return Frame(frame, servomotor_direction(frame, "R"), leg, beam)


@pytest.mark.parametrize("division", [(5, 4), (20, 16)])
def test_all_frequencies_are_those_of_beam_elements(division):
    found = frame_modes(Crane(), 6 * (2 * division[0] + division[1] + 1) - 8, model=model(*division)).frequency
    assert found == pytest.approx(elements(*division).frequency, rel=1e-8)


def test_instant_release_is_that_of_beam_elements():
    history = release(Crane(), CASES["V"], duration=0.5, output_interval=5e-3, step=5e-5, model=model(20, 16))
    to_deck = history.model.to_deck
    expected = elements(20, 16).released(to_deck.T @ [0.0, 0.0, -981e3], history.time) @ to_deck.T
    found = history.displacement("S")
    assert found[:, [0, 2]] == pytest.approx(expected[:, [0, 2]], abs=2e-3 * np.ptp(expected[:, 0]))


def test_a_shock_in_the_environment_by_default():
    """A load at rest in space below a deck that moves, 60 s."""
    found = run_checks.environment_columns(Scenario.paper(initial="rest"))
    both = run_checks.Comparison(here=found, there=run_checks.time_series("shock"))
    for column in found:
        assert both.error(column) <= 0.01, column
