"""Policies by name, by folder, or as anybody's ``module:function``: what the comparison can be asked for.

A new kind of policy joins by one entry in ``CATALOGUE``, one that lives in a folder by one entry in ``FOLDERS``.
"""

from __future__ import annotations

import importlib
import inspect
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from aframe_env import task
from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue
from agents import drive_map, learned
from agents.control.feedback import SensorFeedback, StateFeedback
from agents.control.inverse_dynamics import InverseDynamics
from agents.control.predictive import PredictiveControl
from agents.drive_map_policy import DriveMapPolicy
from agents.drive_policy import DrivePolicy
from agents.optimisation import OptimisedDrive
from agents.policy import DrumStill, FloatArray, Knowledge, Policy
from agents.tuned_drives import TUNED, Tuned, optimised

Item = TypeVar("Item")
Result = TypeVar("Result")


class Spread(Protocol):
    """Calls a picklable function on every item, perhaps in parallel; the results are in the items' order."""

    def __call__(self, function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
        """Return ``[function(item) for item in items]``."""
        ...


def in_turn(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """One item after the other."""
    return [function(item) for item in items]


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What a policy is built for."""

    scenarios: Sequence[Scenario]
    """That it will run in. Only a policy that knows the future may look at their seas."""
    nominal: Scenario
    """That a policy which knows no more than the clock may be tuned for."""
    episode_duration: float
    """s."""
    observation: task.Observation
    spread: Spread = in_turn
    """For policies that take many independent computations to build."""


@dataclass(frozen=True)
class Choice:
    """A policy to compare: its name, and how it is built."""

    name: str
    build: Callable[[Setting], Policy]
    for_each_scenario: bool = False
    """Whether building it takes an optimisation for each scenario: it then runs in the first few of them only."""


def _drum_still(setting: Setting) -> Policy:
    return DrumStill()


def _optimised(setting: Setting, scenarios: Sequence[Scenario], tuned: Tuned) -> list[OptimisedDrive]:
    return setting.spread(partial(optimised, tuned, setting.episode_duration), scenarios)


def _nominal_drive(name: str, tuned: Tuned) -> Choice:
    def build(setting: Setting) -> Policy:
        drives = _optimised(setting, [setting.nominal], tuned)
        return DrivePolicy(name=name, drives=drives * len(setting.scenarios))

    return Choice(name, build)


def _drive_for_each(name: str, tuned: Tuned) -> Choice:
    def build(setting: Setting) -> Policy:
        drives = _optimised(setting, setting.scenarios, tuned)
        return DrivePolicy(name=name, drives=drives, knows=Knowledge.FUTURE)

    return Choice(name, build, for_each_scenario=True)


def _law(make: Callable[[], Policy]) -> Choice:
    return Choice(make().name, lambda setting: make())


DRUM_STILL: Final = Choice("drum still", _drum_still)
CATALOGUE: Final[dict[str, Choice]] = {
    choice.name: choice
    for choice in (
        DRUM_STILL,
        *(_nominal_drive(name, how) for name, how in TUNED.items()),
        *(_law(make) for make in (StateFeedback, SensorFeedback, PredictiveControl, InverseDynamics)),
        *(_drive_for_each(f"{name} for each scenario", how) for name, how in TUNED.items()),
    )
}
"""Policies by name."""

FOLDERS: Final[dict[str, Callable[[Path], Policy]]] = {
    learned.CARD: learned.load,
    drive_map.CARD: lambda folder: DriveMapPolicy(drive_map.load(folder)),
}
"""What loads a policy from a folder, by the file that the folder must have."""


def slug(name: str) -> str:
    """A name as it can be typed on any keyboard: "S-Ω1 for each scenario" is "s-omega1-for-each-scenario"."""
    return name.strip().lower().replace("ω", "omega").replace(" ", "-")


def choose(text: str) -> Choice:
    """A policy from its name in the catalogue (or the name's slug), its folder, or ``module:function``."""
    by_slug = {slug(name): choice for name, choice in CATALOGUE.items()}
    if slug(text) in by_slug:
        return by_slug[slug(text)]
    if Path(text).is_dir():
        return as_choice(_from_folder(Path(text)))
    module, colon, attribute = text.partition(":")
    if colon and module.replace(".", "").isidentifier() and attribute.isidentifier():
        return _from_module(text, module, attribute)
    raise InvalidValue(
        f"policy = {text!r}: must be one of {', '.join(repr(name) for name in CATALOGUE)}, "
        "the folder of an agent, or module:function"
    )


def choose_all(texts: Sequence[str]) -> list[Choice]:
    """Policies from their names, folders or functions; a folder of agents of several seeds stands for all of them.

    Policies of one name are told apart by their seeds or else by what was asked for.
    """
    asked = list(dict.fromkeys(each for text in texts for each in _expanded(text)))
    choices = [choose(text) for text in asked]
    for tell in (lambda text: Path(text).name.replace("-", " "), lambda text: text):
        names = [choice.name for choice in choices]
        choices = [
            replace(choice, name=f"{choice.name}, {tell(text)}") if names.count(choice.name) > 1 else choice
            for text, choice in zip(asked, choices, strict=True)
        ]
    return choices


def _expanded(text: str) -> list[str]:
    return [str(path) for path in learned.seeds(text)] or [text]


def as_choice(policy: Policy) -> Choice:
    """A policy that is there already."""
    return Choice(policy.name, lambda setting: policy)


def _from_folder(folder: Path) -> Policy:
    for file, load_it in FOLDERS.items():
        if (folder / file).is_file():
            return load_it(folder)
    if learned.seeds(folder):
        return learned.load(folder)
    raise InvalidValue(f"policy = {str(folder)!r}: no agent in this folder: it has none of {', '.join(FOLDERS)}")


@dataclass
class FunctionPolicy:
    """A function of the observations (N, K), and perhaps of the time, as a policy."""

    name: str
    function: Callable[..., Any]
    knows: Knowledge
    takes_time: bool
    rows: int = 0

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes."""
        self.rows = len(scenarios)

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """What the function says, checked: (N,) rad/s."""
        said = self.function(observation, time) if self.takes_time else self.function(observation)
        try:
            speeds = np.asarray(said, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InvalidValue(f"{self.name} gave {type(said).__name__}: must be drum speeds ({self.rows},)") from error
        if speeds.shape == (self.rows, 1):
            speeds = speeds[:, 0]
        if speeds.shape != (self.rows,):
            raise InvalidValue(f"{self.name} gave shape {speeds.shape}: must be ({self.rows},), one speed an episode")
        if not np.isfinite(speeds).all():
            raise InvalidValue(f"{self.name} gave a drum speed that is not finite at t = {time:g} s: must be rad/s")
        return speeds


def _from_module(text: str, module: str, attribute: str) -> Choice:
    """A policy from ``module:attribute``, the current folder included in the search.

    The attribute is a policy, a class or function that makes one when called without arguments, or a function of
    observations (N, K), and time if it takes two arguments, that gives drum speeds (N,) rad/s.
    """
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        found = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise InvalidValue(f"policy = {text!r}: cannot be imported: {error}") from error
    finally:
        sys.path.remove(here)
    if isinstance(found, type) or not _is_policy(found):
        if not callable(found):
            raise InvalidValue(f"policy = {text!r}: is a {type(found).__name__}, must be a policy or callable")
        needed = _required_arguments(found)
        if needed > 2:
            raise InvalidValue(f"policy = {text!r}: takes {needed} arguments, must take (observation) or (…, time)")
        if needed > 0 and not isinstance(found, type):
            return Choice(text, lambda setting: FunctionPolicy(text, found, _seen(setting), takes_time=needed == 2))
        found = found()
        if not _is_policy(found):
            raise InvalidValue(
                f"policy = {text!r}: made a {type(found).__name__}, must be a policy with name, knows, reset and act"
            )
    return as_choice(found)


def _seen(setting: Setting) -> Knowledge:
    return Knowledge.STATE if setting.observation == "state" else Knowledge.SENSORS


def _is_policy(thing: Any) -> bool:
    return all(hasattr(thing, name) for name in ("name", "knows", "reset", "act"))


def _required_arguments(function: Callable[..., Any]) -> int:
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    return sum(p.kind in kinds and p.default is inspect.Parameter.empty for p in parameters)
