"""The task's arguments, which every face of the environment takes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from enum import Enum
from pathlib import Path
from typing import Any, Final, Literal

from gymnasium.envs.registration import EnvSpec

from aframe_env import task
from aframe_env.flexible_engine import Mesh, mesh_of
from aframe_env.scenario import Scenario, ScenarioDistribution, ScenarioSource, Sensors
from aframe_env.scenario.file import scenario_data, scenario_source
from aframe_env.serialization import plain, strict_converter, structure
from aframe_env.suite import find_task
from aframe_env.validation import InvalidValue, require_choice, require_integer, require_known, require_number

Model = Literal["simplified", "rfem"]
MODELS: Final = ("simplified", "rfem")
LONGEST: Final = 1e6
"""Longest episode, s."""


@dataclass(frozen=True, kw_only=True)
class TaskConfig:
    """The task that a face of the environment poses; :class:`aframe_env.env.AFrameHeaveEnv` says what each field means.

    Raises ``InvalidValue`` for what the model cannot take.
    """

    model: Model = "simplified"
    scenario: ScenarioSource | str | Path | Mapping[str, Any] | None = None
    """A scenario, a distribution, or either as a TOML file or as what such a file says; None: the default seas."""
    control_period: float = 0.1
    """s."""
    episode_duration: float = 60.0
    """s."""
    observation: task.Observation | Mapping[str, Any] = "state"
    """A mapping: the fields of ``Sensors``."""
    max_inner_step: float | None = None
    """s."""
    rfes: Sequence[int] | None = None
    rfem_modes: int | None = None
    source: ScenarioSource = field(init=False, repr=False, compare=False)
    """``scenario``, read."""
    mesh: Mesh | None = field(init=False, repr=False, compare=False)
    """Mesh of the full model; None for the simplified one."""

    def __post_init__(self) -> None:
        require_choice("model", self.model, MODELS)
        require_number("control_period", self.control_period, "s", low=1e-3, high=2.0)
        require_number("episode_duration", self.episode_duration, "s", low=self.control_period, high=LONGEST)
        if isinstance(self.observation, Mapping):
            sensors = structure(strict_converter(), plain(self.observation), Sensors, "observation")
            object.__setattr__(self, "observation", sensors)
        if isinstance(self.rfes, list):
            object.__setattr__(self, "rfes", tuple(self.rfes))
        if not isinstance(self.observation, Sensors):
            require_choice("observation", self.observation, ("state", "sensors"))
        object.__setattr__(self, "source", scenario_source(self.scenario))
        object.__setattr__(self, "mesh", mesh_of(self.model, self.rfes, self.rfem_modes))

    @property
    def steps(self) -> int:
        """Control steps of an episode."""
        return max(1, math.ceil(self.episode_duration / self.control_period - 1e-9))

    @property
    def duration(self) -> float:
        """``episode_duration`` in whole control steps, s."""
        return self.steps * self.control_period

    @property
    def sensors(self) -> Sensors | None:
        """Sensors that measure the observation, as they are told; None where the full state is observed."""
        if isinstance(self.observation, Sensors):
            return self.observation
        if self.observation == "state":
            return None
        if isinstance(self.source, ScenarioDistribution):
            return self.source.sensors
        delay = self.source.as_told.sensor_delay
        return Sensors() if delay is None else Sensors(delay=delay)

    @property
    def nominal(self) -> Scenario:
        """The one scenario, or that in the middle of every interval."""
        return self.source if isinstance(self.source, Scenario) else self.source.nominal()

    @property
    def quantities(self) -> tuple[task.Quantity, ...]:
        """Quantities of the observation."""
        return task.quantities(self.sensors)

    @property
    def given(self) -> dict[str, Any]:
        """Arguments that are not the defaults."""
        own = [each for each in fields(self) if each.init and getattr(self, each.name) != each.default]
        return {each.name: getattr(self, each.name) for each in own}

    def lasting(self, steps: int | None) -> TaskConfig:
        """Return the same task with episodes of so many control steps; None: as long as they are."""
        if steps is None or steps == self.steps:
            return self
        require_integer("max_episode_steps", steps, low=1, high=int(LONGEST / self.control_period))
        return replace(self, episode_duration=steps * self.control_period)

    def plain(self) -> dict[str, Any]:
        """Return the arguments that are not the defaults, as data of JSON: they make the same task again.

        Raises ``InvalidValue`` where the scenario has a vessel or a record that was not read from a file.
        """
        found = self.given
        if "scenario" in found:
            found["scenario"] = scenario_data(self.source)
        if isinstance(self.observation, Sensors):
            found["observation"] = asdict(self.observation)
        return dict(plain(found))

    def replaced(self, **arguments: Any) -> TaskConfig:
        """Return the same task but for these fields."""
        return replace(self, **_known(arguments))


def task_config(config: TaskConfig | Mapping[str, Any] | None, arguments: Mapping[str, Any]) -> TaskConfig:
    """Return the task of a ``config``, or the default one, but for these fields.

    ``task`` among them names a task of the suite: it stands for what neither says.
    """
    if isinstance(config, TaskConfig) and "task" not in arguments:
        return config.replaced(**arguments)
    given = {**(config.given if isinstance(config, TaskConfig) else config or {}), **arguments}
    name = given.pop("task", None)
    return TaskConfig(**_known({**({} if name is None else find_task(name).arguments), **given}))


def plain_spec(spec: EnvSpec | None, config: TaskConfig) -> EnvSpec | None:
    """Return a face's ``spec`` with the task's arguments as data of JSON, and the steps of its episodes.

    A scenario that cannot be data stays the object that it is: such a spec makes the task again, but has no JSON.
    """
    if spec is None:
        return None
    names = {"config", "task", *(each.name for each in fields(TaskConfig))}
    others = {name: value for name, value in spec.kwargs.items() if name not in names}
    others = {name: value.value if isinstance(value, Enum) else value for name, value in others.items()}
    try:
        kwargs = {**config.plain(), **others}
    except InvalidValue:
        kwargs = spec.kwargs
    return replace(spec, kwargs=kwargs, max_episode_steps=config.steps)


def _known(arguments: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return them. Raises ``UnexpectedArgument`` where one is no field of a task."""
    require_known(arguments, (each.name for each in fields(TaskConfig) if each.init))
    return arguments
