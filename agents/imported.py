"""Policies of anybody's own: imported from ``module:attribute``, and checked as they run."""

from __future__ import annotations

import importlib
import inspect
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aframe_env.scenario import Scenario
from aframe_env.validation import InvalidValue, require_numbers
from agents.policy import FloatArray, Knowledge, Policy


@dataclass(frozen=True)
class Imported:
    """What ``module:attribute`` stands for: a policy, or a function of the observations."""

    made: Policy | None
    """The policy; None for a function."""
    function: Callable[..., Any]
    """The function, of observations (N, K) and perhaps of the time, that gives drum speeds (N,) rad/s."""
    takes_time: bool
    source: Path | None
    """The module's file; None for what is built in."""

    @classmethod
    def of(cls, text: str, module: str, attribute: str) -> Imported:
        """Import the attribute, the current folder included in the search; ``text`` is what was asked for.

        It is a policy, a class or function that makes one when called without arguments, or a function of
        observations (N, K), and time if it takes two arguments, that gives drum speeds (N,) rad/s.

        Raises:
            InvalidValue: It cannot be imported or made, or is none of these.
        """
        here = str(Path.cwd())
        sys.path.insert(0, here)
        try:
            with _somebodys(f"policy = {text!r}: cannot be imported"):
                imported = importlib.import_module(module)
                found = getattr(imported, attribute)
        finally:
            sys.path.remove(here)
        file = getattr(imported, "__file__", None)
        source = Path(file) if file else None
        with _somebodys(f"policy = {text!r}: cannot be looked at"):
            ready = not isinstance(found, type) and _is_policy(found)
        if not ready:
            if not callable(found):
                raise InvalidValue(f"policy = {text!r}: is a {type(found).__name__}, must be a policy or callable")
            needed = _required_arguments(found)
            if needed > 2:
                raise InvalidValue(f"policy = {text!r}: takes {needed} arguments, must take (observation) or (…, time)")
            if needed > 0 and not isinstance(found, type):
                return cls(None, found, needed == 2, source)
            with _somebodys(f"policy = {text!r}: cannot be made"):
                found = found()
                ready = _is_policy(found)
            if not ready:
                kind = type(found).__name__
                raise InvalidValue(
                    f"policy = {text!r}: made a {kind}, must be a policy with name, knows, reset and act"
                )
        return cls(found, found.act, True, source)


@dataclass
class FunctionPolicy:
    """Somebody's function of the observations (N, K), and perhaps of the time, as a policy that is checked."""

    name: str
    function: Callable[..., Any]
    knows: Knowledge
    takes_time: bool
    begin: Callable[[Sequence[Scenario], float], Any] | None = None
    """What is to be called before N episodes."""
    rows: int = 0

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes."""
        self.rows = len(scenarios)
        if self.begin is not None:
            with _somebodys(self.name):
                self.begin(scenarios, control_period)

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands of the function, checked: (N,) rad/s."""
        with _somebodys(self.name):
            said = self.function(observation, time) if self.takes_time else self.function(observation)
        speeds = require_numbers(f"drum speeds of {self.name}", said, f"({self.rows},) rad/s")
        if speeds.shape == (self.rows, 1):
            speeds = speeds[:, 0]
        if speeds.shape != (self.rows,):
            raise InvalidValue(f"{self.name} gave shape {speeds.shape}: must be ({self.rows},), one speed an episode")
        if not np.isfinite(speeds).all():
            raise InvalidValue(f"{self.name} gave a drum speed that is not finite at t = {time:g} s: must be rad/s")
        return speeds


@contextmanager
def _somebodys(what: str) -> Iterator[None]:
    """Say in one sentence what somebody's own code raised, and where."""
    try:
        yield
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        ours = (__file__, importlib.__file__, "<frozen importlib._bootstrap>", "<frozen importlib._bootstrap_external>")
        theirs = [frame for frame in frames if frame.filename not in ours]
        where = f" ({theirs[-1].filename}, line {theirs[-1].lineno})" if theirs else ""
        raise InvalidValue(f"{what}: {type(error).__name__}: {error}{where}") from error


def _is_policy(thing: Any) -> bool:
    return (
        isinstance(getattr(thing, "name", None), str)
        and isinstance(getattr(thing, "knows", None), Knowledge)
        and all(callable(getattr(thing, name, None)) for name in ("reset", "act"))
    )


def _required_arguments(function: Callable[..., Any]) -> int:
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return 1
    return sum(p.kind in kinds and p.default is inspect.Parameter.empty for p in parameters)
