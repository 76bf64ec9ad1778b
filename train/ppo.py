"""Train a PPO agent to hold the load still, then compare it with the paper's drives: ``python -m train.ppo``."""

from __future__ import annotations

import contextlib
import shlex
import sys
import time
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal

import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from aframe_env.sensors import Sensors
from aframe_env.validation import require_choice, require_integer, require_number
from agents.features import feature_names
from agents.learned import (
    CARD,
    WEIGHTS,
    AgentCard,
    LearnedPolicy,
    card_text,
    digest,
    serialise,
)
from train.actor_critic import TwoPathPolicy
from train.bridge import TrainingVecEnv
from train.config import parse, to_toml
from train.held_out import evaluate
from train.output import new_folder, user_errors, versions, write_atomically, write_json, write_text


@dataclass(frozen=True)
class Options:
    """Options of the training."""

    timesteps: int = 1_000_000
    """Control steps to learn from, over all rows."""
    n_envs: int = 64
    """Rows of the environment."""
    seed: int = 0
    """Seeds everything; the same seed gives the same agent."""
    out: Path | None = None
    """Run folder; by default runs/ppo-DATE-TIME."""
    overwrite: bool = False
    """Write into the run folder even if it has something in it."""
    observation: Literal["state", "sensors"] = "state"
    """What the agent sees."""
    control_period: float = 0.1
    """Control step, s."""
    n_steps: int = 64
    """Steps of each row between two updates."""
    batch_size: int = 1024
    """Minibatch."""
    n_epochs: int = 10
    """Passes over the data of an update."""
    learning_rate: float = 1e-3
    """At the start; it falls linearly to a thirtieth."""
    gamma: float = 0.95
    """Discount for a control step: a horizon of two seconds."""
    gae_lambda: float = 0.9
    """λ of the generalised advantage estimate."""
    clip_range: float = 0.2
    """PPO's clipping."""
    hidden: int = 64
    """Units of each hidden layer."""
    log_std_init: float = -2.5
    """Logarithm of the first standard deviation of an action (a share of the speed limit)."""
    horizon: float = 30.0
    """Rows start a new scenario after this time, s."""
    drift_limit: float = 10.0
    """Depth error at which a row starts anew, m; its last state's value stands for the rest."""
    reward_scale: float = 1.0
    """Reward for a metre of root mean square depth error over a step."""
    eval_scenarios: int = 200
    """Held-out scenarios of the comparison at the end; 0 leaves it out."""
    eval_privileged: int = 20
    """The first so many of them for the drives that are optimised with the whole future known."""
    threads: int = 1
    """Threads of torch; more than one only slows so small a network down."""

    def __post_init__(self) -> None:
        require_integer("timesteps", self.timesteps, low=1, high=10**12)
        require_integer("n_envs", self.n_envs, low=1, high=2**20)
        require_integer("seed", self.seed, low=0, high=2**32 - 1)
        require_choice("observation", self.observation, ("state", "sensors"))
        require_number("control_period", self.control_period, "s", low=0.01, high=2.0)
        require_integer("n_steps", self.n_steps, low=2, high=10**6)
        require_integer("batch_size", self.batch_size, low=2, high=self.n_steps * self.n_envs)
        require_integer("n_epochs", self.n_epochs, low=1, high=1000)
        require_number("learning_rate", self.learning_rate, "", low=0.0, high=1.0, low_open=True)
        require_number("gamma", self.gamma, "", low=0.0, high=1.0)
        require_number("gae_lambda", self.gae_lambda, "", low=0.0, high=1.0)
        require_number("clip_range", self.clip_range, "", low=0.0, high=1.0, low_open=True)
        require_integer("hidden", self.hidden, low=1, high=4096)
        require_number("log_std_init", self.log_std_init, "", low=-20.0, high=2.0)
        require_number("horizon", self.horizon, "s", low=self.control_period, high=60.0)
        require_number("drift_limit", self.drift_limit, "m", low=0.0, high=1e3, low_open=True)
        require_number("reward_scale", self.reward_scale, "1/m", low=0.0, high=1e6, low_open=True)
        require_integer("eval_scenarios", self.eval_scenarios, low=0, high=10**6)
        require_integer("eval_privileged", self.eval_privileged, low=0, high=max(self.eval_scenarios, 0))
        require_integer("threads", self.threads, low=1, high=256)


