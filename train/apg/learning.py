"""What a recurrent agent learns from recordings: to foretell, to imitate the teacher, to raise its score."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from agents.learned.recurrent_inputs import RATES_AHEAD, RISES_AHEAD
from agents.learned.recurrent_network import Load, RecurrentNetwork, clip_one_sided
from train.apg.data import Array, Recordings
from train.apg.options import ApgOptions
from train.apg.teacher import Teacher
from train.apg.twin import roll_out

Report = Callable[[str], object]
"""Is told a figure after each step."""
Labels = dict[str, Array]
"""``episode``, ``step``, ``estimate``, ``reckoned`` and ``share`` (M, …): what the network sees of load and drum,
and what ``Teacher.share`` says."""

RISES_WEIGHT: Final = 0.3
"""Weight of a rise's squared error, m², beside that of a rate, m²/s²."""
FARTHEST: Final = 8.0
"""Depth error beyond which a state teaches nothing, m: the load is lost."""
LEAST_SHARE: Final = -0.5
"""Share of the ceiling below which an episode pulls no more."""
CHUNK: Final = 250
"""Episodes that are rolled out at a time where nothing is learned."""


def set_rate(optimiser: torch.optim.Optimizer, rate: float, done: float) -> None:
    """Let a learning rate fall linearly to a thirtieth; ``done``: share of the stage."""
    for group in optimiser.param_groups:
        group["lr"] = rate * max(1.0 - done, 1.0 / 30.0)


def fit_forecaster(network: RecurrentNetwork, recordings: Recordings, options: ApgOptions, report: Report) -> None:
    """Teach the network's memory what the pulley is about to do."""
    rng = np.random.default_rng([options.seed, 1])
    parameters = [*network.gru.parameters(), *network.forecast.parameters()]
    optimiser = torch.optim.Adam(parameters, options.forecaster_rate)
    steps = np.arange(recordings.rise.shape[1])[:, None]
    rates_at, rises_at = (
        steps + np.rint(np.array(at) / recordings.period).astype(int) for at in (RATES_AHEAD, RISES_AHEAD)
    )
    weight = torch.tensor([1.0] * len(RATES_AHEAD) + [RISES_WEIGHT] * len(RISES_AHEAD))
    for step in range(options.forecaster_steps):
        r = recordings.rows(rng.permutation(len(recordings.still))[: options.forecaster_batch])
        rises = r.path[:, rises_at] - r.path[:, steps]
        true = np.concatenate([r.path_speed[:, rates_at], rises], axis=-1).astype(np.float32)
        context, _ = network.remember(torch.from_numpy(r.series), torch.from_numpy(r.figures))
        loss = (weight * (network.forecasts(context) - torch.from_numpy(true)) ** 2).mean()
        set_rate(optimiser, options.forecaster_rate, step / options.forecaster_steps)
        _descend(optimiser, parameters, loss, 1.0)
        report(f"squared error {loss.item():.4f}")


def ask_teacher(network: RecurrentNetwork, recordings: Recordings, options: ApgOptions, number: int) -> Labels:
    """Let the network act on the twin, and the teacher say what would have been best, in round ``number``."""
    rng = np.random.default_rng([options.seed, 2, number])
    with torch.no_grad():
        visited = [roll_out(network, recordings.rows(rows), keep=True) for rows in _chunks(len(recordings.still))]
    z, estimate, speed, reckoned = (
        np.concatenate([each.numpy() for each in kept]) for kept in tuple(zip(*visited, strict=True))[1:]
    )
    place = rng.permutation(speed.size)[: options.labels]
    episode, step = np.divmod(place, speed.shape[1])
    near = abs(z[episode, step, 0]) < FARTHEST
    episode, step = episode[near], step[near]
    z, estimate, speed, reckoned = (each[episode, step] for each in (z, estimate, speed, reckoned))
    states = (each.astype(np.float64) for each in (z, speed, reckoned))
    share = Teacher(recordings).share(episode, step, *states).astype(np.float32)
    said = np.isfinite(share)
    labels = {"episode": episode, "step": step, "estimate": estimate, "reckoned": reckoned, "share": share}
    return {name: array[said] for name, array in labels.items()}


