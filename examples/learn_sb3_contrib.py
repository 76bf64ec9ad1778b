"""Train TQC or recurrent PPO of sb3-contrib on a task of the suite, and add a row to its table.

    python examples/learn_sb3_contrib.py --algorithm tqc --task Storm --timesteps 1000000 --out runs/tqc_storm
    python -m train.benchmark --tasks Storm --policies runs.tqc_storm.policy:policy --split validation

It needs ``pip install "aframe-heave[contrib]"``. The learner is theirs, "MlpPolicy" or "MlpLstmPolicy"; rows, features,
action and settings are those of ``train.sac`` or ``train.ppo``. Into the folder go ``model.zip`` and ``policy.py``, a
module whose ``policy`` is the trained model for whatever takes policies as ``module:attribute``; it vouches for the
model by its digest. Both are written at the end: an interrupted training leaves the folder as it was.
"""

import hashlib
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Literal

import torch
import tyro
from gymnasium.error import DependencyNotInstalled
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from aframe_env import Scenario, find_task
from aframe_env.validation import InvalidValue, require_choice, require_integer
from agents import FeatureConfig, FeaturePolicy
from agents.learned.feature_policy import Float32Array
from agents.policy import FloatArray
from agents.registry import as_spec, choose
from train.evaluate.run import run_on
from train.evaluate.statistics import tail_mean
from train.learn import ppo, sac
from train.learn.options import LearningOptions
from train.learn.run import ShowReduction, learning_progress
from train.learn.sb3_env import TrainingVecEnv
from train.shared.console import PlainConsole
from train.shared.run_folder import new_folder, user_errors, write_atomically, write_text

with user_errors() if __name__ == "__main__" else nullcontext():
    try:
        from sb3_contrib import TQC, RecurrentPPO
    except ModuleNotFoundError as error:
        raise DependencyNotInstalled(f'{error.name} is not installed: pip install "aframe-heave[contrib]"') from error

Algorithm = Literal["tqc", "recurrent-ppo"]
Observation = Literal["state", "sensors"]

MODELS: Final[dict[Algorithm, type[TQC] | type[RecurrentPPO]]] = {"tqc": TQC, "recurrent-ppo": RecurrentPPO}
SETTINGS: Final[dict[Algorithm, type[LearningOptions]]] = {"tqc": sac.Options, "recurrent-ppo": ppo.Options}
NAMES: Final[dict[Algorithm, str]] = {"tqc": "TQC", "recurrent-ppo": "recurrent PPO"}

MODULE: Final = '''"""{name}, trained on {task} with seed {seed} for {timesteps:,} control steps."""

from pathlib import Path

from examples.learn_sb3_contrib import play

policy = play(
    Path(__file__).with_name("model.zip"),
    algorithm="{algorithm}",
    task="{task}",
    observation="{observation}",
    sha256="{sha256}",
)
'''


def settings(algorithm: Algorithm, task: str, observation: Observation, **more: Any) -> LearningOptions:
    """The package's settings for such a learner; the winch is among the features where what is told of it differs."""
    winches = {scenario.as_told.crane.winch for scenario in find_task(task).scenarios("train", 10)}
    return SETTINGS[algorithm](task=task, observation=observation, winch=len(winches) > 1, **more)


def build(options: LearningOptions, rows: TrainingVecEnv) -> TQC | RecurrentPPO:
    """The learner, before it has learned anything: its output is zero or nearly so."""
    first, hidden = options.learning_rate, [options.hidden, options.hidden]
    shared: dict[str, Any] = {
        "env": rows,
        "batch_size": options.batch_size,
        "learning_rate": lambda left: first * max(left, 1.0 / 30.0),
        "gamma": options.gamma,
        "seed": options.seed,
        "device": "cpu",
    }
    if isinstance(options, ppo.Options):
        return RecurrentPPO(
            "MlpLstmPolicy",
            n_steps=options.n_steps,
            n_epochs=options.n_epochs,
            gae_lambda=options.gae_lambda,
            clip_range=options.clip_range,
            policy_kwargs={
                "log_std_init": options.log_std_init,
                "lstm_hidden_size": options.hidden,
                "net_arch": hidden,
            },
            **shared,
        )
    assert isinstance(options, sac.Options)
    model = TQC(
        "MlpPolicy",
        buffer_size=options.replay,
        learning_starts=100 * rows.num_envs,
        tau=options.tau,
        gradient_steps=options.gradient_steps,
        ent_coef=f"auto_{options.ent_coef}",
        target_entropy=options.target_entropy,
        policy_kwargs={"net_arch": {"pi": hidden, "qf": [options.critic_hidden, options.critic_hidden]}},
        **shared,
    )
    # Look for something better near the hand-written base, as SAC of the package does: by default the spread is 1.
    for layer, value in ((model.actor.mu, 0.0), (model.actor.log_std, -1.5)):
        assert isinstance(layer, nn.Linear)
        nn.init.zeros_(layer.weight)
        nn.init.constant_(layer.bias, value)
    return model


