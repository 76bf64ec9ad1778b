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

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import tomli_w
from cattrs import Converter

from aframe_env.scenario.crane import Crane
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
from aframe_env.scenario.distribution import ScenarioDistribution, ScenarioSource
from aframe_env.scenario.interval import Range
from aframe_env.scenario.loads import ready_load
from aframe_env.scenario.luffing import Luffing
from aframe_env.scenario.motion import HarmonicMotion, ShipMotion
from aframe_env.scenario.recorded_motion import RecordedMotion, RecordedWindow
from aframe_env.scenario.scenario import Scenario
from aframe_env.scenario.sea import Sea, SeaMotion
from aframe_env.scenario.sensors import Sensors
from aframe_env.scenario.target import TargetPath
from aframe_env.scenario.told import Told
from aframe_env.scenario.vessel import Vessel
from aframe_env.scenario.water import LoadShape, Water
from aframe_env.serialization import plain, strict_converter, structure
from aframe_env.text import read_toml
from aframe_env.validation import InvalidValue, require_choice, shown

_SECTIONS: Mapping[str, type[Section]] = {
    "box": RectangularHollow,
    "rectangle": SolidRectangle,
    "tube": Tube,
    "i": ISection,
    "given": GivenSection,
}
_KINDS = ("scenario", "distribution")
_MOTIONS = ("harmonic", "sea", "recorded")
_SUPPLY = "supply"


def read_scenario(path: str | Path) -> Scenario:
    """Read a scenario. Raises ``InvalidValue`` that names the file and the key of what is wrong."""
    source = read_scenarios(path)
    if not isinstance(source, Scenario):
        raise InvalidValue(f"{path}: a distribution of scenarios: must be one scenario")
    return source


def read_scenarios(path: str | Path) -> ScenarioSource:
    """Read a scenario or a distribution. Raises ``InvalidValue`` that names the file and the key of what is wrong."""
    path = Path(path)
    return scenarios_of(read_toml(path, "scenario"), path.parent, str(path))


def scenario_of(data: Mapping[str, Any], folder: Path, source: str) -> Scenario:
    """Make a scenario of what a file says, looking in ``folder`` for the files that it names.

    Raises ``InvalidValue`` that begins with ``source`` and names the key of what is wrong.
    """
    return structure(_converter(folder), data, Scenario, source)


def _require_kind(data: Mapping[str, Any], source: str) -> None:
    """Raise where what looks like a distribution does not say that it is one."""
    own = {each.name for each in fields(_Distribution)} - {each.name for each in fields(Scenario)}
    found = sorted(own & set(data))
    if found:
        raise InvalidValue(
            f'{source}: {found[0]!r} belongs to a distribution: begin the file with kind = "distribution"'
        )


def scenarios_of(data: Mapping[str, Any], folder: Path, source: str) -> ScenarioSource:
    """Make a scenario of what a file says, or with ``kind = "distribution"`` a distribution."""
    rest = dict(data)
    kind = rest.pop("kind", "scenario")
    try:
        require_choice("kind", kind, _KINDS)
    except InvalidValue as error:
        raise InvalidValue(f"{source}: {error}") from None
    if kind == "scenario":
        if "kind" not in data:
            _require_kind(data, source)
        return scenario_of(rest, folder, source)
    return _distribution(structure(_converter(folder), rest, _Distribution, source), folder, source)


def scenario_source(given: ScenarioSource | str | Path | Mapping[str, Any] | None) -> ScenarioSource:
    """Return what scenarios come from: as given, read from a file, or made of what a file would say.

    In a mapping, tuples may stand for lists, and paths and NumPy's numbers are taken for what they say.
    None stands for the default distribution.
    """
    if given is None:
        return ScenarioDistribution()
    if isinstance(given, Scenario | ScenarioDistribution):
        return given
    if isinstance(given, str | Path):
        return read_scenarios(given)
    if isinstance(given, Mapping):
        return scenarios_of(plain(given), Path(), "scenario")
    raise InvalidValue(f"scenario = {shown(given)}: must be a Scenario, a ScenarioDistribution, a file or a mapping")


def scenario_text(source: ScenarioSource) -> str:
    """Text of a file that reads back as this very scenario or distribution.

    A vessel or a record that was not read from a file cannot be written, and raises ``InvalidValue``.
    """
    return tomli_w.dumps(scenario_data(source))


