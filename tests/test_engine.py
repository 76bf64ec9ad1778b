"""Rows beside each other: none feels the others, whatever their inner steps, motions and numbers of components."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from aframe_env import Crane, Harmonic, HarmonicMotion, Rope, Scenario, ScenarioDistribution, Winch
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine, timing

FAST = Crane(winch=Winch(max_rope_acceleration=14.0))


def histories(scenarios: list[Scenario], commands: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Every quantity of the state (T, rows, slots) under ``commands`` (T, rows)."""
    engine = Engine(len(scenarios), 0.1)
    for k, scenario in enumerate(scenarios):
        engine.reset_row(k, scenario)
    out = []
    for command in commands:
        engine.step(command)
        out.append(engine.read_many(0, at.PARTED + 1))
    return np.array(out)


def mixed_rows() -> list[Scenario]:
    """Rows of 5, 5 and over 50 inner steps, of knots 0.4, 0.2 and 0.1 s apart, still and moving, slack at times."""
    light = Scenario(motion=HarmonicMotion(), load_mass=200.0, target_level=-5.0, crane=FAST)
    return [
        Scenario.paper(initial="rest"),
        replace(Scenario.paper(), crane=FAST, load_mass=2e4, target_level=-150.0),
        replace(light, rope_damping=50.0),
        *(heaving(period) for period in (2.0, 1.0)),
        *(ScenarioDistribution().draw(np.random.default_rng(k)) for k in range(5)),
    ]


def heaving(period: float) -> Scenario:
    """Half a metre of heave at a period [s]."""
    return Scenario(motion=HarmonicMotion(harmonics=(Harmonic(coordinate="heave", amplitude=0.5, period=period),)))


def test_row_is_the_same_alone_and_in_any_batch() -> None:
    scenarios = mixed_rows()
    assert timing(scenarios[2], 0.1).substeps > 10 * timing(scenarios[0], 0.1).substeps
    commands = np.random.default_rng(1).uniform(-4.0, 4.0, (100, len(scenarios)))
    knots = [Engine(1, 0.1).row_vector(s)[at.NODE_SEGMENTS] for s in scenarios]
    assert {1.0, 2.0, 4.0} <= set(knots)
    together = histories(scenarios, commands)
    for k, scenario in enumerate(scenarios):
        alone = histories([scenario], commands[:, k : k + 1])[:, 0]
        np.testing.assert_array_equal(together[:, k], alone)


def test_row_parts_by_its_own_tension_alone() -> None:
    """A row of few inner steps beside one of many, its rope a little stronger than what it ever bears."""
    paper = Scenario.paper(initial="rest")
    commands = np.zeros((100, 2))
    peak = histories([paper], commands[:, :1])[:, 0, at.PEAK_TENSION].max()
    for margin, parts in ((1.001, 0.0), (0.999, 1.0)):
        row = replace(paper, crane=Crane(rope=Rope(breaking_load=margin * peak)))
        assert histories([row, mixed_rows()[2]], commands)[-1, 0, at.PARTED] == parts


@pytest.mark.parametrize("components", [1, 3, 4, 33, 100])
def test_any_number_of_components(components: int) -> None:
    """Room grows for the row that needs it, and the other rows go on as they were."""
    wide = ScenarioDistribution(components=components).draw(np.random.default_rng(2))
    commands = np.zeros((20, 2))
    together = histories([Scenario.paper(), wide], commands)
    np.testing.assert_array_equal(together[:, 0], histories([Scenario.paper()], commands[:, :1])[:, 0])
    exact = wide.motion.components().at(1e-1 * np.arange(1, 21))  # type: ignore[union-attr]
    after = np.arange(1, 21) * 0.1 >= wide.ramp
    assert not after.any()
    factor = np.arange(1, 21) * 0.1 / wide.ramp
    factor = factor**3 * (10 - 15 * factor + 6 * factor**2)
    knots = np.arange(3, 20, 4)
    np.testing.assert_array_equal(together[knots, 1, at.NODE_STEP], knots + 1)
    got, want = together[knots, 1, at.NODE : at.NODE + 6], (factor[:, None] * exact[0])[knots]
    np.testing.assert_allclose(got, want, atol=1e-12)
