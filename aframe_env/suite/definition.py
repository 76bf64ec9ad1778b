"""What a task of the suite is."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final, Literal

from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.scenario.motion import has_components
from aframe_env.scenario.series import drawn_scenarios
from aframe_env.validation import InvalidValue

Split = Literal["train", "validation", "test"]
SPLITS: Final[tuple[Split, ...]] = ("train", "validation", "test")
Measure = Literal["slack_per_hour", "peak_tension", "landing_speed", "lift_offs"]
"""What may be told of a policy beside its score: how often the rope goes slack, the tension and the landing speed that
99 of 100 lifts stay below, and how often a load is lifted off the ground again."""
SEALED: Final = 100
"""First scenarios of a split that its digest seals."""
_TIMES: Final = (7.0, 31.0, 58.0)
"""Times at which the digest looks at the ship, s: while the motion builds up, and later."""


@dataclass(frozen=True, kw_only=True)
class Seeds:
    """Seeds of a task's series of scenarios: ``drawn_scenarios`` of each is endless and always the same."""

    train: int
    """To learn from. Learners may draw from seeds of their own instead, and mostly do."""
    validation: int
    """To choose by: hyper-parameters, the moment to stop, which of several agents."""
    test: int
    """To be looked at once, by what was chosen."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """A task: scenarios to draw from, what is observed of them, and which ones count."""

    name: str
    version: int
    """Goes up whenever anything changes that a score depends on."""
    isolates: str
    """The one difficulty that the task is about, in a few words."""
    distribution: ScenarioDistribution
    observation: Literal["state", "sensors"] = "sensors"
    """What the environment observes by default."""
    control_period: float = 0.1
    """s."""
    episode_duration: float = 60.0
    """s."""
    measures: tuple[Measure, ...] = ()
    """What is told of a policy beside its score."""
    seeds: Seeds
    left_out: Mapping[Split, frozenset[int]] = field(default_factory=dict)
    """Numbers of a split's draws in which the rope parts whatever the drum does: there is nothing to be scored."""
    digests: Mapping[Split, str]
    """Digest of the first scenarios of each split as they were when the task was frozen."""

    @property
    def id(self) -> str:
        """Name under which Gymnasium makes the environment."""
        return f"AFrameHeave-{self.name}-v{self.version}"

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of ``TaskConfig``, and so of every face of the environment."""
        return {
            "scenario": self.distribution,
            "observation": self.observation,
            "control_period": self.control_period,
            "episode_duration": self.episode_duration,
        }

    def seed(self, split: Split) -> int:
        """Seed of a split's scenarios, and of the noise of the sensors in them."""
        seed: int = getattr(self.seeds, split)
        return seed

    def scenarios(self, split: Split, count: int) -> list[Scenario]:
        """Return the first ``count`` scenarios of a split; the same ones, whatever the count."""
        left_out = self.left_out.get(split, frozenset())
        drawn = drawn_scenarios(self.distribution, self.seed(split), count + len(left_out))
        return [scenario for i, scenario in enumerate(drawn) if i not in left_out][:count]

    def digest(self, split: Split) -> str:
        """Digest of the split's first scenarios as they are drawn now."""
        facts = [_facts(scenario) for scenario in self.scenarios(split, SEALED)]
        unit = self.distribution.sensors.motion_unit
        if unit is not None:
            # What is drawn of a motion unit goes by the noise of the sensors: its figures and the seed are all.
            facts.append([*(f"{name} = {value}" for name, value in asdict(unit).items()), f"seed = {self.seed(split)}"])
        return hashlib.sha256(json.dumps(facts).encode()).hexdigest()

    def require_frozen(self, split: Split) -> str:
        """Return the digest of a split. Raises where its scenarios are no longer those that the task was frozen with.

        Scores of a task whose scenarios have changed say nothing beside older ones: it needs another version.
        """
        found = self.digest(split)
        if found != self.digests[split]:
            raise InvalidValue(
                f"task {self.id}: the scenarios of the split {split!r} have the digest {found}: must be "
                f"{self.digests[split]}, that which they were frozen with"
            )
        return found


def _facts(scenario: Scenario) -> list[str]:
    """Everything that a draw decides, what the ship does, what is lifted and by what, what is told.

    Numbers, not files: a field that is added to a scenario, and that a task leaves as it is, changes nothing of it. Six
    digits, so that no processor's rounding is taken for a change.
    """
    motion = scenario.motion
    assert has_components(motion)
    heave, *_ = motion.components().at(_TIMES)
    numbers = [*heave.ravel().tolist()]
    for each in (scenario, scenario.as_told):
        winch, rope = each.crane.winch, each.crane.rope
        numbers += [each.load_mass, each.target_level, each.free_length, each.rope_damping, each.ramp]
        numbers += [rope.axial_stiffness, rope.mass_per_length, winch.max_rope_speed, winch.max_rope_acceleration]
        numbers += [winch.lag, -1.0 if each.sensor_delay is None else each.sensor_delay]
    return [f"{number:.6g}" for number in numbers]
