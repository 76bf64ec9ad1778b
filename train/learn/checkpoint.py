"""Checkpoints of a training: everything that its rest depends on, so that it ends with the same agent to the bit.

A checkpoint is a folder of safetensors and JSON, complete or not there at all. The replay of an off-policy learner is
kept in segments that checkpoints share: each writes only what has been collected since the last.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from types import FrameType
from typing import Any, Final

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback

from train.learn.learner import Learner, Model, Remembers
from train.learn.memory import Memory, into_learner, of_learner
from train.shared.run_folder import naming, versions, write_atomically

FOLDER: Final = "checkpoints"
KEPT: Final = 2
"""Checkpoints that are kept: the newest, and one to go back to."""
ARRAYS: Final = "memory.safetensors"
CARD: Final = "checkpoint.json"
SEGMENTS: Final = "replay"
REPLAYED: Final = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


class Stopped(Exception):
    """A signal asked the training to stop; a checkpoint has been written."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.status = 128 + number


@dataclass
class Stop:
    """Whether to stop, and by which signal."""

    number: int | None = None


@contextmanager
def stop_by_signal() -> Iterator[Stop]:
    """Let SIGTERM and a first Ctrl-C ask for a stop; a second Ctrl-C does not wait for it."""
    stop = Stop()

    def ask(number: int, _: FrameType | None) -> None:
        if stop.number is not None and number == signal.SIGINT:
            raise KeyboardInterrupt
        stop.number = number

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handler in before.items():
        # Whoever started the command with a signal ignored, as nohup does, wants it so.
        if handler is not signal.SIG_IGN:
            signal.signal(number, ask)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@dataclass