def scenario_data(source: ScenarioSource) -> dict[str, Any]:
    """What that file says, as plain data of TOML or JSON; raises as ``scenario_text`` does."""
    converter = _converter(Path())
    if isinstance(source, Scenario):
        return dict(plain(converter.unstructure(source)))
    table = {each.name: getattr(source, each.name) for each in fields(source)}
    table["vessel"], table["deck_position"] = _vessel_name(source.vessel), list(source.vessel.deck_position)
    table["records"] = [_record_file(record) for record in source.records]
    data = {name: converter.unstructure(value) for name, value in table.items()}
    return dict(plain({"kind": "distribution", **data}))


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
            return _recorded(converter.structure(rest, _Recorded), folder)
        table = converter.structure(rest, _SeaMotion)
        return SeaMotion(sea=table.sea, vessel=_vessel(table.vessel, table.deck_position, folder))

    interval: Callable[[Any, Any], Range] = converter.get_structure_hook(Range)

    def interval_or_none(value: Any, _: Any) -> Range | None:
        return None if value is None else interval(value, None)

    def peak_enhancement(value: Any, _: Any) -> Range | str:
        return value if isinstance(value, str) else interval(value, None)

    def luffing(value: Any, _: Any) -> Luffing:
        return converter.structure(value, _Luffing).way()

    shape = converter.get_structure_hook(LoadShape)

    def load(value: Any, kind: Any) -> LoadShape:
        return ready_load(value).shape if isinstance(value, str) else shape(value, kind)

    converter.register_structure_hook(LoadShape, load)
    converter.register_structure_hook(Luffing, luffing)
    way = converter.get_unstructure_hook(Luffing)
    # Radians, since not every angle has a number of degrees that reads back as the same.
    converter.register_unstructure_hook(Luffing, lambda each: {"degrees": False, **way(each)})
    converter.register_structure_hook(StressPoint, stress_point)
    converter.register_structure_hook_func(lambda kind: kind == MemberSection, member)
    converter.register_structure_hook_func(lambda kind: kind == Section, section)
    converter.register_structure_hook_func(lambda kind: kind == ShipMotion, motion)
    converter.register_unstructure_hook(SeaMotion, lambda m: _sea_table(m, converter))
    converter.register_structure_hook_func(lambda kind: kind == Range | None, interval_or_none)
    converter.register_structure_hook_func(lambda kind: kind == Range | str, peak_enhancement)
    converter.register_unstructure_hook(RecordedMotion, _recorded_table)
    converter.register_unstructure_hook(RecordedWindow, lambda m: _recorded_table(m.record, m.start, m.duration))
    harmonic = converter.get_unstructure_hook(HarmonicMotion)
    converter.register_unstructure_hook(HarmonicMotion, lambda m: {"kind": "harmonic", **harmonic(m)})
    for name, cls in _SECTIONS.items():
        section_data = converter.get_unstructure_hook(cls)
        converter.register_unstructure_hook(cls, lambda s, n=name, data=section_data: {"kind": n, **data(s)})
    return converter


def _kind(value: Any, kinds: tuple[str, ...]) -> tuple[str, dict[str, Any]]:
    """The kind that a table names, and the rest of the table."""
    if not isinstance(value, dict):
        raise InvalidValue(f"{shown(value)}: must be a table with a kind, one of {', '.join(kinds)}")
    if "kind" not in value:
        raise InvalidValue(f"key 'kind' is missing: must be one of {', '.join(map(repr, kinds))}")
    require_choice("kind", value["kind"], kinds)
    return value["kind"], {key: item for key, item in value.items() if key != "kind"}


@dataclass(frozen=True)
class _Recorded:
    """``[motion]`` of the kind "recorded": a file, and which stretch of it."""

    file: str
    start: float = 0.0
    """s from the first sample."""
    duration: float | None = None
    """s; None: to the end."""


@dataclass(frozen=True)
class _SeaMotion:
    """``[motion]`` of the kind "sea"."""

    sea: Sea
    vessel: str = _SUPPLY
    deck_position: tuple[float, float, float] | None = None


@dataclass(frozen=True, kw_only=True)
class _Luffing:
    """``[luffing]``: ``Luffing`` with its angles in degrees."""

    points: tuple[tuple[float, float], ...]
    degrees: bool = True
    """False: the angles are in rad."""
    max_speed: float = Luffing.max_speed
    max_acceleration: float = Luffing.max_acceleration

    def way(self) -> Luffing:
        """The way that the table says."""
        points = tuple((time, math.radians(angle) if self.degrees else angle) for time, angle in self.points)
        return Luffing(points=points, max_speed=self.max_speed, max_acceleration=self.max_acceleration)


