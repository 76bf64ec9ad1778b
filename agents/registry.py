"""Policies by name, by folder, or as anybody's ``module:function``, for the comparison.

A new kind of policy joins by one entry in ``REGISTRY``, one that lives in a folder by one entry in ``FOLDERS``.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, Literal, Protocol

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario, Sensors
from aframe_env.validation import InvalidValue
from agents import shipped
from agents.control.expected_waves import ExpectedWaves
from agents.control.feedback import Feedback
from agents.control.inverse_dynamics import InverseDynamics
from agents.control.lowering import BLIND, Following, moves
from agents.control.optimum import CommandSequence, optimise
from agents.control.predictive import PlanningConfig, PredictiveControl
from agents.control.set_down import SettingDown, lands
from agents.drives import map as drive_map
from agents.drives.map_policy import DriveMapPolicy
from agents.drives.optimisation import OptimisedDrive, Optimiser
from agents.drives.policy import DrivePolicy
from agents.drives.realtime_map import RealTimeMapPolicy
from agents.drives.tuned import TUNED, Tuned, optimised, optimised_as_played
from agents.imported import FunctionPolicy, Imported
from agents.learned import agent as learned
from agents.learned import recurrent
from agents.learned.features import FeatureConfig
from agents.learned.foretelling import ForetellingControl
from agents.policy import DrumStill, Knowledge, Policy


class Spread(Protocol):
    """Map of a picklable search for a drive over scenarios, perhaps in parallel; the results are in their order."""

    def __call__(
        self, search: Callable[[Scenario], OptimisedDrive], scenarios: Sequence[Scenario]
    ) -> list[OptimisedDrive]:
        """Return ``[search(scenario) for scenario in scenarios]``."""
        ...


def in_turn(search: Callable[[Scenario], OptimisedDrive], scenarios: Sequence[Scenario]) -> list[OptimisedDrive]:
    """Search for one drive after the other."""
    return [search(scenario) for scenario in scenarios]


@dataclass(frozen=True, kw_only=True)
class BuildContext:
    """Task that a policy is built for."""

    scenarios: Sequence[Scenario]
    """True scenarios that it will run in. Only a policy that knows the future may look at them."""
    config: TaskConfig
    """The task; its observation is what a policy sees that is not made for another."""
    spread: Spread = in_turn
    """Map over the searches of a policy that takes many of them to build."""

    @property
    def nominal(self) -> Scenario:
        """Scenario that a policy that knows no more than the clock may be tuned for."""
        return self.config.nominal.as_told

    @property
    def sensors(self) -> Sensors:
        """Sensors of policies that act on them."""
        return self.config.replaced(observation="sensors").sensors or Sensors()

    @property
    def waves(self) -> ExpectedWaves:
        """Motion of the pulley that the task lets expect."""
        return ExpectedWaves.of(self.config.source)


@dataclass(frozen=True)
class PolicySpec:
    """A policy to compare: its name, and how it is built."""

    name: str
    build: Callable[[BuildContext], Policy]
    for_each_scenario: bool = False
    """True if building it takes an optimisation for each scenario: it may then run in the first few of them only."""
    control_period: float | None = None
    """Control step that an agent was trained at, s; None: any."""
    text: str = ""
    """Name, folder or function that it was chosen by; empty where it was not."""
    digest: str = ""
    """Digest of the file that it comes from, the card's or the module's; empty for what needs none."""

    def policy(self, context: BuildContext) -> Policy:
        """Build the policy; where target or frame move it follows them, unless it is made for that very lift.

        And where the target ends on the seabed it leaves the load there, if it has readings to tell that by.
        """
        policy = self.build(context)
        if isinstance(policy, DrivePolicy | CommandSequence) or not any(map(moves, context.scenarios)):
            return policy
        blind = policy.knows in BLIND
        sensors = context.config.sensors if blind else context.sensors if policy.knows is Knowledge.SENSORS else None
        following = Following(policy, sensors)
        if blind or not any(map(lands, context.scenarios)):
            return following
        return SettingDown(following)


def _drum_still(context: BuildContext) -> Policy:
    return DrumStill()


def _nominal_drive(name: str, tuned: Tuned) -> PolicySpec:
    def build(context: BuildContext) -> Policy:
        drives = context.spread(partial(optimised, tuned, context.config.duration), [context.nominal])
        return DrivePolicy(name=name, drives=drives * len(context.scenarios))

    return PolicySpec(name, build)


def _drive_for_each(name: str, tuned: Tuned, optimiser: Optimiser = "nelder-mead") -> PolicySpec:
    def build(context: BuildContext) -> Policy:
        config = context.config
        solve = partial(optimised_as_played, tuned, config.duration, config.control_period, optimiser)
        drives = context.spread(solve, context.scenarios)
        return DrivePolicy(name=name, drives=drives, knows=Knowledge.FUTURE)

    return PolicySpec(name, build, for_each_scenario=True)


_ANY_WAVES: Final = ExpectedWaves(frequency=(0.5, 1.0), variances=((0.1, 0.1),), build_up=0.0)
"""Waves for a policy that is only asked its name: those of a task take a fraction of a second to find."""


def _law(make: Callable[[Sensors, ExpectedWaves], Policy]) -> PolicySpec:
    return PolicySpec(make(Sensors(), _ANY_WAVES).name, lambda context: make(context.sensors, context.waves))


def _predictive(name: str, sensed: bool, adapts: bool = False) -> PolicySpec:
    def build(context: BuildContext) -> Policy:
        sensors, light = context.sensors if sensed else None, context.nominal.is_light
        return PredictiveControl(PlanningConfig.of(sensors, context.waves, light=light, adapts=adapts))

    return PolicySpec(name, build)


def _optimum(context: BuildContext) -> Policy:
    return CommandSequence(OPTIMUM.name, optimise(context.scenarios, context.config).commands)


def _output_zero(observation: Literal["state", "sensors"], name: str) -> PolicySpec:
    def build(context: BuildContext) -> Policy:
        return learned.output_zero(FeatureConfig.of(context.config.replaced(observation=observation)))

    return PolicySpec(name, build)


DRUM_STILL: Final = PolicySpec("drum still", _drum_still)
OPTIMUM: Final = PolicySpec("winch-limited optimum", _optimum)
REGISTRY: Final[dict[str, PolicySpec]] = {
    spec.name: spec
    for spec in (
        DRUM_STILL,
        *(_nominal_drive(name, how) for name, how in TUNED.items()),
        _law(lambda sensors, waves: Feedback(None, waves=waves)),
        _law(lambda sensors, waves: Feedback(sensors, waves=waves)),
        _predictive("predictive control (state)", False),
        _predictive("predictive control", True),
        _predictive("adaptive predictive control", True, True),
        _law(lambda sensors, waves: InverseDynamics()),
        _output_zero("state", "output zero"),
        _output_zero("sensors", "output zero on sensors"),
        OPTIMUM,
        *(_drive_for_each(f"{name} for each scenario", how) for name, how in TUNED.items()),
        *(
            _drive_for_each(f"{name} for each scenario, Gauss-Newton", how, "gauss-newton")
            for name, how in TUNED.items()
            if how.objective == "omega1"
        ),
    )
}
"""Policies by name."""


def _agent(folder: Path) -> PolicySpec:
    return as_spec(learned.load(folder))


def _recurrent_agent(folder: Path) -> PolicySpec:
    return as_spec(recurrent.load(folder))


def _on_forecasts(folder: Path) -> PolicySpec:
    agent = recurrent.load(folder)
    policy = ForetellingControl(agent.network, agent.card)
    return PolicySpec(policy.name, lambda context: policy, control_period=agent.card.control_period)


def _map_in_real_time(folder: Path) -> PolicySpec:
    stored = drive_map.load(folder)
    return _law(lambda sensors, waves: RealTimeMapPolicy(stored, sensors, waves))


def _map_on_the_state(folder: Path) -> PolicySpec:
    stored = drive_map.load(folder)
    return _law(lambda sensors, waves: RealTimeMapPolicy(stored, None, waves))


def _map_by_the_clock(folder: Path) -> PolicySpec:
    policy = DriveMapPolicy(drive_map.load(folder))
    return PolicySpec(policy.name, lambda context: replace(policy, duration=context.config.duration))


FOLDERS: Final[dict[str, dict[str, Callable[[Path], PolicySpec]]]] = {
    learned.CARD: {"": _agent},
    recurrent.CARD: {"": _recurrent_agent, "forecasts": _on_forecasts},
    drive_map.CARD: {"": _map_in_real_time, "state": _map_on_the_state, "clock": _map_by_the_clock},
}
"""Loaders of policies from a folder, by the file that it must have, then by the word after a colon behind its path."""


def slug(name: str) -> str:
    """A name as it can be typed on any keyboard: "S-Ω1 for each scenario" is "s-omega1-for-each-scenario"."""
    return name.strip().lower().replace("ω", "omega").replace(" ", "-")


def choose(text: str) -> PolicySpec:
    """Return the policy of that name in the registry (or the name's slug), folder, or ``module:function``.

    What is shipped goes by its name instead of its folder ("ppo-sensors", "drive-map"). A drive map is the map in real
    time, on the sensors; with ``:state`` behind it that on the full state, with ``:clock`` the map by the clock. With
    ``:forecasts`` behind a recurrent agent predictive control plans by what its memory foretells.
    """
    by_slug = {slug(name): spec for name, spec in REGISTRY.items()}
    if slug(text) in by_slug:
        return by_slug[slug(text)]
    if shipped.folder(text).is_dir():
        return _from_folder(shipped.folder(text))
    folder, word = _place(text)
    folder = next(iter(learned.seeds(folder)), folder)
    kinds = _kinds_in(folder) if word else {}
    if word in kinds:
        return _of_folder(folder, word)
    if kinds:
        known = " or ".join(repr(f":{each}") for each in kinds if each) or "nothing"
        raise InvalidValue(f"policy = {text!r}: behind this folder may stand {known}")
    module, colon, attribute = text.partition(":")
    if colon and module.replace(".", "").isidentifier() and attribute.isidentifier():
        return _from_module(text, module, attribute)
    names = [*REGISTRY, *shipped.AGENTS, *shipped.RECURRENT, shipped.DRIVE_MAP]
    raise InvalidValue(
        f"policy = {text!r}: must be one of {', '.join(map(repr, names))}, "
        "the folder of an agent or a drive map, or module:function"
    )


def choose_all(texts: Sequence[str]) -> list[PolicySpec]:
    """Return policies by names, folders or functions; a folder of agents of several seeds stands for all of them.

    Policies of one name are told apart by their seeds or else by the names, folders or functions given.
    """
    asked = {each: short for text in texts for each, short in _expanded(text).items()}
    specs = [replace(choose(text), text=short) for text, short in asked.items()]
    for told in ([_place(text)[0].name.replace("-", " ") for text in asked], asked.values()):
        names = [spec.name for spec in specs]
        specs = [
            replace(spec, name=f"{spec.name}, {tell}") if names.count(spec.name) > 1 else spec
            for tell, spec in zip(told, specs, strict=True)
        ]
    return specs


def _expanded(text: str) -> dict[str, str]:
    """What a text stands for: texts of single policies, and for each the shortest one."""
    place, word = _place(text)
    folders = [f"{path}:{word}" if word else str(path) for path in learned.seeds(place)]
    return {folder: folder if number else text for number, folder in enumerate(folders)} or {text: text}


def _place(text: str) -> tuple[Path, str]:
    """Folder that a text stands for, and the word behind its colon, if there is one."""
    before, _, word = text.rpartition(":")
    if not word or shipped.folder(text).is_dir():
        return shipped.folder(text), ""
    return shipped.folder(before), word


def as_spec(policy: Policy) -> PolicySpec:
    """Wrap a policy that exists already."""
    period, digest = None, ""
    if isinstance(policy, learned.LearnedPolicy):
        period, digest = policy.card.control_period, learned.digest(learned.card_text(policy.card).encode())
    elif isinstance(policy, recurrent.RecurrentPolicy):
        period, digest = policy.card.control_period, learned.digest(recurrent.card_text(policy.card).encode())
    return PolicySpec(policy.name, lambda context: policy, control_period=period, digest=digest)


def _kinds_in(folder: Path) -> dict[str, Callable[[Path], PolicySpec]]:
    """Loaders of the policies in a folder, by the words for them; none where it holds none."""
    return next((kinds for file, kinds in FOLDERS.items() if (folder / file).is_file()), {})


def _of_folder(folder: Path, word: str) -> PolicySpec:
    """Load the policy of that word from a folder; its card vouches for the other files."""
    card, kinds = next((card, kinds) for card, kinds in FOLDERS.items() if (folder / card).is_file())
    return replace(kinds[word](folder), digest=_digest(folder / card))


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _from_folder(folder: Path) -> PolicySpec:
    if _kinds_in(folder):
        return _of_folder(folder, "")
    if numbered := learned.seeds(folder):
        return _from_folder(numbered[0])
    raise InvalidValue(f"policy = {str(folder)!r}: no agent in this folder: it has none of {', '.join(FOLDERS)}")


def _from_module(text: str, module: str, attribute: str) -> PolicySpec:
    """A policy that is imported, or made by what is imported, as ``agents.imported.Imported`` says."""
    imported = Imported.of(text, module, attribute)
    found, digest = imported.made, _digest(imported.source) if imported.source else ""
    if found is None:

        def build(context: BuildContext) -> Policy:
            knows = Knowledge.STATE if context.config.sensors is None else Knowledge.SENSORS
            return FunctionPolicy(text, imported.function, knows, takes_time=imported.takes_time)

        return PolicySpec(text, build, digest=digest)
    policy = FunctionPolicy(found.name, found.act, found.knows, takes_time=True, begin=found.reset)
    return replace(as_spec(found), build=lambda context: policy, digest=digest)