class Checkpoints:
    """The checkpoints of a training in its run folder."""

    run: Path
    _segments: list[dict[str, Any]] = field(default_factory=list)
    """Segments of the replay that the newest checkpoint consists of, the oldest first."""

    @property
    def folder(self) -> Path:
        """Where they are."""
        return self.run / FOLDER

    def write(self, learner: Learner) -> Path:
        """Write a checkpoint; the one before the last goes."""
        model, rows = learner.model, learner.rows
        place = self.folder / f"{model.num_timesteps:012d}"
        if place.is_dir():  # taken up again, and asked to stop before anything was learned
            return place
        memory = Memory()
        memory.put("rows", rows.memory())
        memory.put("learner", _of_model(model))
        memory.put("best", learner.best.memory())
        replay = getattr(model, "replay_buffer", None)
        steps = model.num_timesteps // rows.num_envs
        segments = None if replay is None else self._write_replay(replay, steps)
        arrays = save_arrays({name: _storable(array) for name, array in memory.arrays.items()})
        card = {
            "arrays": sha256(arrays).hexdigest(),
            "complex": [name for name, array in memory.arrays.items() if np.iscomplexobj(array)],
            "replay": segments,
            "values": memory.values,
            "versions": versions(),
        }
        text = json.dumps(card)
        made = self.folder / f".{place.name}.{os.getpid()}"
        shutil.rmtree(made, ignore_errors=True)
        with naming(place):
            try:
                made.mkdir(parents=True)
                _write(made / ARRAYS, arrays)
                _write(made / CARD, json.dumps({"sha256": sha256(text.encode()).hexdigest(), "card": text}).encode())
                made.rename(place)
            except BaseException:
                shutil.rmtree(made, ignore_errors=True)
                raise
        self._segments = segments["segments"] if segments else []
        self._tidy()
        return place

    def take_up(self, learner: Learner) -> dict[str, Any] | None:
        """Put the newest whole checkpoint into a learner that was built alike, and return its card; None for none."""
        replay = getattr(learner.model, "replay_buffer", None)
        for place in reversed(self._places()):
            found = _read(place)
            if found is None:
                continue
            card, arrays = found
            if replay is not None and not self._read_replay(replay, card["replay"]):
                continue
            memory = Memory(arrays, card["values"])
            learner.rows.recall(memory.under("rows"))
            _into_model(learner.model, memory.under("learner"))
            learner.best.recall(memory.under("best"), learner.to_actor)
            return card
        return None

    def remove(self) -> None:
        """Remove all, now that the training has ended."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _places(self) -> list[Path]:
        return sorted(place for place in self.folder.glob("[0-9]*") if place.is_dir())

    def _tidy(self) -> None:
        """Keep the newest checkpoints and the segments that they consist of."""
        places = self._places()
        for place in places[:-KEPT]:
            shutil.rmtree(place)
        for place in self.folder.glob(".[0-9]*"):  # left by a process that was killed while it wrote
            shutil.rmtree(place)
        needed: set[str] = set()
        for place in places[-KEPT:]:
            found = _card(place)
            if found is not None and found["replay"]:
                needed |= {segment["file"] for segment in found["replay"]["segments"]}
        for path in (self.folder / SEGMENTS).glob("*"):
            if path.name not in needed:
                path.unlink()

    def _write_replay(self, replay: ReplayBuffer, added: int) -> dict[str, Any]:
        """Write what was collected since the last checkpoint; return how the whole is put together.

        ``added``: steps of all rows that were ever collected, the oldest of which are overwritten by now.
        """
        size = replay.buffer_size
        begun = self._segments[-1]["to"] if self._segments else 0
        segments = list(self._segments)
        if added > begun or not segments:
            begin = max(begun, added - size)
            rows = np.arange(begin, added) % size
            data = save_arrays({name: np.ascontiguousarray(getattr(replay, name)[rows]) for name in REPLAYED})
            name = f"{added:012d}.safetensors"
            write_atomically(self.folder / SEGMENTS / name, lambda path: _write(path, data))
            segments.append({"file": name, "from": begin, "to": added, "sha256": sha256(data).hexdigest()})
        segments = [segment for segment in segments if segment["to"] > added - size]
        return {"added": added, "segments": segments}

    def _read_replay(self, replay: ReplayBuffer, kept: dict[str, Any]) -> bool:
        """Fill the replay; False if a segment is damaged or not there."""
        size = replay.buffer_size
        for segment in kept["segments"]:
            try:
                data = (self.folder / SEGMENTS / segment["file"]).read_bytes()
            except OSError:
                return False
            if sha256(data).hexdigest() != segment["sha256"]:
                return False
            arrays = load_arrays(data)
            rows = np.arange(segment["from"], segment["to"])
            alive = rows >= kept["added"] - size
            for name in REPLAYED:
                getattr(replay, name)[rows[alive] % size] = arrays[name][alive]
        replay.pos, replay.full = kept["added"] % size, kept["added"] >= size
        self._segments = list(kept["segments"])
        return True


class KeepCheckpoints(BaseCallback):
    """Write a checkpoint between two rollouts, every so many seconds and when a signal asks for a stop."""

    def __init__(self, checkpoints: Checkpoints, learner: Learner, every: float, stop: Stop) -> None:
        super().__init__()
        self._checkpoints, self._learner, self._every, self._stop = checkpoints, learner, every, stop
        self._last = time.monotonic()
        self.seconds = 0.0
        """Spent on checkpoints."""

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        asked = self._stop.number
        if asked is None and time.monotonic() - self._last < self._every:
            return
        begin = time.monotonic()
        self._checkpoints.write(self._learner)
        self._last = time.monotonic()
        self.seconds += self._last - begin
        if asked is not None:
            raise Stopped(asked)


def _of_model(model: Model) -> Memory:
    if isinstance(model, BaseAlgorithm):
        return of_learner(model)
    assert isinstance(model, Remembers)
    return model.memory()


def _into_model(model: Model, memory: Memory) -> None:
    if isinstance(model, BaseAlgorithm):
        into_learner(model, memory)
    else:
        assert isinstance(model, Remembers)
        model.recall(memory)


def _storable(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    array = np.require(array, requirements="C")  # unlike ascontiguousarray, leaves an array of no dimension as it is
    return array.view(np.float64) if np.iscomplexobj(array) else array


def _write(path: Path, data: bytes) -> None:
    """Write a file, and do not return before it is on the disk."""
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def _card(place: Path) -> dict[str, Any] | None:
    """The card of a checkpoint; None if it is damaged."""
    try:
        outer = json.loads((place / CARD).read_bytes())
        text = outer["card"]
        if sha256(text.encode()).hexdigest() != outer["sha256"]:
            return None
        card: dict[str, Any] = json.loads(text)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return card


def _read(place: Path) -> tuple[dict[str, Any], dict[str, np.ndarray[Any, Any]]] | None:
    """Card and arrays of a checkpoint; None if anything of it is damaged."""
    card = _card(place)
    if card is None:
        return None
    try:
        data = (place / ARRAYS).read_bytes()
        if sha256(data).hexdigest() != card["arrays"]:
            return None
        arrays = load_arrays(data)
    except (OSError, SafetensorError):
        return None
    whole = set(card["complex"])
    return card, {name: array.view(np.complex128) if name in whole else array for name, array in arrays.items()}
