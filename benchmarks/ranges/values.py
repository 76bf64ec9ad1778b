"""Cranes, motions, scenarios and tasks from all over the documented ranges, as Hypothesis strategies.

A range is what the package's own refusal says it is, so that none is written down twice.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final

from hypothesis import assume
from hypothesis import strategies as st

from aframe_env import (
    Compensator,
    Crane,
    InvalidValue,
    LoadShape,
    Luffing,
    Scenario,
    ScenarioDistribution,
    Seabed,
    Sensors,
    TargetPath,
    Told,
    TorqueDrive,
    Water,
)
from aframe_env.scenario.luffing import STEEPEST
from aframe_env.scenario.motion import COORDINATES, Harmonic, HarmonicMotion, ShipMotion
from aframe_env.scenario.scenario import INITIALS
from aframe_env.scenario.sea import SPECTRA, Sea, SeaMotion
from aframe_env.scenario.sensors import CHANNELS, Channel
from aframe_env.scenario.vessel import Vessel

_RANGE: Final = re.compile(r"must be (0, or )?(?:a number |an integer )?in ([(\[])(\S+), (\S+?)([)\]])")
MOST_CHANGES: Final = 4
"""Most fields of a part that leave their defaults at once."""


@dataclass(frozen=True)
class Interval:
    """A documented range."""

    low: float
    high: float
    integer: bool
    zero: bool
    """Whether 0, for none, is a value beside them."""

    @property
    def values(self) -> st.SearchStrategy[Any]:
        """Its ends, and what lies between, by magnitude where it spans several."""
        if self.integer:
            return st.one_of(st.sampled_from([int(self.low), int(self.high)]), st.integers(int(self.low), self._some))
        ends = st.sampled_from([self.low, self.high, *((0.0,) if self.zero else ())])
        between = st.floats(self.low, self.high)
        if self.low > 0.0 and self.high > 100.0 * self.low:
            between = st.floats(math.log(self.low), math.log(self.high)).map(
                lambda power: min(max(math.exp(power), self.low), self.high)
            )
        return st.one_of(ends, between)

    @property
    def _some(self) -> int:
        """Waves by the thousand cost time and show nothing that some do not."""
        return min(int(self.high), 64)


def interval(make: Callable[..., object], name: str) -> Interval | None:
    """Range of a keyword argument by the words that refuse NaN for it; None for one that is no number."""
    try:
        make(**{name: math.nan})
    except InvalidValue as error:
        found = _RANGE.search(str(error))
        if found is None:
            return None
        zero, left, low, high, right = found.groups()
        # An open end is no value of the range: the nearest float is.
        ends = float(low), float(high)
        return Interval(
            math.nextafter(ends[0], math.inf) if left == "(" else ends[0],
            math.nextafter(ends[1], -math.inf) if right == ")" else ends[1],
            "an integer in" in str(error),
            bool(zero),
        )
    raise AssertionError(f"{name} takes NaN")


def intervals(make: Callable[..., object], names: list[str]) -> dict[str, Interval]:
    """Ranges of those of the arguments that are numbers."""
    found = {name: interval(make, name) for name in names}
    return {name: each for name, each in found.items() if each is not None}


def intervals_of(part: Any) -> dict[str, Interval]:
    """Ranges of the fields of a dataclass that are numbers."""
    names = [each.name for each in fields(part) if each.init and type(getattr(part, each.name)) in (int, float)]
    return intervals(lambda **changes: replace(part, **changes), names)


def changed(part: Any, draw: st.DrawFn, more: Mapping[str, st.SearchStrategy[Any]] | None = None) -> Any:
    """A part with some of its fields anywhere in their ranges, those within its parts too."""
    choices: dict[str, st.SearchStrategy[Any]] = {name: each.values for name, each in intervals_of(part).items()}
    choices |= more or {}
    names = draw(st.lists(st.sampled_from(sorted(choices)), max_size=MOST_CHANGES, unique=True)) if choices else []
    changes = {name: draw(choices[name]) for name in names}
    for each in fields(part):
        value = getattr(part, each.name)
        if each.init and each.name not in changes and dataclasses.is_dataclass(value) and draw(st.booleans()):
            changes[each.name] = changed(value, draw)
    return made(lambda: replace(part, **changes))


def made(make: Callable[[], Any]) -> Any:
    """What is made, unless its parts do not go together, which the package says in a sentence."""
    try:
        return make()
    except InvalidValue:
        assume(False)


@st.composite
def cranes(draw: st.DrawFn) -> Crane:
    """Cranes from all over the ranges."""
    crane: Crane = changed(Crane(), draw)
    if draw(st.booleans()):
        crane = made(lambda: replace(crane, compensator=changed(Compensator(), draw)))
    if draw(st.booleans()):
        crane = made(lambda: replace(crane, winch=replace(crane.winch, drive=changed(TorqueDrive(), draw))))
    return crane


@st.composite
def motions(draw: st.DrawFn) -> ShipMotion:
    """Harmonic motions and seas from all over the ranges."""
    if draw(st.booleans()):
        some = []
        for _ in range(draw(st.integers(0, 3))):
            start = Harmonic(coordinate=draw(st.sampled_from(COORDINATES)), amplitude=0.1, period=8.0)
            some.append(changed(start, draw))
        return HarmonicMotion(harmonics=tuple(some))
    words = {"spectrum": st.sampled_from(SPECTRA), "spreading": st.one_of(st.none(), st.integers(1, 100))}
    sea = changed(Sea(hs=2.0, tp=8.0), draw, words)
    return SeaMotion(sea=sea, vessel=Vessel.supply())


@st.composite
def waters(draw: st.DrawFn) -> dict[str, Any]:
    """Water of any density and current, and what it feels of a load."""
    velocities = st.floats(-5.0, 5.0)
    depths = draw(st.lists(st.integers(0, 5000), max_size=8, unique=True))
    current = tuple((float(depth), draw(velocities), draw(velocities)) for depth in sorted(depths))
    changes = {"current": current, "waves": draw(st.booleans())}
    if draw(st.booleans()):
        changes["seabed"] = changed(Seabed(depth=500.0), draw)
    return {"water": replace(changed(Water(), draw), **changes), "load": changed(LoadShape(), draw)}


@st.composite
def target_paths(draw: st.DrawFn) -> TargetPath:
    """Targets that go up and down."""
    times, changes = draw(st.lists(st.floats(1.0, 60.0), min_size=2, max_size=16, unique=True)), st.floats(-30.0, 30.0)
    corners = [(time, draw(changes) if k else 0.0) for k, time in enumerate(sorted(times))]
    return made(lambda: changed(TargetPath(corners=tuple(corners)), draw))


@st.composite
def luffings(draw: st.DrawFn, start: float) -> Luffing:
    """Swings of a frame from the angle ``start``, rad, slow and fast."""
    times = sorted(draw(st.lists(st.floats(0.0, 60.0), min_size=2, max_size=4, unique=True)))
    angles = [start, *(draw(st.floats(-STEEPEST, STEEPEST)) for _ in times[1:])]
    points = tuple(zip(times, angles, strict=True))
    return made(lambda: Luffing(points=points, max_speed=10.0, max_acceleration=100.0))


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    """Scenarios from all over the ranges."""
    crane, motion = draw(cranes()), draw(motions())
    length = draw(st.one_of(st.just(300.0), st.floats(math.log(1e-2), math.log(1e5)).map(math.exp)))
    start = made(
        lambda: Scenario(
            crane=crane,
            motion=motion,
            load_mass=min(1e5, 0.5 * crane.rope.breaking_load / 9.81),
            target_level=crane.pulley_position[2] - length,
        )
    )
    ranges = intervals_of(start)
    names = [name for name in ranges if draw(st.booleans())]
    changes = {name: draw(ranges[name].values) for name in names if name != "target_level"}
    changes["initial"] = draw(st.sampled_from(INITIALS))
    if draw(st.booleans()):
        changes |= draw(waters())
    if draw(st.booleans()):
        changes["target_path"] = draw(target_paths())
    if draw(st.booleans()):
        changes["luffing"] = draw(luffings(crane.frame.luffing_angle))
    if draw(st.booleans()):
        changes["told"] = Told(load_mass=draw(ranges["load_mass"].values), lag=draw(st.floats(0.0, 1.0)))
    scenario: Scenario = made(lambda: replace(start, **changes))
    return scenario


@st.composite
def distributions(draw: st.DrawFn) -> ScenarioDistribution:
    """Distributions whose intervals lie anywhere in their ranges."""
    numbers = intervals(ScenarioDistribution, [each.name for each in fields(ScenarioDistribution)])
    names = draw(st.lists(st.sampled_from(sorted(numbers)), max_size=MOST_CHANGES, unique=True))
    changes: dict[str, Any] = {}
    for name in names:
        one = draw(numbers[name].values)
        pair = name not in ("ramp", "window", "components") and draw(st.booleans())
        changes[name] = tuple(sorted((one, draw(numbers[name].values)))) if pair else one
    if draw(st.booleans()):
        changes["crane"] = draw(cranes())
    if draw(st.booleans()):
        changes["spreading"] = draw(st.integers(1, 100))
    found: ScenarioDistribution = made(lambda: ScenarioDistribution(**changes))
    return found


@st.composite
def sensors(draw: st.DrawFn) -> Sensors:
    """Sensors with channels from all over the ranges."""
    some = draw(st.lists(st.sampled_from(CHANNELS), max_size=3, unique=True))
    channels: dict[str, Any] = {name: changed(Channel(), draw) for name in some}
    found: Sensors = changed(Sensors(**channels), draw, {"mass_told": st.booleans()})
    return found
