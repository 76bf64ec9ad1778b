"""Seconds until a learner is half of the way from the hand-written base to the shipped agent.

``python -m benchmarks.learner``. Two ways to set PPO up on the agents' interface, with the same features, action,
reward and horizon: this package's (rows of one simulation, a linear path beside the perceptron) and the plain one of
Stable-Baselines3 (``MlpPolicy`` on ``make_vec_env`` of ``AgentInterface``). The settings of each are searched for in
one space with one number of trials, the first of which is the package's own settings; then each learns with seeds that
no trial had. Both learn in turn with one thread, and stop when the deterministic agent's median heave reduction over
validation scenarios is there. They are looked at from the start, before anything is learned; the clock stands still
meanwhile.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import gymnasium
import numpy as np
import optuna
import torch
from rich.console import Console
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

import aframe_env  # noqa: F401  (registers the environment)
import agents
from agents import AgentInterface, FeaturePolicy
from agents.learned.agent import output_zero
from agents.policy import DrumStill, Policy
from agents.rollout import run
from train.learn import ppo
from train.learn.learner import Search
from train.learn.trained import to_policy
from train.learn.tune import suggest, validation_scenarios
from train.shared.cli import parse
from train.shared.run_folder import user_errors, versions, write_json

LOOKS_EVERY: Final = 4096
"""Control steps between two looks, or as many as are collected between two updates."""
FIRST_SEED: Final = 1000
"""Seed of the first trial of a search; those of the runs that count begin at 0."""

_SPACE: Final = ppo.SPEC.search
assert _SPACE is not None
SPACE: Final = Search(
    {name: found for name, found in _SPACE.ranges.items() if name != "reward_knee"},
    {**_SPACE.choices, "n_envs": (16, 32, 64)},
)
"""Search space of both set-ups; the reward is the same."""

Setup = Literal["this package", "plain"]


@dataclass(frozen=True)
class Options:
    """Targets and limits of the learning."""

    observation: Literal["state", "sensors"] = "sensors"
    """Observation of the agents."""
    half_way: float = 0.5
    """Target, as a share of the way from the median of output zero to that of the shipped agent."""
    scenarios: int = 64
    """Validation scenarios."""
    limit: float = 150.0
    """Time after which a learner is given up, s."""
    trials: int = 10
    """Trials of the search for settings of each, the package's own settings included; 1 takes them as they are."""
    rounds: int = 5
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
    """Median heave reduction at each look, the first before any learning."""
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


class Course:
    """Validation scenarios to look at agents on."""

    def __init__(self, observation: Literal["state", "sensors"], scenarios: int) -> None:
        self._options = ppo.Options(observation=observation)
        self._scenarios = validation_scenarios(self._options.config.source, scenarios)
        self._still = run(DrumStill(), self._scenarios).rms

    def output_zero(self) -> float:
        """Median of the hand-written base alone."""
        return self.median(output_zero(self._options.features))

    def shipped(self) -> float:
        """Median of the shipped agent."""
        return self.median(agents.load("ppo-sensors" if self._options.observation == "sensors" else "ppo"))

    def median(self, policy: Policy) -> float:
        """Median heave reduction of a policy."""
        left = run(policy, self._scenarios, observation=self._options.observation).rms
        return 1.0 - float(np.median(left / self._still))


class Clock(BaseCallback):
    """Callback that stops the learner at the target or the limit."""

    def __init__(self, policy: Callable[[], Policy], course: Course, target: float, limit: float) -> None:
        super().__init__()
        self._policy, self._course, self._target, self._limit = policy, course, target, limit
        self._looked = -LOOKS_EVERY
        self.reductions: list[float] = []
        self.seconds = 0.0
        self._since = time.perf_counter()

    @property
    def reached(self) -> bool:
        """True if the target was reached."""
        return bool(self.reductions) and self.reductions[-1] >= self._target

    def _on_training_start(self) -> None:
        self._since = time.perf_counter()

    def _on_step(self) -> bool:
        return not self.reached and self.seconds < self._limit

    def _on_rollout_start(self) -> None:
        self.seconds += time.perf_counter() - self._since
        if self.num_timesteps - self._looked >= LOOKS_EVERY:
            self._looked = self.num_timesteps
            self.reductions.append(self._course.median(self._policy()))
        self._since = time.perf_counter()

    def _on_training_end(self) -> None:
        # The step after which the learner hears that it has to stop.
        self.seconds += time.perf_counter() - self._since


