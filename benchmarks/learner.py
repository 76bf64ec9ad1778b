"""Seconds until a learner removes 95 % of the heave: this package's PPO beside the plain way to set them up.

``python -m benchmarks.learner``. The plain way is Stable-Baselines3's own, ``MlpPolicy``, on a
``DummyVecEnv`` of scalar environments behind ``VecNormalize``, with the same hyper-parameters and number of rows. Both
learn in turn with one thread, and stop when the deterministic agent's median over validation scenarios is there; the
clock stands still while it is looked at.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import gymnasium
import numpy as np
import torch
from rich.console import Console
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

import aframe_env  # noqa: F401  (registers the environment)
from aframe_env.scenario import ScenarioDistribution
from agents.policy import DrumStill, FloatArray, Knowledge, Policy
from agents.rollout import run
from train.learn import ppo
from train.learn.run import to_policy
from train.learn.tune import validation_scenarios
from train.shared.cli import parse
from train.shared.run_folder import user_errors, versions, write_json

LOOKS_EVERY: Final = 16_384
"""Control steps between two looks."""


Setup = Literal["this package", "plain"]


@dataclass(frozen=True)
class Options:
    """Targets and limits of the learning."""

    target: float = 0.95
    """Median heave reduction to reach."""
    scenarios: int = 64
    """Validation scenarios."""
    limit: float = 600.0
    """Time after which a learner is given up, s."""
    rounds: int = 3
    """Runs of each, with seeds one after another."""
    out: Path = Path("results/benchmark-learner.json")
    """File of the figures."""


@dataclass(frozen=True)
class Outcome:
    """One run."""

    setup: Setup
    seed: int
    reached: bool
    seconds: float
    """Learning until the target, or until given up."""
    timesteps: int
    reductions: list[float]
    """Median heave reduction at each look."""
    environment: float
    """Share of these seconds in the environment's steps, resets and features among them."""
    updates: float
    """Share in the learner's updates; the rest is choosing actions and keeping them."""


class Stopwatch:
    """Time spent in a method of an object."""

    def __init__(self, owner: Any, method: str) -> None:
        self.seconds = 0.0
        self._call = getattr(owner, method)
        setattr(owner, method, self)

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Call the method."""
        begin = time.perf_counter()
        try:
            return self._call(*args, **kwargs)
        finally:
            self.seconds += time.perf_counter() - begin


class Plain:
    """Stable-Baselines3's agent on raw observations as a policy."""

    name = "plain"
    knows = Knowledge.STATE

    def __init__(self, model: BaseAlgorithm, normalise: VecNormalize) -> None:
        self._model, self._normalise = model, normalise

    def reset(self, scenarios: object, control_period: float) -> None:
        """Do nothing."""

    def act(self, observation: FloatArray, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s."""
        action, _ = self._model.predict(self._normalise.normalize_obs(observation), deterministic=True)
        return np.asarray(action[:, 0], dtype=np.float64)


class Clock(BaseCallback):
    """Callback that stops the learner at the target or the limit."""

    def __init__(self, policy: Callable[[], Policy], options: Options) -> None:
        super().__init__()
        self._policy, self._options = policy, options
        self._scenarios = validation_scenarios(ScenarioDistribution(), options.scenarios)
        self._still = run(DrumStill(), self._scenarios).rms
        self._looked = 0
        self.reductions: list[float] = []
        self.seconds = 0.0
        self._since = time.perf_counter()

    @property
    def reached(self) -> bool:
        """True if the target was reached."""
        return bool(self.reductions) and self.reductions[-1] >= self._options.target

    def _on_training_start(self) -> None:
        self._since = time.perf_counter()

    def _on_step(self) -> bool:
        return not self.reached and self.seconds < self._options.limit

    def _on_rollout_start(self) -> None:
        if self.num_timesteps - self._looked < LOOKS_EVERY:
            return
        self._looked = self.num_timesteps
        self.seconds += time.perf_counter() - self._since
        left = run(self._policy(), self._scenarios).rms / self._still
        self.reductions.append(float(np.median(1.0 - left)))
        self._since = time.perf_counter()


def watch(setup: Setup, seed: int, model: BaseAlgorithm, timesteps: int, clock: Clock) -> Outcome:
    """Learn until the clock says so."""
    environment, updates = Stopwatch(model.env, "step"), Stopwatch(model, "train")
    model.learn(timesteps, callback=clock)
    return Outcome(
        setup,
        seed,
        clock.reached,
        clock.seconds,
        model.num_timesteps,
        clock.reductions,
        environment.seconds / clock.seconds,
        updates.seconds / clock.seconds,
    )


def ours(seed: int, options: Options) -> Outcome:
    """Learn with this package's PPO."""
    chosen = ppo.Options(seed=seed)
    learner = ppo.build(chosen)
    clock = Clock(lambda: to_policy(learner, chosen)[0], options)
    return watch("this package", seed, learner.model, chosen.timesteps, clock)


def plain(seed: int, options: Options) -> Outcome:
    """Learn in the plain way."""
    chosen = ppo.Options(seed=seed)
    rows = VecNormalize(
        DummyVecEnv([lambda: gymnasium.make("AFrameHeave-v0", episode_duration=60.0)] * chosen.n_envs),
        gamma=chosen.gamma,
    )
    model = PPO(
        "MlpPolicy",
        rows,
        n_steps=chosen.n_steps,
        batch_size=chosen.batch_size,
        n_epochs=chosen.n_epochs,
        learning_rate=chosen.rate,
        gamma=chosen.gamma,
        gae_lambda=chosen.gae_lambda,
        clip_range=chosen.clip_range,
        policy_kwargs={"net_arch": [chosen.hidden, chosen.hidden]},
        seed=seed,
        device="cpu",
    )
    clock = Clock(lambda: Plain(model, rows), options)
    return watch("plain", seed, model, 10**8, clock)


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "benchmarks.learner", __doc__ or ""), Console()
        torch.set_num_threads(1)
        outcomes = []
        for seed in range(options.rounds):
            for learn in (ours, plain):
                outcome = learn(seed, options)
                outcomes.append(outcome)
                best = max(outcome.reductions, default=0.0)
                end = "reached" if outcome.reached else f"given up at {best:.1%}"
                console.print(
                    f"{outcome.setup}, seed {seed}: {end}, {outcome.seconds:.1f} s, {outcome.timesteps:,} steps; "
                    f"environment {outcome.environment:.0%}, updates {outcome.updates:.0%}"
                )
        mine, theirs = ([o.seconds for o in outcomes if o.setup == setup] for setup in ("this package", "plain"))
        ratio = float(np.median([t / m for m, t in zip(mine, theirs, strict=True)]))
        write_json(
            options.out,
            {
                "target": options.target,
                "limit_s": options.limit,
                "ratio": ratio,
                "ratio_is_a_lower_bound": not all(o.reached for o in outcomes if o.setup == "plain"),
                "outcomes": [vars(o) for o in outcomes],
                "versions": versions(),
            },
        )
        console.print(f"plain over this package: {ratio:.1f}; {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
