"""Options that all learners share."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

from aframe_env.config import TaskConfig
from aframe_env.suite import find_task
from aframe_env.validation import InvalidValue, require_choice, require_integer, require_number
from agents import shipped
from agents.control.lowering import moves
from agents.learned.agent import seeds
from agents.learned.features import Action, FeatureConfig
from agents.learned.interface import InterfaceConfig, LearnerFeatures
from agents.learned.recurrent import RecurrentPolicy, load
from agents.learned.recurrent_features import RecurrentFeatures
from train.evaluate.run import HeldOut
from train.shared.jobs import Where
from train.shared.run_folder import RunOptions


@dataclass(frozen=True, kw_only=True)
class LearningOptions(RunOptions, Where):
    """Options that all learners share."""

    timesteps: int = 1_000_000
    """Control steps to learn from, over all rows."""
    n_envs: int = 64
    """Rows of the environment."""
    seed: int = 0
    """Seeds everything; the same seed gives the same agent."""
    seeds: int = 1
    """Train so many agents, with seeds one after another, each in a folder of its own."""
    workers: int | None = 1
    """Of ``seeds``, trainings that run at once."""
    observation: Literal["state", "sensors"] = "state"
    """Observation of the agent."""
    action: Action = "residual"
    """What the network's output is: "residual" moves the rope's end, above a hand-written feed-forward that follows the
    pulley; "speed" is the drum's speed, with nothing below it; "predictive" corrects what predictive control plans."""
    start_from: Path | None = None
    """Recurrent agent to learn on from, by name or folder, as train.apg --updates 0 gives one: its memory stays as it
    is, and its perceptron is the actor, whose output is the share of the winch's acceleration that the drum speeds up
    with."""
    actor_rate: float = 1.0
    """With ``start_from``: learning rate of the actor, as a share of the critic's. What it knows is soon lost."""
    winch: bool = False
    """Tell the agent limits and lag of the winch, for scenarios in which they differ."""
    practice: int = 0
    """Learn from so many scenarios, in half of which the winch saturates, again and again, by the share of the heave
    that is left in each; the critic is told their waves to come. 0: from new scenarios as the task draws them."""
    selected_by: int = 0
    """Look at the agent now and then, the first time before it has learned, on so many scenarios of their own, in half
    of which the winch saturates, and give the best that was seen. 0: give what is there at the end."""
    scenarios: Path | None = None
    """A TOML file with a scenario or a distribution of your own to learn from; by default the package's seas."""
    task: str | None = None
    """Task of the suite to learn, by name, as in --task Storm; compared on its validation scenarios."""
    control_period: float = TaskConfig.control_period
    """Control step, s."""
    episode_duration: float = TaskConfig.episode_duration
    """s."""
    batch_size: int = 1024
    """Minibatch."""
    learning_rate: float = 1e-3
    """At the start; it falls linearly to a thirtieth."""
    gamma: float = 0.95
    """Discount for a control step: a horizon of two seconds."""
    hidden: int = 64
    """Units of each hidden layer."""
    horizon: float = InterfaceConfig.horizon
    """Rows start a new scenario after this time, s."""
    drift_limit: float = InterfaceConfig.drift_limit
    """Depth error at which a row starts anew, m; its last state's value stands for the rest."""
    reward_scale: float = InterfaceConfig.reward_scale
    """Reward for a metre of root mean square depth error over a step."""
    reward_knee: float = InterfaceConfig.reward_knee
    """Depth error beyond which the reward falls with its logarithm only, m: what is learned would otherwise be spent on
    the few loads that drift far off, not on the last centimetres of all others."""
    eval_scenarios: int = 200
    """Held-out scenarios of the comparison at the end; 0 leaves it out."""
    eval_privileged: int = 20
    """The first so many of them, or all if there are fewer, for the drives that are optimised with the whole future
    known."""
    threads: int = 1
    """Threads of torch; more than one only slows so small a network down."""
    checkpoint_every: float = 30.0
    """Time of learning between two checkpoints, s."""
    resume: Path | None = None
    """Folder of a training that was interrupted, to go on with; its own options hold. The same command with the same
    --out goes on, too."""
    log: tuple[str, ...] = ("tensorboard",)
    """Where figures go beside the CSV file: tensorboard, wandb, mlflow, or several of them."""

    def __post_init__(self) -> None:
        Where.__post_init__(self)
        if self.cluster is not None and self.seeds == 1:
            raise InvalidValue(f"cluster = {self.cluster!r}: goes with --seeds, for one training is one job")
        require_integer("timesteps", self.timesteps, low=1, high=10**12)
        require_integer("n_envs", self.n_envs, low=1, high=2**20)
        require_integer("seed", self.seed, low=0, high=2**32 - 1)
        require_integer("seeds", self.seeds, low=1, high=10_000)
        require_choice("observation", self.observation, ("state", "sensors"))
        require_integer("practice", self.practice, low=0, high=10**6)
        require_integer("selected_by", self.selected_by, low=0, high=10**5)
        require_number("control_period", self.control_period, "s", low=0.01, high=2.0)
        if self.task is not None:
            self._require_task()
        self.config  # noqa: B018 - raises here, before anything is written
        require_integer("batch_size", self.batch_size, low=2, high=10**9)
        require_number("learning_rate", self.learning_rate, "", low=0.0, high=1.0, low_open=True)
        require_number("actor_rate", self.actor_rate, "of the critic's", low=0.0, high=1.0, low_open=True)
        require_number("gamma", self.gamma, "", low=0.0, high=1.0)
        require_integer("hidden", self.hidden, low=1, high=4096)
        require_number("horizon", self.horizon, "s", low=self.control_period, high=self.episode_duration)
        self.interface  # noqa: B018 - likewise
        require_integer("eval_scenarios", self.eval_scenarios, low=0, high=10**6)
        require_integer("eval_privileged", self.eval_privileged, low=0, high=10**6)
        require_integer("threads", self.threads, low=1, high=256)
        require_number("checkpoint_every", self.checkpoint_every, "s", low=0.0, high=1e9)

    def require_start(self) -> None:
        """Raise where there is no agent to learn on from, or it does not go with the rest."""
        start = self.start
        if start is None:
            raise InvalidValue("start_from = None: must be the folder of a recurrent agent")
        if self.action != "residual" or self.winch:
            raise InvalidValue(
                f"action = {self.action!r}, winch = {self.winch}: must be left out beside --start-from, whose "
                "agent has an action and inputs of its own"
            )
        if moves(self.config.nominal):
            raise InvalidValue(
                f"start_from = {str(self.start_from)!r}: must not be given where target or frame move, for recurrent "
                "agents do not follow them"
            )
        if start.card.sensors != self.config.sensors:
            raise InvalidValue(
                f"start_from = {str(self.start_from)!r}: its agent observes {start.card.observation!r}, trained on "
                f"{start.card.task or 'no task'!r}: must be with the very sensors of the training, whose observation = "
                f"{self.observation!r} and task = {self.task!r}"
            )
        if abs(start.card.control_period - self.control_period) > 1e-9:
            raise InvalidValue(
                f"control_period = {self.control_period:g} s: must be {start.card.control_period:g} s, that of the "
                "agent to start from"
            )

    def _require_task(self) -> None:
        """Raise where what is asked for does not go with the task of the suite."""
        found = find_task(str(self.task))
        if self.scenarios is not None:
            raise InvalidValue(f"scenarios = {str(self.scenarios)!r}: must not be given beside --task {self.task}")
        for name in ("control_period", "episode_duration"):
            if getattr(self, name) != getattr(found, name):
                raise InvalidValue(
                    f"{name} = {getattr(self, name):g} s: must be {getattr(found, name):g} s, the task's"
                )

    @cached_property
    def config(self) -> TaskConfig:
        """The task."""
        return TaskConfig(
            scenario=self.scenarios if self.task is None else find_task(self.task).distribution,
            control_period=self.control_period,
            episode_duration=self.episode_duration,
            observation=self.observation,
        )

    @property
    def adapts(self) -> bool:
        """Whether the predictive control that is corrected adapts: on a task's sensors, where it mostly does better."""
        return self.task is not None and self.action == "predictive" and self.observation == "sensors"

    @cached_property
    def features(self) -> FeatureConfig:
        """What the agent's features are made for."""
        return FeatureConfig.of(self.config, self.action, winch=self.winch, adapts=self.adapts)

    @property
    def task_id(self) -> str:
        """Id of the task of the suite; empty for other scenarios."""
        return "" if self.task is None else find_task(self.task).id

    @cached_property
    def start(self) -> RecurrentPolicy | None:
        """The recurrent agent to learn on from, the lowest seed where there are several."""
        if self.start_from is None:
            return None
        folder = shipped.folder(str(self.start_from))
        return load(next(iter(seeds(folder)), folder))

    def learner_features(self, rows: int) -> LearnerFeatures:
        """What so many rows observe."""
        start = self.start
        if start is None:
            return LearnerFeatures.of(self.config, rows, self.interface)
        agents = RecurrentFeatures(rows, start.card.made_for, start.network)
        return LearnerFeatures(rows, self.features, privileged=self.interface.privileged, agents=agents)

    @property
    def width(self) -> int:
        """Fewest numbers of a row's observation; scenarios of ``practice`` tell the critic more."""
        return len(self.learner_features(1).names)

    @cached_property
    def interface(self) -> InterfaceConfig:
        """What the rows have on top of the task."""
        return InterfaceConfig(
            action=self.action,
            winch=self.winch,
            adapts=self.adapts,
            reward_scale=self.reward_scale,
            reward_knee=self.reward_knee,
            drift_limit=self.drift_limit,
            horizon=self.horizon,
            privileged=True,
        )

    @property
    def held_out(self) -> HeldOut:
        """Held-out scenarios of the same task, for the comparison at the end."""
        own = self.scenarios is not None
        return HeldOut(
            scenarios=self.scenarios or self.eval_scenarios,
            count=self.eval_scenarios if own else None,
            privileged=self.eval_privileged,
            task=self.task,
            control_period=self.control_period,
            episode_duration=self.episode_duration,
        )

    def rate(self, remaining: float) -> float:
        """Learning rate when a share ``remaining`` of the training is left."""
        return self.learning_rate * max(remaining, 1.0 / 30.0)
