"""The page on scenario files says what the reader of them does."""

from __future__ import annotations

import math
import re
import tomllib
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aframe_env import (
    Channel,
    Compensator,
    Crane,
    Frame,
    Harmonic,
    LoadShape,
    MotionUnit,
    Preview,
    RecordedMotion,
    Rope,
    Scenario,
    ScenarioDistribution,
    Sea,
    Seabed,
    Sensors,
    TargetPath,
    Told,
    TorqueDrive,
    Vessel,
    Water,
    Winch,
    read_scenarios,
)
from aframe_env.scenario.cross_sections import FrameStructure, Material, Servomotor
from aframe_env.scenario.file import _SECTIONS, _Distribution, _Luffing, _Recorded, _SeaMotion

PAGE = (Path(__file__).parents[2] / "docs" / "scenario-files.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", PAGE, flags=re.DOTALL)
TABLES = {
    Scenario: "## Top level",
    Harmonic: '### `kind = "harmonic"`',
    _SeaMotion: '### `kind = "sea"`',
    Sea: "`[motion.sea]`:",
    _Recorded: '### `kind = "recorded"`',
    _Distribution: "## Distributions",
    Sensors: "`[sensors]`:",
    Preview: "`[sensors.preview]`:",
    MotionUnit: "`[sensors.motion_unit]`:",
    Channel: "Each channel is a table",
    Crane: "## `[crane]`",
    Rope: "`[crane.rope]`:",
    Winch: "`[crane.winch]`:",
    Frame: "`[crane.frame]`:",
    FrameStructure: "### `[crane.frame.structure]`",
    Material: "`[crane.frame.structure.material]`:",
    Servomotor: "`[crane.frame.structure.servomotor]`:",
    TargetPath: "## `[target_path]`",
    Told: "## `[told]`",
    _Luffing: "## `[luffing]`",
    Water: "## `[water]`",
    Seabed: "`[water.seabed]`:",
    TorqueDrive: "`[crane.winch.drive]`:",
    Compensator: "`[crane.compensator]`:",
    LoadShape: "`[load]`:",
}
ELSEWHERE = {"crane", "motion", "water", "load", "target_path", "told", "luffing"}
"""Keys of a scenario that have sections of their own."""


def rows(heading: str) -> dict[str, str]:
    """Keys of the first table after a heading, and their defaults."""
    after = PAGE.split(f"\n{heading}", 1)[1]
    lines = after[after.index("| key ") :].split("\n\n", 1)[0].splitlines()[2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {line[0].strip("`"): line[1] for line in cells}


def default_of(item: Any) -> Any:
    return item.default if item.default_factory is MISSING else item.default_factory()


@pytest.mark.parametrize("kind", TABLES)
def test_every_key_is_there_with_its_default(kind: type) -> None:
    documented = rows(TABLES[kind])
    known = {item.name: default_of(item) for item in fields(kind)}  # type: ignore[arg-type]
    assert set(documented) == set(known) - (ELSEWHERE if kind is Scenario else set())
    for name, text in documented.items():
        default = known[name]
        if default is MISSING or is_dataclass(default):
            assert text in ("", "the reference crane's", "the package's")
        elif default is None:
            assert text in ("none", "the vessel's")
        else:
            value = tomllib.loads(f"x = {text}")["x"]
            assert value == (default if isinstance(default, str) else pytest.approx(default, rel=1e-5))


def test_every_section_is_there_with_its_keys() -> None:
    for name, kind in _SECTIONS.items():
        (line,) = re.findall(rf'^\| "{name}" \| (.*) \|$', PAGE, flags=re.MULTILINE)
        assert set(re.findall(r"`(\w+)`", line)) == {item.name for item in fields(kind)}


def test_the_examples_are_read(tmp_path: Path) -> None:
    examples = [text for language, text in BLOCKS if language == "toml"]
    assert len(examples) >= 3
    for text in examples:
        (tmp_path / "example.toml").write_text(text, encoding="utf-8")
        source = read_scenarios(tmp_path / "example.toml")
        assert source not in (Scenario.paper(), ScenarioDistribution())


def test_the_csv_examples_are_read(tmp_path: Path) -> None:
    record, response = (text.splitlines() for language, text in BLOCKS if language == "csv")
    # Two samples are no record: they go on in the same manner, evenly.
    cells = np.array([[float(cell) for cell in line.split(",")] for line in record[-2:]])
    more = [",".join(f"{cell:.9g}" for cell in cells[0] + k * (cells[1] - cells[0])) for k in range(2, 14)]
    (tmp_path / "record.csv").write_text("\n".join([*record, *more]))
    assert RecordedMotion.from_csv(tmp_path / "record.csv").duration == 6.5
    # One frequency in two headings is no ship: the rest is the package's own, which is like it.
    supply = Vessel.supply()
    path = supply.path
    assert path is not None
    rows_of_supply = [line for line in path.read_text(encoding="utf-8").splitlines() if line[0].isdigit()]
    kept = [line for line in rows_of_supply if line.split(",")[1] in ("0", "45", "90", "135", "180")]
    given = {tuple(map(float, line.split(",")[:2])) for line in response[-2:]}
    others = [line for line in kept if tuple(map(float, line.split(",")[:2])) not in given]
    (tmp_path / "ship.csv").write_text("\n".join([*response, *others]))
    vessel = Vessel.from_csv(tmp_path / "ship.csv")
    assert vessel.name == "my ship"
    wave = 0.1**2 / 9.81
    for row in range(2):
        c, s = math.cos(vessel.headings[row]), math.sin(vessel.headings[row])
        np.testing.assert_allclose(vessel.response[0, row, :3], [-1j * c, -1j * s, 1.0], atol=0.02)
        np.testing.assert_allclose(vessel.response[0, row, 3:5] / wave, [-1j * s, 1j * c], atol=0.03)