class ShowReduction(BaseCallback):
    """Show progress and heave reduction while learning."""

    def __init__(self, progress: Progress, total: int, rows: TrainingVecEnv) -> None:
        super().__init__()
        self._progress = progress
        self._task = progress.add_task("learning", total=total, reduction="   -  ")
        self._rows = rows

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        reduction = self._rows.take_reduction()
        self.logger.record("rollout/heave_reduction", reduction)
        self._progress.update(
            self._task,
            completed=min(self.num_timesteps, self._progress.tasks[0].total or 0),
            reduction=f"{reduction:6.1%}",
        )


def build(options: Options) -> tuple[PPO, TrainingVecEnv]:
    """The learner and its rows."""
    torch.set_num_threads(options.threads)
    rows = TrainingVecEnv(
        options.n_envs,
        scenario=None,
        observation=options.observation,
        control_period=options.control_period,
        episode_duration=60.0,
        horizon=options.horizon,
        drift_limit=options.drift_limit,
        reward_scale=options.reward_scale,
        seed=options.seed,
    )

    def rate(remaining: float) -> float:
        return options.learning_rate * max(remaining, 1.0 / 30.0)

    model = PPO(
        TwoPathPolicy,
        rows,
        n_steps=options.n_steps,
        batch_size=options.batch_size,
        n_epochs=options.n_epochs,
        learning_rate=rate,
        gamma=options.gamma,
        gae_lambda=options.gae_lambda,
        clip_range=options.clip_range,
        policy_kwargs={"hidden": options.hidden, "log_std_init": options.log_std_init},
        seed=options.seed,
        device="cpu",
    )
    return model, rows


def to_policy(model: PPO, rows: TrainingVecEnv, options: Options) -> tuple[LearnedPolicy, bytes]:
    """The agent as a policy, and the bytes of its weights."""
    policy = model.policy
    assert isinstance(policy, TwoPathPolicy)
    actor = policy.to_actor()
    weights = serialise(actor)
    card = AgentCard(
        algorithm="PPO",
        observation=options.observation,
        sensors=Sensors() if options.observation == "sensors" else None,
        features=feature_names(rows.quantities),
        hidden=options.hidden,
        speed_limit=rows.speed_limit,
        control_period=options.control_period,
        seed=options.seed,
        timesteps=model.num_timesteps,
        versions=versions(),
        sha256=digest(weights),
    )
    return LearnedPolicy(actor, card), weights


def save(folder: Path, policy: LearnedPolicy, weights: bytes) -> None:
    """Write the agent: weights first, the card that vouches for them last."""
    write_atomically(folder / WEIGHTS, lambda path: path.write_bytes(weights))
    write_text(folder / CARD, card_text(policy.card))


def train(options: Options, console: Console) -> int:
    """Train, save, compare; return the exit status."""
    folder = new_folder(
        options.out or Path("runs") / f"ppo-{datetime.now():%Y%m%d-%H%M%S}", overwrite=options.overwrite
    )
    write_text(folder / "config.toml", to_toml(options))
    write_json(
        folder / "run.json",
        {
            "command": shlex.join([Path(sys.executable).name, "-m", "train.ppo", *sys.argv[1:]]),
            "versions": versions(),
        },
    )
    console.print(f"run folder: {folder}")
    with console.status("compiling the engine (about half a minute at the very first start)"):
        model, rows = build(options)
        rows.reset()
    model.set_logger(configure(str(folder / "log"), ["tensorboard", "csv"]))
    begin = time.perf_counter()
    interrupted = False
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("heave reduction {task.fields[reduction]}"),
        TimeRemainingColumn(),
        console=console,
    ) as progress:
        try:
            model.learn(options.timesteps, callback=ShowReduction(progress, options.timesteps, rows))
        except KeyboardInterrupt:
            interrupted = True
        finally:
            model.logger.close()
    seconds = time.perf_counter() - begin
    policy, weights = to_policy(model, rows, options)
    save(folder, policy, weights)
    write_json(
        folder / "metrics.json",
        {"timesteps": model.num_timesteps, "training_seconds": round(seconds, 1), "interrupted": interrupted},
    )
    console.print(f"agent: {folder / WEIGHTS} after {model.num_timesteps:,} steps in {seconds:.0f} s")
    if interrupted:
        console.print("interrupted: what was learned is kept; the comparison was left out")
        return 130
    if options.eval_scenarios:
        with contextlib.suppress(KeyboardInterrupt):
            evaluate(policy, folder, options.eval_scenarios, options.eval_privileged, console)
    return 0


def main() -> int:
    """Run the command."""
    with user_errors():
        return train(parse(Options, __doc__ or ""), Console())


if __name__ == "__main__":
    sys.exit(main())