class Played:
    """A trained model as a policy: its features' memory, and that of its LSTM if it has one, last an episode."""

    def __init__(self, model: BaseAlgorithm, config: FeatureConfig, name: str) -> None:
        self._model = model
        self._memory: Any = None
        self._on_features = FeaturePolicy(self._output, config, name=name)
        self.name, self.knows = name, self._on_features.knows

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes: the LSTM forgets the last ones."""
        self._memory = None
        self._on_features.reset(scenarios, control_period)

    def act(self, observation: Float32Array, time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s for observations (N, K) at ``time`` s since the start."""
        return self._on_features.act(observation, time)

    def _output(self, features: Float32Array) -> Float32Array:
        output, self._memory = self._model.predict(features, state=self._memory, deterministic=True)
        return output


def play(path: Path, *, algorithm: Algorithm, task: str, observation: Observation, sha256: str) -> Played:
    """Load a model as a policy that was trained so; one with another digest is refused."""
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    if found != sha256:
        raise InvalidValue(f"{path}: has the sha256 {found}, must have {sha256}, that of the model beside policy.py")
    model = MODELS[algorithm].load(path, device="cpu")
    return Played(model, settings(algorithm, task, observation).features, name_of(algorithm, observation))


def name_of(algorithm: Algorithm, observation: Observation) -> str:
    """Name of the row."""
    return f"{NAMES[algorithm]}{' on sensors' if observation == 'sensors' else ''} (sb3-contrib)"


def learn(
    algorithm: Algorithm,
    out: Path,
    task: str = "Storm",
    observation: Observation = "sensors",
    timesteps: int = 1_000_000,
    seed: int = 0,
    rows: int = 64,
    scenarios: int = 50,
    overwrite: bool = False,
) -> float:
    """Train, save, and return the mean heave reduction over the task's first validation ``scenarios``.

    ``out``: a folder below this one, named in letters, digits and _, for it is imported from; ``overwrite``: even if it
    has something in it. ``rows`` of the task are learned from at once.
    """
    require_choice("algorithm", algorithm, tuple(MODELS))
    require_integer("scenarios", scenarios, low=1, high=20_000)
    module = ".".join((*out.parts, "policy"))
    if not all(part.isidentifier() for part in out.parts):
        raise InvalidValue(f"out = {str(out)!r}: must be a folder below this one, named in letters, digits and _")
    options = settings(algorithm, task, observation, timesteps=timesteps, seed=seed, n_envs=rows)
    new_folder(out, overwrite=overwrite)
    torch.set_num_threads(options.threads)
    # The actor of theirs sees what the critics see: nothing that is privileged.
    interface = replace(options.interface, privileged=False)
    learning_rows = TrainingVecEnv(rows, options.config, interface, seed=seed)
    model = build(options, learning_rows)
    console = PlainConsole()
    with learning_progress(console) as progress:
        model.learn(timesteps, callback=ShowReduction(progress, timesteps, learning_rows))

    write_atomically(out / "model.zip", model.save)
    name, sha256 = name_of(algorithm, observation), hashlib.sha256((out / "model.zip").read_bytes()).hexdigest()
    said = {"algorithm": algorithm, "task": options.task, "observation": observation, "sha256": sha256}
    write_text(out / "policy.py", MODULE.format(name=name, seed=seed, timesteps=model.num_timesteps, **said))

    base = "output zero on sensors" if observation == "sensors" else "output zero"
    compared = (choose(base), as_spec(Played(model, options.features, name)))
    drawn, noise = find_task(task).scenarios("validation", scenarios), find_task(task).seed("validation")
    found = run_on(compared, options.config, drawn, console, seed=noise)
    for entry in found.entries[1:]:
        reductions = 1.0 - entry.episodes.rms / found.still.rms
        console.print(f"{entry.policy}: heave reduction {reductions.mean():.1%}, worst 5 % {tail_mean(reductions):.1%}")
    console.print(f"to score it: python -m train.benchmark --tasks {task} --policies {module}:policy")
    return float(reductions.mean())


if __name__ == "__main__":
    with user_errors():
        tyro.cli(learn)
