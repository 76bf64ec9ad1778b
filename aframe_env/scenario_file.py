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
from dataclasses import replace
from pathlib import Path
from typing import Any

import tomli_w
from cattrs import Converter

from aframe_env.motion import HarmonicMotion, ShipMotion
from aframe_env.record import RecordedMotion
from aframe_env.scenario import Scenario
from aframe_env.sea import Sea, SeaMotion
from aframe_env.section import (
    GivenSection,
    ISection,
    MemberSection,
    RectangularHollow,
    Section,
    SolidRectangle,
    StressPoint,
    Tube,
)
from aframe_env.structuring import strict_converter, structure, without_none
from aframe_env.validation import InvalidValue, require_choice
from aframe_env.vessel import Vessel

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
            return tuple(section(item, None) for item in value)
        return section(value, None)

    def motion(value: Any, _: Any) -> ShipMotion:
        kind, rest = _kind(value, _MOTIONS)
        if kind == "harmonic":
            return converter.structure(rest, HarmonicMotion)
        return _recorded(rest, folder) if kind == "recorded" else _sea_motion(rest, folder, converter)

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
    require_choice("kind", value.get("kind"), kinds)
    return value["kind"], {key: item for key, item in value.items() if key != "kind"}


def _keys(table: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key in table:
        if key not in known:
            raise InvalidValue(f"unknown key {key!r}: must be one of kind, {', '.join(known)}")


def _recorded(table: Mapping[str, Any], folder: Path) -> RecordedMotion:
    _keys(table, ("file",))
    if not isinstance(table.get("file"), str):
        raise InvalidValue(f"file = {table.get('file')!r}: must be the name of a CSV file")
    return RecordedMotion.from_csv(folder / table["file"])


def _sea_motion(table: Mapping[str, Any], folder: Path, converter: Converter) -> SeaMotion:
    _keys(table, ("sea", "vessel", "deck_position"))
    if "sea" not in table:
        raise InvalidValue("key 'sea' is missing: a table with at least hs and tp")
    name = table.get("vessel", _SUPPLY)
    if not isinstance(name, str):
        raise InvalidValue(f"vessel = {name!r}: must be {_SUPPLY!r} or the name of a CSV file")
    vessel = Vessel.supply() if name == _SUPPLY else Vessel.from_csv(folder / name)
    deck = converter.structure(table.get("deck_position", vessel.deck_position), tuple[float, float, float])
    if deck != vessel.deck_position:
        vessel = replace(vessel, deck_position=deck)
    return SeaMotion(sea=converter.structure(table["sea"], Sea), vessel=vessel)


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
