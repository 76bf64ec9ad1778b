"""Trainings that are killed again and again, and started again by the same command."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from multiprocessing.context import ForkServerProcess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from agents.learned.agent import WEIGHTS
from benchmarks.torture.processes import start
from benchmarks.torture.trial import Outcome, Trial
from train.learn.checkpoint import FOLDER, KEPT, SEGMENTS

SMALL: Final = {
    "train.ppo": "--timesteps 2000 --n-envs 8 --n-steps 16 --batch-size 64 --n-epochs 4 --eval-scenarios 0",
    "train.sac": "--timesteps 400 --n-envs 4 --learning-starts 40 --replay 240 --batch-size 32 --eval-scenarios 0",
}
"""Options of a training of a few seconds; SAC's replay runs over."""
_STARTING: Final = 3.0
"""Some seconds that a training takes to be under way."""
_PATIENCE: Final = 300.0
"""Seconds after which a training is no longer waited for."""


@dataclass(frozen=True)
class Killed:
    """Trainings by one command."""

    module: str

    def attempt(self, rng: np.random.Generator, folder: Path, most: int) -> Outcome:
        """Kill a training at random moments, until it ends or was killed so often; hold its agent to the true one."""
        run = folder / "run"
        kills, writing = 0, 0
        while True:
            before = _unfinished(run)
            process = self._start(folder, float(rng.choice([0.0, 0.05, 0.2])))
            if kills == most or not _kill(process, run, rng):
                break
            kills += 1
            writing += bool(_unfinished(run) - before)
        process.join(_PATIENCE)
        ended = process.exitcode
        process.kill()
        counts = {"in a checkpoint's writing": writing}
        said = (folder / "said").read_text(encoding="utf-8")
        if "Traceback" not in said and (ended == 0 or "this training is finished" in said):
            if _digest(run) == self._digest:
                return Outcome(max(kills, 1), max(kills, 1), counts)
            return Outcome(max(kills, 1), 0, counts, ("another agent",))
        return Outcome(max(kills, 1), 0, counts, (f"exit status {ended}: {said[-1000:]}",))

    @cached_property
    def _digest(self) -> str:
        """Digest of the agent of a training that nothing befalls."""
        with TemporaryDirectory(prefix="torture-") as folder:
            process = self._start(Path(folder), 1e6)
            process.join(_PATIENCE)
            return _digest(Path(folder) / "run")

    def _start(self, folder: Path, every: float) -> ForkServerProcess:
        options = (*SMALL[self.module].split(), "--checkpoint-every", every, "--log")
        return start(folder / "said", self.module, "--out", folder / "run", *options)


def _digest(run: Path) -> str:
    return sha256((run / WEIGHTS).read_bytes()).hexdigest()


def _unfinished(run: Path) -> set[str]:
    """What the writing of a checkpoint leaves when it is killed: parts of it, or one more than are kept."""
    folder = run / FOLDER
    places = sorted(folder.glob("[0-9]*"))
    parts = [*folder.glob(".*"), *(folder / SEGMENTS).glob(".*")]
    return {path.name for path in (*parts, *places[:-KEPT])}


def _kill(process: ForkServerProcess, run: Path, rng: np.random.Generator) -> bool:
    """Kill a training at a random moment; False if it ended before that."""
    moment = rng.choice(["starting", "learning", "writing"], p=[0.2, 0.4, 0.4])
    begin = time.monotonic()
    if moment == "starting":
        process.join(float(rng.uniform(0.0, _STARTING)))
    else:
        seen = set((run / FOLDER).glob("[0-9]*"))
        while process.is_alive() and set((run / FOLDER).glob("[0-9]*")) <= seen:
            time.sleep(0.002)
            if time.monotonic() > begin + _PATIENCE:
                break
        process.join(float(rng.uniform(0.0, 0.3)))
        seen_parts = _unfinished(run)
        while moment == "writing" and process.is_alive() and _unfinished(run) <= seen_parts:
            time.sleep(0.0002)
            if time.monotonic() > begin + _PATIENCE:
                break
        process.join(float(rng.exponential(0.002)))
    if not process.is_alive():
        return False
    process.kill()
    process.join()
    return True


def trials(kills: int) -> list[Trial]:
    """Trainings with PPO and with SAC."""
    return [
        Trial(
            name=f"{module}, killed",
            what=f"`{module}`, killed (−9) at random moments and started again until it ends: the agent is that of a "
            "training that was never killed, to the bit",
            wanted=kills,
            attempt=Killed(module).attempt,
        )
        for module in SMALL
    ]
