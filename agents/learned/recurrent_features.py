"""What a recurrent agent's perceptron sees: what its memory made of the readings, and the numbers of load and drum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt
import torch

from agents.control.filters import ALL, FloatArray, Rows
from agents.control.lift import Lift
from agents.control.regulator import Observation
from agents.learned.recurrent_inputs import Lookout, LookoutConfig, Outlook
from agents.learned.recurrent_network import LOAD_NUMBERS, RecurrentNetwork

Float32Array = npt.NDArray[np.float32]

BLOCK: Final = 64
"""Rows that pass through a network together: how a matrix product is summed depends on its shape, and a row must not on
the others."""


def in_blocks(values: npt.NDArray[np.floating]) -> tuple[torch.Tensor, ...]:
    """Rows (N, …) in whole blocks; what is added to fill the last repeats the first row."""
    more = -len(values) % BLOCK
    filled = np.concatenate([values, np.repeat(values[:1], more, axis=0)])
    return torch.split(torch.from_numpy(filled.astype(np.float32)), BLOCK)


class Memories:
    """What a network's GRU remembers of N rows, each for itself; it learns nothing here."""

    def __init__(self, rows: int, network: RecurrentNetwork) -> None:
        self._network = network
        self._memory = np.zeros((rows, network.memory_size), dtype=np.float32)

    def forget(self, rows: Rows) -> None:
        """Begin anew in these rows."""
        self._memory[rows] = 0.0

    def take(self, outlook: Outlook, figures: Float32Array, rows: Rows = ALL) -> Float32Array:
        """Contexts (n, C) of these rows at their ``outlook``, their lifts' ``figures`` (n, F)."""
        parts = (outlook.series, figures, self._memory[rows])
        with torch.no_grad():
            seen = [
                self._network.remember(series[:, None], told, memory[None])
                for series, told, memory in zip(*map(in_blocks, parts), strict=True)
            ]
        count = len(outlook.series)
        self._memory[rows] = torch.cat([last[0] for _, last in seen])[:count].numpy()
        return torch.cat([each[:, 0] for each, _ in seen])[:count].numpy()


class RecurrentFeatures:
    """Inputs of the perceptrons of N rows, whose memories are their own, and what their outputs ask of the winches."""

    def __init__(self, rows: int, config: LookoutConfig, network: RecurrentNetwork) -> None:
        """``network``: its GRU remembers for all rows."""
        self.rows = rows
        self.names = tuple(
            f"{kind}_{i}"
            for kind, count in (("context", network.context_size), ("load", LOAD_NUMBERS))
            for i in range(count)
        )
        self._lookout = Lookout(rows, config)
        self._memories = Memories(rows, network)

    def start(self, observation: Observation, lifts: Sequence[Lift], rows: Rows = ALL) -> Float32Array:
        """Inputs (n, I) at the first observations (n, K) of these ``rows``, whose past is forgotten."""
        outlook = self._lookout.start(observation, lifts, rows)
        self._memories.forget(rows)
        return self._look(outlook, rows)

    def advance(self, observation: Observation) -> Float32Array:
        """Inputs (N, I) of all rows, whose observations (N, K) are one control step later."""
        return self._look(self._lookout.advance(observation), ALL)

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        self._lookout.retune(rope_length, growth, wet)

    def command(self, output: FloatArray) -> FloatArray:
        """Drum speed commands (N,) rad/s for a network's output (N,), which counts up to ±1."""
        return self._lookout.command(output)

    def _look(self, outlook: Outlook, rows: Rows) -> Float32Array:
        lookout = self._lookout
        context = self._memories.take(outlook, lookout.figures[rows], rows)
        load = (
            outlook.z,
            outlook.rise[:, None],
            outlook.speed[:, None],
            lookout.gains[rows],
            lookout.most_change[rows, None],
            lookout.most_speed[rows, None],
            lookout.lag[rows, None],
        )
        return np.concatenate([context, *load], axis=1, dtype=np.float32)