def _recorded(table: _Recorded, folder: Path) -> RecordedMotion | RecordedWindow:
    record = RecordedMotion.from_csv(folder / table.file)
    if table.start == 0.0 and table.duration is None:
        return record
    duration = record.duration - table.start if table.duration is None else table.duration
    return RecordedWindow(record=record, start=table.start, duration=duration)


@dataclass(frozen=True, kw_only=True)
class _Distribution:
    """A file of the kind "distribution": ``ScenarioDistribution``, with files for vessel and records."""

    hs: Range = ScenarioDistribution.hs
    tp: Range = ScenarioDistribution.tp
    heading: Range = ScenarioDistribution.heading
    gamma: Range | str = ScenarioDistribution.gamma
    spectrum: str = ScenarioDistribution.spectrum
    spreading: int | None = ScenarioDistribution.spreading
    components: int = ScenarioDistribution.components
    vessel: str = _SUPPLY
    deck_position: tuple[float, float, float] | None = None
    load_mass: Range = ScenarioDistribution.load_mass
    rope_length: Range = ScenarioDistribution.rope_length
    rope_damping_ratio: Range = ScenarioDistribution.rope_damping_ratio
    ramp: float = ScenarioDistribution.ramp
    crane: Crane = field(default_factory=Crane)
    sensors: Sensors = field(default_factory=Sensors)
    records: tuple[str, ...] = ()
    window: float = ScenarioDistribution.window
    water: Water | None = None
    load: LoadShape = field(default_factory=LoadShape)
    added_mass_factor: Range = ScenarioDistribution.added_mass_factor
    drag_factor: Range = ScenarioDistribution.drag_factor
    current_factor: Range = ScenarioDistribution.current_factor
    current_turn: Range = ScenarioDistribution.current_turn
    target_path: TargetPath | None = None
    axial_stiffness: Range | None = None
    max_rope_speed: Range | None = None
    max_rope_acceleration: Range | None = None
    lag: Range | None = None
    sensor_delay: Range | None = None
    told: Told | None = None
    told_mass_error: float = ScenarioDistribution.told_mass_error
    told_stiffness_error: float = ScenarioDistribution.told_stiffness_error
    told_added_mass_error: float = ScenarioDistribution.told_added_mass_error
    told_drag_error: float = ScenarioDistribution.told_drag_error


def _distribution(table: _Distribution, folder: Path, source: str) -> ScenarioDistribution:
    values = {each.name: getattr(table, each.name) for each in fields(table) if each.name != "deck_position"}
    try:
        values["vessel"] = _vessel(table.vessel, table.deck_position, folder)
        values["records"] = tuple(RecordedMotion.from_csv(folder / file) for file in table.records)
        return ScenarioDistribution(**values)
    except InvalidValue as error:
        raise InvalidValue(f"{source}: {error}") from error


def _vessel(name: str, deck_position: tuple[float, float, float] | None, folder: Path) -> Vessel:
    vessel = Vessel.supply() if name == _SUPPLY else Vessel.from_csv(folder / name)
    if deck_position not in (None, vessel.deck_position):
        vessel = replace(vessel, deck_position=deck_position)
    return vessel


def _vessel_name(vessel: Vessel) -> str:
    if vessel.path is None:
        raise InvalidValue(f"vessel {vessel.name!r} was not read from a file: a scenario file cannot name it")
    return _SUPPLY if vessel.path == Vessel.supply().path else str(vessel.path.resolve())


def _record_file(record: RecordedMotion) -> str:
    if record.path is None:
        raise InvalidValue("the recorded motion was not read from a file: a scenario file cannot name it")
    return str(record.path.resolve())


def _sea_table(motion: SeaMotion, converter: Converter) -> dict[str, Any]:
    return {
        "kind": "sea",
        "vessel": _vessel_name(motion.vessel),
        "deck_position": list(motion.vessel.deck_position),
        "sea": converter.unstructure(motion.sea),
    }


def _recorded_table(record: RecordedMotion, start: float = 0.0, duration: float | None = None) -> dict[str, Any]:
    table: dict[str, Any] = {"kind": "recorded", "file": _record_file(record)}
    return table if duration is None else {**table, "start": start, "duration": duration}
