"""A target that moves, against its own definition and against quadrature."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aframe_env import Crane, HarmonicMotion, InvalidValue, Rope, Scenario, Seabed, TargetPath, Water, read_scenario
from aframe_env.dynamics import layout as at
from aframe_env.engine import Engine

PATH = TargetPath(corners=((5.0, 0.0), (15.0, -8.0), (20.0, -8.0), (24.0, -6.0)), corner_time=1.5)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.0, 40.0))
def test_path_is_its_straight_lines_averaged_over_the_corner_time(time: float) -> None:
    times, changes = zip(*PATH.corners, strict=True)
    around = np.linspace(time - 0.75, time + 0.75, 20001)
    change, rate = PATH.at(time)
    assert change == pytest.approx(np.trapezoid(np.interp(around, times, changes), around) / 1.5, abs=1e-6)
    assert rate == pytest.approx((PATH.at(time + 1e-6)[0] - PATH.at(time - 1e-6)[0]) / 2e-6, abs=1e-6)


def test_engine_follows_path_and_charges_the_way_from_it() -> None:
    scenario = Scenario(motion=HarmonicMotion(), load_mass=50e3, target_level=-200.0, target_path=PATH)
    engine = Engine(2, 0.1)
    engine.reset_row(0, scenario)
    engine.reset_row(1, Scenario(motion=HarmonicMotion(), target_level=-250.0))
    found = []
    for _ in range(300):
        engine.step(np.zeros(2))
        found.append([engine.read(slot)[0] for slot in (at.TARGET, at.TARGET_RATE)])
        assert engine.read(at.TARGET)[1] == -250.0
    expected = np.array([PATH.at(0.1 * k) for k in range(1, 301)])
    assert np.array(found)[:, 0] == pytest.approx(-200.0 + expected[:, 0], abs=1e-12)
    assert np.array(found)[:, 1] == pytest.approx(expected[:, 1], abs=1e-12)
    times = np.linspace(0.0, 30.0, 30001)
    away = np.array([PATH.at(t)[0] for t in times])
    assert engine.read(at.OMEGA1)[0] == pytest.approx(np.trapezoid(away**2, times), rel=1e-6)
    assert engine.read(at.OMEGA2)[0] == pytest.approx(8.0, abs=1e-6)


def test_path_comes_from_a_table(tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("# a way down\ntime_s,change_m\n5,0\n15,-8\n20,-8\n24,-6\n")
    assert TargetPath.from_csv(tmp_path / "way.csv", corner_time=1.5) == PATH
    (tmp_path / "way.csv").write_text("time_s,change_m\n5,0\n15,deep\n")
    with pytest.raises(InvalidValue, match=r"way\.csv, line 3"):
        TargetPath.from_csv(tmp_path / "way.csv")


def test_path_stands_in_a_scenario_file(tmp_path: Path) -> None:
    (tmp_path / "lift.toml").write_text(
        "load_mass = 50e3\ntarget_level = -200.0\n[target_path]\ncorner_time = 1.5\n"
        "corners = [[5, 0], [15, -8], [20, -8], [24, -6]]\n"
    )
    assert read_scenario(tmp_path / "lift.toml").target_path == PATH


def test_lowering_ends_where_it_shall() -> None:
    path = TargetPath.lowering(-30.0, 0.5)
    assert path.duration == pytest.approx(71.0)
    assert path.at(path.duration)[0] == pytest.approx(-30.0, abs=1e-12)
    assert path.at(40.0)[1] == pytest.approx(-0.5)


@pytest.mark.parametrize(
    ("corners", "message"),
    [
        (((5.0, 0.0),), "2 to 16 corners"),
        (((5.0, 1.0), (6.0, 2.0)), "must be 0 m"),
        (((5.0, 0.0), (4.0, 2.0)), r"corners\[1\] time = 4.0"),
        (((0.1, 0.0), (4.0, 2.0)), r"corners\[0\] time = 0.1"),
        (((5.0, 0.0), (6.0, 50.0)), "50 m/s: must be at most 10 m/s"),
        (((5.0, 0.0), (6.0, math.nan)), r"corners\[1\]\[1\] = nan"),
    ],
)
def test_path_says_what_is_wrong(corners: tuple[tuple[float, float], ...], message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        TargetPath(corners=corners)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"target_path": TargetPath.lowering(300.0, 1.0)}, "must be below the pulley"),
        ({"target_path": TargetPath.lowering(-3000.0, 2.0)}, "the winch's limits"),
        ({"target_path": TargetPath.lowering(-30.0, 2.0), "water": Water(seabed=Seabed(depth=220.0))}, "the seabed"),
        ({"water": Water(seabed=Seabed(depth=100.0))}, "target_level = -200.0 m"),
        ({"target_path": (1, 2)}, "target_path = "),
    ],
)
def test_scenario_says_where_its_target_cannot_go(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        Scenario(target_level=-200.0, **changes)  # type: ignore[arg-type]


def test_rope_of_a_path_may_be_too_heavy_further_down() -> None:
    with pytest.raises(InvalidValue, match="at which the rope parts"):
        Scenario(
            crane=Crane(rope=Rope.six_strand(breaking_load=4.5e5)),
            load_mass=30e3,
            target_level=-200.0,
            water=Water(),
            target_path=TargetPath.lowering(-1500.0, 2.0),
        )
