"""One episode of a comparison, or of a task of one's own, to be watched."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from aframe_env.config import TaskConfig
from aframe_env.scenario import Scenario
from aframe_env.simulation import Simulation
from aframe_env.validation import require_integer, require_number
from agents.registry import BuildContext, choose
from agents.rollout import held_out_scenarios, noise_seeds
from train.evaluate.run import observation_of
from train.shared.episode import Episode


@dataclass(frozen=True, kw_only=True)
class EpisodeOptions:
    """The episode, and the part of it that is shown."""

    overwrite: bool = False
    """Write the file even if there is one of that name."""
    policy: str = "ppo-sensors"
    """Name, folder of an agent or a drive map, or module:function."""
    observation: Literal["state", "sensors"] = "state"
    """Observation of a policy that is made for neither; an agent sees what it was trained on."""
    scenario: int | Path = 0
    """Number of a held-out scenario, as in the comparison; or a TOML file with a scenario or a distribution."""
    seed: int = 0
    """Draws from the file's distribution, as env.reset(seed=...) does, and the sensors' noise."""
    start: float = 10.0
    """Time of the episode from which it is shown, s."""
    seconds: float = 30.0
    """Length of what is shown, s."""

    def __post_init__(self) -> None:
        if isinstance(self.scenario, int):
            require_integer("scenario", self.scenario, low=0, high=19_999)
        require_integer("seed", self.seed, low=0, high=2**63 - 1)
        require_number("start", self.start, "s", low=0.0, high=3600.0)
        require_number("seconds", self.seconds, "s", low=0.1, high=3600.0)

    def times(self, fps: float) -> list[float]:
        """Times of the pictures, s, so many a second."""
        return [self.start + k / fps for k in range(max(1, round(self.seconds * fps)))]


def begin(options: EpisodeOptions) -> Episode:
    """Begin the episode. Raises ``InvalidValue`` where there is no such policy or scenario."""
    spec = choose(options.policy)
    config = TaskConfig(
        scenario=options.scenario if isinstance(options.scenario, Path) else None,
        observation=options.observation,
        control_period=spec.control_period or TaskConfig.control_period,
        episode_duration=options.start + options.seconds,
    )
    scenario, noise_seed = _drawn(options, config)
    policy = spec.policy(BuildContext(scenarios=[scenario], config=config))
    # A single scenario has no sensors of its own.
    seen = config.replaced(observation=observation_of(policy, config))
    return Episode(policy, seen.replaced(observation=seen.sensors or "state"), scenario, noise_seed)


def _drawn(options: EpisodeOptions, config: TaskConfig) -> tuple[Scenario, int]:
    """Return the scenario and the seed of its sensors' noise."""
    if isinstance(options.scenario, Path):
        return Simulation(1, config).draw(np.random.default_rng(options.seed))
    count = options.scenario + 1
    return held_out_scenarios(config.source, count)[-1], noise_seeds(options.seed, count)[-1]
