"""Policies that the viewer offers, on the full state and on sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

from aframe_env import task
from aframe_env.config import TaskConfig
from aframe_env.validation import InvalidValue
from agents.policy import Policy
from agents.registry import DRUM_STILL, OPTIMUM, BuildContext, choose
from train.evaluate.run import observation_of, require_period

DURATION: Final = 300.0
"""Length of an episode, s: then the next sea begins."""


@dataclass(frozen=True)
class Choice:
    """A policy as it is offered: one name, and what it is on the full state and on sensors."""

    name: str
    on_state: str
    on_sensors: str

    def text(self, sensors: bool) -> str:
        """Name or folder in the registry's words."""
        return self.on_sensors if sensors else self.on_state


_AGENTS: Final = (
    Choice("trained agent, PPO", "ppo", "ppo-sensors"),
    Choice("trained agent, SAC", "sac", "sac-sensors"),
)
_LAWS: Final = tuple(
    Choice(name, f"{name} (state)", name) for name in ("predictive control", "feed-forward + feedback")
)


def choices(texts: Sequence[str]) -> list[Choice]:
    """Return the policies of these names, folders or functions; laws and shipped agents where none is given.

    Raises ``InvalidValue`` where one is not known, or cannot act as it goes.
    """
    if texts:
        names = {text: build(text, sensors=True)[0].name for text in texts}
        taken = list(names.values())
        # Agents that differ in their seed alone have one name: they are told apart by what was asked for.
        return [Choice(name if taken.count(name) == 1 else text, text, text) for text, name in names.items()]
    still = Choice(DRUM_STILL.name, DRUM_STILL.name, DRUM_STILL.name)
    return [*_AGENTS, *_LAWS, still]


@cache
def build(text: str, sensors: bool) -> tuple[Policy, task.Observation]:
    """Build a policy for the default task; return it and the observation that it acts on.

    ``sensors`` decides for a policy that is made for neither observation.
    """
    spec = choose(text)
    if spec.for_each_scenario or spec.name == OPTIMUM.name:
        raise InvalidValue(
            f"policy = {text!r}: is optimised beforehand for each scenario: must be one that acts as it goes, such as "
            "'predictive control'"
        )
    config = TaskConfig(episode_duration=DURATION, observation="sensors" if sensors else "state")
    require_period([spec], config.control_period)
    policy = spec.build(BuildContext(scenarios=[config.nominal], config=config))
    return policy, observation_of(policy, config)
