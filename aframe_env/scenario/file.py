"""Scenarios as TOML files.

Every key has the name of the field that it sets; what is not there keeps its default, so that an empty file is the
paper's case on the reference crane. ``[motion]`` has a ``kind``, and ``[crane.frame.structure.leg_section]`` and its
like have one too::

    load_mass = 60e3                # kg
    target_level = -200.0           # m
    ramp = 10.0                     # s

    [crane.winch]
    max_rope_speed = 2.5            # m/s

    [motion]
    kind = "sea"                    # or "harmonic", with [[motion.harmonics]]; or "recorded", with file = "x.csv"
    vessel = "supply"               # or a vessel's CSV file
    [motion.sea]
    hs = 2.5                        # m
    tp = 9.0                        # s

Files that are named within are looked for beside the scenario file.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import tomli_w
from cattrs import Converter

from aframe_env.scenario.cross_sections import (
    GivenSection,
    ISection,
    MemberSection,
    RectangularHollow,
    Section,
    SolidRectangle,
    StressPoint,
    Tube,
)
from aframe_env.scenario.motion import HarmonicMotion, ShipMotion
from aframe_env.scenario.recorded_motion import RecordedMotion
from aframe_env.scenario.scenario import Scenario
from aframe_env.scenario.sea import Sea, SeaMotion
from aframe_env.scenario.vessel import Vessel
from aframe_env.serialization import strict_converter, structure, without_none
from aframe_env.validation import InvalidValue, require_choice

_SECTIONS: Mapping[str, type[Section]] = {
    "box": RectangularHollow,
    "rectangle": SolidRectangle,
    "tube": Tube,
    "i": ISection,
    "given": GivenSection,
}
_MOTIONS = ("harmonic", "sea", "recorded")
_SUPPLY = "supply"


def read_scenario(path: str | Path) -> Scenario:
    """Read a scenario. Raises ``InvalidValue`` that names the file and the key of what is wrong."""
    path = Path(path)
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidValue(f"scenario = {str(path)!r}: cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise InvalidValue(f"{path}: not TOML: {error}") from error
    return scenario_of(data, path.parent, str(path))


def scenario_of(data: Mapping[str, Any], folder: Path, source: str) -> Scenario:
    """Make a scenario of what a file says, looking in ``folder`` for the files that it names.

    Raises ``InvalidValue`` that begins with ``source`` and names the key of what is wrong.
    """
    return structure(_converter(folder), data, Scenario, source)


def scenario_text(scenario: Scenario) -> str:
    """Text of a file that reads back as this very scenario.

    A vessel or a record that was not read from a file cannot be written, and raises ``InvalidValue``.
    """
    return tomli_w.dumps(without_none(_converter(Path()).unstructure(scenario)))


def _converter(folder: Path) -> Converter:
    converter = strict_converter()

    def stress_point(value: Any, _: Any) -> StressPoint:
        return StressPoint(*converter.structure(value, tuple[float, float, float, float, float]))

    def section(value: Any, _: Any) -> Section:
        kind, rest = _kind(value, tuple(_SECTIONS))
        return converter.structure(rest, _SECTIONS[kind])

    def member(value: Any, _: Any) -> MemberSection:
        if isinstance(value, list):
            return converter.structure(value, tuple[Section, ...])
        return section(value, None)

    def motion(value: Any, _: Any) -> ShipMotion:
        kind, rest = _kind(value, _MOTIONS)
        if kind == "harmonic":
            return converter.structure(rest, HarmonicMotion)
        if kind == "recorded":
            return RecordedMotion.from_csv(folder / converter.structure(rest, _Recorded).file)
        return _sea_motion(converter.structure(rest, _SeaMotion), folder)

    converter.register_structure_hook(StressPoint, stress_point)
    converter.register_structure_hook_func(lambda kind: kind == MemberSection, member)
    converter.register_structure_hook_func(lambda kind: kind == Section, section)
    converter.register_structure_hook_func(lambda kind: kind == ShipMotion, motion)
    converter.register_unstructure_hook(SeaMotion, lambda m: _sea_table(m, converter))
    converter.register_unstructure_hook(RecordedMotion, _recorded_table)
    harmonic = converter.get_unstructure_hook(HarmonicMotion)
    converter.register_unstructure_hook(HarmonicMotion, lambda m: {"kind": "harmonic", **harmonic(m)})
    for name, cls in _SECTIONS.items():
        plain = converter.get_unstructure_hook(cls)
        converter.register_unstructure_hook(cls, lambda s, n=name, p=plain: {"kind": n, **p(s)})
    return converter


def _kind(value: Any, kinds: tuple[str, ...]) -> tuple[str, dict[str, Any]]:
    """The kind that a table names, and the rest of the table."""
    if not isinstance(value, dict):
        raise InvalidValue(f"{value!r}: must be a table with a kind, one of {', '.join(kinds)}")
    if "kind" not in value:
        raise InvalidValue(f"key 'kind' is missing: must be one of {', '.join(map(repr, kinds))}")
    require_choice("kind", value["kind"], kinds)
    return value["kind"], {key: item for key, item in value.items() if key != "kind"}


@dataclass(frozen=True)
class _Recorded:
    """``[motion]`` of the kind "recorded"."""

    file: str


@dataclass(frozen=True)
class _SeaMotion:
    """``[motion]`` of the kind "sea"."""

    sea: Sea
    vessel: str = _SUPPLY
    deck_position: tuple[float, float, float] | None = None


def _sea_motion(table: _SeaMotion, folder: Path) -> SeaMotion:
    vessel = Vessel.supply() if table.vessel == _SUPPLY else Vessel.from_csv(folder / table.vessel)
    if table.deck_position not in (None, vessel.deck_position):
        vessel = replace(vessel, deck_position=table.deck_position)
    return SeaMotion(sea=table.sea, vessel=vessel)


def _sea_table(motion: SeaMotion, converter: Converter) -> dict[str, Any]:
    vessel = motion.vessel
    if vessel.path is None:
        raise InvalidValue(f"vessel {vessel.name!r} was not read from a file: a scenario file cannot name it")
    name = _SUPPLY if vessel.path == Vessel.supply().path else str(vessel.path.resolve())
    return {
        "kind": "sea",
        "vessel": name,
        "deck_position": list(vessel.deck_position),
        "sea": converter.unstructure(motion.sea),
    }


def _recorded_table(motion: RecordedMotion) -> dict[str, Any]:
    if motion.path is None:
        raise InvalidValue("the recorded motion was not read from a file: a scenario file cannot name it")
    return {"kind": "recorded", "file": str(motion.path.resolve())}