def imitate(
    network: RecurrentNetwork, recordings: Recordings, asked: list[Labels], options: ApgOptions, report: Report
) -> None:
    """Fit the perceptron to what the teacher said in all rounds so far; what the network remembers stays as it is."""
    rng = np.random.default_rng([options.seed, 3, len(asked)])
    with torch.no_grad():
        context = torch.cat(
            [
                network.remember(torch.from_numpy(recordings.series[rows]), torch.from_numpy(recordings.figures[rows]))[
                    0
                ]
                # In half precision: all of them are kept at once.
                .half()
                for rows in _chunks(len(recordings.still))
            ]
        )
    r = recordings.tensors()
    labels = {name: torch.from_numpy(np.concatenate([each[name] for each in asked])) for name in asked[0]}
    parameters = [
        parameter
        for part in (network.of_context, network.of_load, network.second, network.last)
        for parameter in part.parameters()
    ]
    optimiser = torch.optim.Adam(parameters, options.imitation_rate)
    for step in range(options.imitation_steps):
        some = torch.from_numpy(rng.integers(len(labels["share"]), size=options.imitation_batch))
        episode, at = labels["episode"][some], labels["step"][some]
        seen = Load(
            labels["estimate"][some],
            r["rise"][episode, at],
            labels["reckoned"][some],
            r["gains"][episode],
            r["told_change"][episode],
            r["told_speed"][episode],
            r["told_lag"][episode],
        )
        share = network.share(network.prepare(context[episode, at].float()), seen)
        loss = ((clip_one_sided(share, torch.ones_like(share)) - labels["share"][some]) ** 2).mean()
        set_rate(optimiser, options.imitation_rate, step / options.imitation_steps)
        _descend(optimiser, parameters, loss, 1.0)
        report(f"squared error {loss.item():.4f}")


def shortfall(shares: torch.Tensor, options: ApgOptions) -> torch.Tensor:
    """What is missing from the ceiling, in the mean and in that of the worst cases: the loss, and what is chosen by."""
    missing = (1.0 - shares).clamp(max=1.0 - LEAST_SHARE)
    worst = missing.topk(max(1, round(options.tail * len(missing)))).values
    return missing.mean() + options.tail_weight * worst.mean()


class Climb:
    """Descent of the shortfall through the twin, update by update; where it stands is a handful of arrays."""

    def __init__(self, network: RecurrentNetwork, recordings: Recordings, options: ApgOptions) -> None:
        self._network, self._recordings, self._options = network, recordings, options
        self._parameters = list(network.parameters())
        self._optimiser = torch.optim.Adam(self._parameters, options.rate)
        self.updates = 0

    def update(self) -> float:
        """Make an update; return the mean share of the ceiling in its episodes."""
        options, count = self._options, len(self._recordings.still)
        batch = min(options.batch, count)
        # Every episode once before any comes again.
        lap, place = divmod(self.updates, count // batch)
        order = np.random.default_rng([options.seed, 4, lap]).permutation(count)
        episodes = self._recordings.rows(order[place * batch : (place + 1) * batch])
        shares = episodes.shares(roll_out(self._network, episodes).rms)
        set_rate(self._optimiser, options.rate * min(1.0, (self.updates + 1) / 10), self.updates / options.updates)
        _descend(self._optimiser, self._parameters, shortfall(shares, options), 0.5)
        self.updates += 1
        return float(shares.detach().mean())

    def state(self) -> dict[str, Array]:
        """Arrays to go on from."""
        arrays = {f"network/{name}": each.numpy() for name, each in self._network.state_dict().items()}
        for number, state in self._optimiser.state_dict()["state"].items():
            arrays |= {f"optimiser/{number}/{name}": each.numpy() for name, each in state.items()}
        return arrays | {"updates": np.array(self.updates)}

    def restore(self, arrays: dict[str, Array]) -> None:
        """Go on from them."""
        self.updates = int(arrays["updates"])
        weights = {name.removeprefix("network/"): each for name, each in arrays.items() if name.startswith("network/")}
        self._network.load_state_dict({name: torch.from_numpy(each.copy()) for name, each in weights.items()})
        state: dict[int, dict[str, torch.Tensor]] = {}
        for name, each in arrays.items():
            if name.startswith("optimiser/"):
                _, number, key = name.split("/")
                state.setdefault(int(number), {})[key] = torch.from_numpy(each.copy())
        self._optimiser.load_state_dict({**self._optimiser.state_dict(), "state": state})


def _descend(optimiser: torch.optim.Optimizer, parameters: list[nn.Parameter], loss: torch.Tensor, most: float) -> None:
    """Take a step down a loss, its gradient no longer than ``most``; one that is no number is passed over."""
    optimiser.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call]
    if torch.isfinite(nn.utils.clip_grad_norm_(parameters, most)):
        optimiser.step()


def _chunks(count: int) -> Iterator[npt.NDArray[np.int64]]:
    for first in range(0, count, CHUNK):
        yield np.arange(first, min(count, first + CHUNK))
