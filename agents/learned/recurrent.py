"""Recurrent agents: a policy with memory, and its files. Nothing in a file is executed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
import torch
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors

from aframe_env.scenario import Scenario
from aframe_env.scenario.sensors import Sensors
from aframe_env.serialization import strict_converter, structure
from aframe_env.validation import InvalidValue
from agents import cards
from agents.control.expected_waves import ExpectedWaves
from agents.learned.agent import digest, one_line_lists
from agents.learned.recurrent_features import RecurrentFeatures, in_blocks
from agents.learned.recurrent_inputs import LookoutConfig
from agents.learned.recurrent_network import RecurrentNetwork
from agents.policy import FloatArray, Knowledge

FORMAT: Final = 1
WEIGHTS: Final = "recurrent.safetensors"
CARD: Final = "recurrent.json"


@dataclass(frozen=True, kw_only=True)
class RecurrentCard:
    """Description of a recurrent agent: how to use it, and where it came from."""

    algorithm: str
    observation: str
    """"state" or "sensors"."""
    sensors: Sensors | None
    """The sensors that it was trained with."""
    waves: ExpectedWaves
    """The motion that its filters expect."""
    memory: int
    """Units of the GRU."""
    hidden: int
    """Units of each hidden layer of the perceptron."""
    control_period: float
    """s."""
    task: str
    """What it was trained on: id of a task of the suite; empty for other scenarios."""
    seed: int
    versions: dict[str, str]
    sha256: str
    """sha256 of the file of weights."""
    adapts: bool = False
    """Whether it reckons how much later than told readings and winch are."""
    chains: bool = False
    """Whether it reckons with the rope's mass and the water's drag."""
    started_from: str = ""
    """The agent that it began as, by its algorithm and the sha256 of its weights; empty for none."""
    timesteps: int = 0
    """Control steps that it has learned from since then, by trial in the environment."""
    format: int = FORMAT

    @property
    def made_for(self) -> LookoutConfig:
        """What its inputs are made for."""
        return LookoutConfig(
            control_period=self.control_period,
            sensors=self.sensors,
            waves=self.waves,
            adapts=self.adapts,
            chains=self.chains,
        )

    def network(self) -> RecurrentNetwork:
        """A network of this size, its weights still to be loaded."""
        return RecurrentNetwork(len(self.made_for.readings), self.memory, self.hidden)


@dataclass
class RecurrentPolicy:
    """A recurrent agent as a policy: deterministic, and the same on every batch size."""

    network: RecurrentNetwork
    card: RecurrentCard
    name: str = field(init=False)
    knows: Knowledge = field(init=False)
    _lifts: Sequence[Scenario] = field(init=False, repr=False, default=())
    _features: RecurrentFeatures | None = field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        sensed = self.card.sensors is not None
        self.name = f"{self.card.algorithm} on sensors" if sensed else self.card.algorithm
        self.knows = Knowledge.SENSORS if sensed else Knowledge.STATE

    def reset(self, scenarios: Sequence[Scenario], control_period: float) -> None:
        """Begin N episodes; of the scenarios the policy looks at what a ``Lift`` has alone."""
        trained = self.card.control_period
        if abs(control_period - trained) > 1e-9:
            raise InvalidValue(f"control_period = {control_period} s: the agent was trained for {trained} s")
        self._lifts, self._features = scenarios, None

    def act(self, observation: npt.NDArray[np.float32], time: float) -> FloatArray:
        """Drum speed commands (N,) rad/s; the first call since the last reset begins the memory."""
        if self._features is None:
            self._features = RecurrentFeatures(len(observation), self.card.made_for, self.network)
            inputs = self._features.start(observation, self._lifts)
        else:
            inputs = self._features.advance(observation)
        share = self._share(inputs)
        if not np.isfinite(share).all():
            raise InvalidValue(f"{self.name} gave an output that is not finite: must be in [-1, 1]")
        return self._features.command(share)

    def retune(self, rope_length: FloatArray, growth: FloatArray, wet: FloatArray) -> None:
        """Go on with other ropes and loads, as by ``HoistBatch.retune``."""
        if self._features is not None:
            self._features.retune(rope_length, growth, wet)

    def _share(self, inputs: npt.NDArray[np.float32]) -> FloatArray:
        with torch.no_grad():
            shares = [self.network.act(block) for block in in_blocks(inputs)]
        return np.asarray(torch.cat(shares)[: len(inputs)].double().numpy())


def serialise(network: RecurrentNetwork) -> bytes:
    """Weights as the bytes of a safetensors file. Raises ``InvalidValue`` for weights that are no numbers."""
    if not all(torch.isfinite(weights).all() for weights in network.state_dict().values()):
        raise InvalidValue("the network's weights are not finite: the training has diverged; try a smaller rate")
    return save_tensors({k: v.contiguous() for k, v in network.state_dict().items()})


def card_text(card: RecurrentCard) -> str:
    """The card as JSON with its digest."""
    return one_line_lists(json.dumps(cards.sealed(asdict(card)), indent=2, ensure_ascii=False)) + "\n"


def load(folder: Path) -> RecurrentPolicy:
    """Load the agent of a folder.

    Raises InvalidValue where there is none, for a card that was altered, or for files that do not belong together.
    """
    card = structure(strict_converter(), cards.read(folder / CARD, "agent", FORMAT), RecurrentCard, str(folder / CARD))
    try:
        weights = (folder / WEIGHTS).read_bytes()
    except OSError as error:
        raise InvalidValue(f"no agent in {str(folder)!r}: {WEIGHTS}: {error.strerror}") from error
    if digest(weights) != card.sha256:
        raise InvalidValue(f"{folder / WEIGHTS}: does not match the sha256 in {CARD}: damaged or not its file")
    network = card.network()
    try:
        network.load_state_dict(load_tensors(weights))
    except (RuntimeError, SafetensorError) as error:
        raise InvalidValue(f"{folder / WEIGHTS}: not the weights of the network in {CARD}: {error}") from error
    return RecurrentPolicy(network, card)
