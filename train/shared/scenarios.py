"""``--scenarios``: number and origin of the scenarios that a command works on."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

from aframe_env.scenario import Scenario, ScenarioSource
from aframe_env.scenario.file import scenario_source
from aframe_env.validation import InvalidValue, require_integer


@dataclass(frozen=True, kw_only=True)
class ScenarioOptions:
    """Number and origin of scenarios."""

    bounds: ClassVar[tuple[int, int]] = (1, 10**6)
    """Fewest and most scenarios that the command works on."""
    scenarios: int | Path = 200
    """Number of scenarios; or a TOML file with a scenario or a distribution of your own to take them from."""
    count: int | None = None
    """Number of scenarios of the file that --scenarios names; by default one where it says a single one, which is the
    same sea every time, and else as many as without a file."""

    def __post_init__(self) -> None:
        if self.count is not None and not isinstance(self.scenarios, Path):
            raise InvalidValue(f"count = {self.count}: goes with a file, as in --scenarios FILE.toml --count 100")
        low, high = self.bounds
        require_integer("scenarios" if self.count is None else "count", self.number, low=low, high=high)
        self.source  # noqa: B018 - read here, before anything is written

    @property
    def number(self) -> int:
        """Number of scenarios."""
        if not isinstance(self.scenarios, Path):
            return self.scenarios
        if self.count is not None:
            return self.count
        if isinstance(self.source, Scenario):
            return max(1, self.bounds[0])
        return type(self).scenarios  # type: ignore[return-value]

    @cached_property
    def source(self) -> ScenarioSource:
        """Scenario or distribution to take them from; ``InvalidValue`` where the file is wrong."""
        return scenario_source(self.scenarios if isinstance(self.scenarios, Path) else None)