def ours(chosen: ppo.Options) -> tuple[BaseAlgorithm, Callable[[], Policy]]:
    """This package's PPO, and how to take a policy out of it."""
    learner = ppo.build(chosen)
    assert isinstance(learner.model, PPO)
    return learner.model, lambda: to_policy(learner, chosen)[0]


def plain(chosen: ppo.Options) -> tuple[BaseAlgorithm, Callable[[], Policy]]:
    """Stable-Baselines3's own PPO on the agents' interface, and how to take a policy out of it."""
    interface = replace(chosen.interface, privileged=False)
    rows = make_vec_env(
        lambda: AgentInterface(gymnasium.make("AFrameHeave-v0", observation=chosen.observation), config=interface),
        n_envs=chosen.n_envs,
        seed=chosen.seed,
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
        policy_kwargs={"net_arch": [chosen.hidden, chosen.hidden], "log_std_init": chosen.log_std_init},
        seed=chosen.seed,
        device="cpu",
    )
    return model, lambda: FeaturePolicy(lambda x: model.predict(x, deterministic=True)[0], chosen.features)


SETUPS: Final[dict[Setup, Callable[[ppo.Options], tuple[BaseAlgorithm, Callable[[], Policy]]]]] = {
    "this package": ours,
    "plain": plain,
}


def learn(setup: Setup, chosen: ppo.Options, course: Course, target: float, limit: float) -> Outcome:
    """Learn until the target or the limit."""
    model, policy = SETUPS[setup](chosen)
    environment, updates = Stopwatch(model.env, "step"), Stopwatch(model, "train")
    clock = Clock(policy, course, target, limit)
    model.learn(chosen.timesteps, callback=clock)
    spent = max(clock.seconds, 1e-9)
    return Outcome(
        setup=setup,
        seed=chosen.seed,
        reached=clock.reached,
        seconds=clock.seconds,
        timesteps=model.num_timesteps,
        reductions=clock.reductions,
        environment=environment.seconds / spent,
        updates=updates.seconds / spent,
    )


def tune(setup: Setup, options: Options, course: Course, target: float, console: Console) -> dict[str, Any]:
    """Search for the settings that reach the target soonest."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    defaults = ppo.Options(observation=options.observation)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=0))
    study.enqueue_trial({name: getattr(defaults, name) for name in SPACE.names})

    def seconds(trial: optuna.Trial) -> float:
        chosen = replace(defaults, **suggest(trial, SPACE), seed=FIRST_SEED + trial.number)
        outcome = learn(setup, chosen, course, target, options.limit)
        console.print(f"{setup}, trial {trial.number}: {said(outcome)}")
        # Those that were given up are ranked by how far they got.
        return outcome.seconds + (0.0 if outcome.reached else options.limit * (1.0 - max(outcome.reductions)))

    study.optimize(seconds, n_trials=options.trials)
    return dict(study.best_params)


def said(outcome: Outcome) -> str:
    """Say how a run ended."""
    end = "reached" if outcome.reached else f"given up at {max(outcome.reductions):.2%}"
    return (
        f"{end}, {outcome.seconds:.1f} s, {outcome.timesteps:,} steps; "
        f"environment {outcome.environment:.0%}, updates {outcome.updates:.0%}"
    )


def main() -> int:
    """Run the command."""
    with user_errors():
        options, console = parse(Options, "benchmarks.learner", __doc__ or ""), Console()
        torch.set_num_threads(1)
        course = Course(options.observation, options.scenarios)
        zero, shipped = course.output_zero(), course.shipped()
        target = zero + options.half_way * (shipped - zero)
        console.print(f"output zero {zero:.2%}, shipped agent {shipped:.2%}, target {target:.2%}")
        settings = {setup: tune(setup, options, course, target, console) for setup in SETUPS}
        defaults = ppo.Options(observation=options.observation)
        outcomes = []
        for seed in range(options.rounds):
            for setup in SETUPS:
                outcome = learn(setup, replace(defaults, **settings[setup], seed=seed), course, target, options.limit)
                outcomes.append(outcome)
                console.print(f"{setup}, seed {seed}: {said(outcome)}")
        mine, theirs = ([o.seconds for o in outcomes if o.setup == setup] for setup in SETUPS)
        ratio = float(np.median([t / max(m, 1e-9) for m, t in zip(mine, theirs, strict=True)]))
        write_json(
            options.out,
            {
                "observation": options.observation,
                "output_zero": zero,
                "shipped": shipped,
                "target": target,
                "limit_s": options.limit,
                "trials": options.trials,
                "settings": settings,
                "seconds": {setup: float(np.median(s)) for setup, s in zip(SETUPS, (mine, theirs), strict=True)},
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
