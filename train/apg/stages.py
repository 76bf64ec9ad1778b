"""The stages of a training, each kept in a file when it is done, so that an interruption costs one stage at most."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from agents.control.optimum import optimise
from agents.learned.agent import digest
from agents.learned.recurrent import RecurrentCard, RecurrentPolicy, serialise
from agents.learned.recurrent_inputs import LookoutConfig
from agents.learned.recurrent_network import RecurrentNetwork
from agents.policy import DrumStill, FloatArray
from agents.rollout import run
from train.apg.data import Array, Recordings, record
from train.apg.learning import Climb, Labels, ask_teacher, fit_forecaster, imitate, shortfall
from train.apg.options import ApgOptions
from train.shared.run_folder import versions, write_atomically

FOLDER: Final = "stages"
BLOCK: Final = 250
"""Episodes that are recorded at a time."""
Arrays = dict[str, Array]


@dataclass(frozen=True)
class Best:
    """The best agent that was looked at."""

    network: RecurrentNetwork
    looks: list[dict[str, float]]
    """After how many updates, and mean share of the ceiling, that of the worst 5 % and the shortfall then."""


def to_policy(network: RecurrentNetwork, options: ApgOptions) -> tuple[RecurrentPolicy, bytes]:
    """A network as a policy, and the bytes of its weights."""
    weights, config = serialise(network), LookoutConfig.of(options.config)
    card = RecurrentCard(
        algorithm=_algorithm(options),
        observation=options.observation,
        sensors=config.sensors,
        waves=config.waves,
        memory=options.memory,
        hidden=options.hidden,
        control_period=config.control_period,
        task="" if options.suite_task is None else options.suite_task.id,
        seed=options.seed,
        versions=versions(),
        sha256=digest(weights),
        adapts=config.adapts,
        chains=config.chains,
    )
    return RecurrentPolicy(network, card), weights


def _algorithm(options: ApgOptions) -> str:
    """Name of what all stages make; a network that was taught nothing is nearly a regulator."""
    if options.updates:
        return "recurrent APG"
    return "recurrent imitation" if options.rounds else "recurrent regulator"


class Training:
    """A training in its run folder."""

    def __init__(self, options: ApgOptions, folder: Path, console: Console) -> None:
        self._options, self._folder, self._console = options, folder / FOLDER, console
        torch.set_num_threads(options.threads)
        with torch.random.fork_rng():
            torch.manual_seed(options.seed)
            self._network = RecurrentNetwork(
                len(LookoutConfig.of(options.config).readings), options.memory, options.hidden
            )

    def remove(self) -> None:
        """Remove what is kept of the stages."""
        shutil.rmtree(self._folder, ignore_errors=True)

    def run(self) -> Best:
        """Go through all stages that are not done yet."""
        options, network = self._options, self._network
        recordings = self._record()
        with self._stage("foretelling", options.forecaster_steps) as report:
            self._learned("forecaster", lambda: fit_forecaster(network, recordings, options, report))
        asked: list[Labels] = []
        for number in range(options.rounds):
            with self._stage(f"round {number + 1}: the teacher", 1) as report:
                asked.append(
                    self._kept(f"labels-{number}", lambda: ask_teacher(network, recordings, options, len(asked)))
                )
                report(f"{len(asked[-1]['share'])} states")
            with self._stage(f"round {number + 1}: imitation", options.imitation_steps) as report:
                self._learned(f"imitation-{number}", lambda: imitate(network, recordings, asked, options, report))
        return self._climb(recordings)

    def _record(self) -> Recordings:
        options = self._options
        parts = []
        with self._stage("recording", options.episodes) as report:
            for first in range(0, options.episodes, BLOCK):
                count = min(BLOCK, options.episodes - first)
                arrays = self._kept(f"recordings-{first}", partial(self._block, first, count))
                parts.append(Recordings(LookoutConfig.of(options.config), **arrays))
                report(f"{len(parts[-1].still)} of use", count)
        return Recordings.joined(parts)

    def _block(self, first: int, count: int) -> Arrays:
        noise = int(np.random.default_rng([self._options.seed, 0, first]).integers(2**63))
        return record(self._options.training_scenarios(first, count), self._options.config, noise).arrays()

    def _climb(self, recordings: Recordings) -> Best:
        options, network = self._options, self._network
        climb, looks = Climb(network, recordings, options), _Looks()
        best: Arrays = {}
        taken_up = self._read("climb")
        if taken_up is not None:
            looks = _Looks.of(taken_up["looks"])
            best = {name[5:]: each for name, each in taken_up.items() if name.startswith("best/")}
            climb.restore(taken_up)
        with self._stage("gradients", options.updates) as report:
            report("", climb.updates)
            while True:
                if climb.updates % options.look_every == 0 or climb.updates == options.updates:
                    if looks.add(climb.updates, *self._look()):
                        best = {name: each.numpy().copy() for name, each in network.state_dict().items()}
                    self._console.print(looks.last)
                    self._write("climb", {**climb.state(), "looks": looks.rows, **_under("best", best)})
                if climb.updates >= options.updates:
                    break
                report(f"share {climb.update():.1%}, validation {looks.rows[-1, 1]:.1%}")
        network.load_state_dict({name: torch.from_numpy(each) for name, each in best.items()})
        return Best(network, looks.listed)

    def _look(self) -> tuple[float, float, float]:
        """Mean share, that of the worst 5 % and the shortfall on the validation scenarios, in the real engine."""
        options = self._options
        still, best = self._validation
        policy, _ = to_policy(self._network, options)
        rms = run(policy, options.validation_scenarios(), options.config, noise_seed=options.seed).rms
        shares = np.sort((still - rms) / (still - best))
        worst = shares[: max(1, round(0.05 * len(shares)))]
        return float(shares.mean()), float(worst.mean()), float(shortfall(torch.from_numpy(shares), options))

    @cached_property
    def _validation(self) -> tuple[FloatArray, FloatArray]:
        """Depth errors on the validation scenarios with the drum left still and with the best commands, (N,) m."""
        config = self._options.config

        def reckon() -> Arrays:
            scenarios = self._options.validation_scenarios()
            best = np.sqrt(optimise(scenarios, config).omega1 / config.duration)
            return {"still": run(DrumStill(), scenarios, config).rms, "best": best}

        kept = self._kept("validation", reckon)
        return kept["still"], kept["best"]

    def _learned(self, name: str, learn: Callable[[], None]) -> None:
        """Let the network learn, or load what it learned."""

        def weights() -> Arrays:
            learn()
            return {name: each.numpy() for name, each in self._network.state_dict().items()}

        kept = self._kept(name, weights)
        self._network.load_state_dict({name: torch.from_numpy(each.copy()) for name, each in kept.items()})

    def _kept(self, name: str, make: Callable[[], Arrays]) -> Arrays:
        """What a stage made, now or before."""
        found = self._read(name)
        if found is None:
            found = make()
            self._write(name, found)
        return found

    def _read(self, name: str) -> Arrays | None:
        path = self._folder / f"{name}.safetensors"
        return load_arrays(path.read_bytes()) if path.is_file() else None

    def _write(self, name: str, arrays: Arrays) -> None:
        stored = save_arrays({key: np.asarray(array, order="C") for key, array in arrays.items()})
        write_atomically(self._folder / f"{name}.safetensors", lambda path: path.write_bytes(stored))

    @contextmanager
    def _stage(self, name: str, steps: int) -> Iterator[Any]:
        """Show the progress of a stage; what it gives is called after each step, with a figure."""
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[figure]}"),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=self._console) as progress:
            bar = progress.add_task(name, total=steps, figure="")
            yield lambda figure, done=1: progress.update(bar, advance=done, figure=figure)


class _Looks:
    """Looks at the agent."""

    def __init__(self) -> None:
        self.rows = np.zeros((0, 4))
        """(L, 4) updates, mean share, that of the worst 5 %, shortfall."""

    @classmethod
    def of(cls, rows: Array) -> _Looks:
        looks = cls()
        looks.rows = rows
        return looks

    def add(self, updates: int, mean: float, worst: float, missing: float) -> bool:
        """Add a look, unless there has been one just now; return whether the agent is the best so far."""
        if len(self.rows) and self.rows[-1, 0] == updates:
            return False
        best = not len(self.rows) or missing < self.rows[:, 3].min()
        self.rows = np.concatenate([self.rows, [[updates, mean, worst, missing]]])
        return bool(best)

    @property
    def last(self) -> str:
        updates, mean, worst, _ = self.rows[-1]
        return f"after {updates:.0f} updates, on validation scenarios: {mean:.1%} of the ceiling, worst 5 % {worst:.1%}"

    @property
    def listed(self) -> list[dict[str, float]]:
        return [dict(zip(("updates", "share", "worst", "shortfall"), row, strict=True)) for row in self.rows.tolist()]


def _under(name: str, arrays: Arrays) -> Arrays:
    return {f"{name}/{key}": array for key, array in arrays.items()}
