"""Ready loads, against the limits of the recommended practice's formulas."""

from __future__ import annotations

import itertools
import math
from pathlib import Path

import pytest

from aframe_env import LOADS, InvalidValue, Scenario, Water, read_scenario
from aframe_env.scenario.loads import box, perforated, plate_added_mass, with_sides


def test_plate_goes_over_into_the_strip_of_potential_theory() -> None:
    """A long plate of width a: ρ π a²/4 for each metre; a square one 0.579 of that."""
    assert plate_added_mass(2.0, 100.0) == pytest.approx(1025.0 * math.pi * 100.0, rel=0.06)
    assert plate_added_mass(3.0, 3.0) == pytest.approx(0.579 * 1025.0 * 0.25 * math.pi * 27.0)
    assert plate_added_mass(3.0, 5.0) == plate_added_mass(5.0, 3.0)


def test_sides_add_nothing_to_a_thin_plate_and_at_most_seven_tenths() -> None:
    assert with_sides(10.0, 25.0, 1e-6) == pytest.approx(10.0, rel=1e-3)
    assert with_sides(10.0, 25.0, 1e6) == pytest.approx(10.0 * (1.0 + math.sqrt(0.5)), rel=1e-3)


def test_holes_let_the_water_through() -> None:
    left = [perforated(1.0, 0.01 * p) for p in range(91)]
    assert left[:6] == [1.0] * 6
    assert all(b <= a for a, b in itertools.pairwise(left))
    # The two formulas meet at 34 % within the width of a line in the practice's figure.
    assert left[33] - left[34] < 0.03
    assert left[50] == pytest.approx(math.exp(-40.0 / 28.0))


def test_box_by_hand() -> None:
    shape = box(4.0, 4.0, 4.0, 0.0, 5.0)
    # λ = 1/2: 1 + √(0.75 / 2.5).
    assert shape.added_mass_vertical == pytest.approx(0.579 * 1025 * math.pi / 4 * 64 * (1 + math.sqrt(0.3)), rel=1e-12)
    assert shape.added_mass_horizontal == pytest.approx(shape.added_mass_vertical)
    assert (shape.drag_area_vertical, shape.slam_area, shape.height) == (40.0, 80.0, 4.0)
    with pytest.raises(InvalidValue, match=r"perforation = 1\.0"):
        box(4.0, 4.0, 4.0, 1.0, 5.0)


@pytest.mark.parametrize("name", LOADS)
def test_ready_load_hangs_in_air_and_in_water(name: str, tmp_path: Path) -> None:
    ready = LOADS[name]
    for level in (0.0, -200.0):
        scenario = Scenario(load_mass=ready.mass, target_level=level, water=Water(), load=ready.shape)
        assert 0.0 < scenario.weight <= ready.mass * 9.81
    (tmp_path / "lift.toml").write_text(f'load_mass = {ready.mass}\nload = "{name}"\ntarget_level = -200.0\n[water]\n')
    assert read_scenario(tmp_path / "lift.toml").load == ready.shape


def test_unknown_load_is_named(tmp_path: Path) -> None:
    (tmp_path / "lift.toml").write_text('load = "piano"\n[water]\n')
    with pytest.raises(InvalidValue, match="'piano': must be one of 'manifold', 'suction-anchor'"):
        read_scenario(tmp_path / "lift.toml")
