"""Learned agents: safetensors and JSON on disk, a ``Policy`` in memory. Nothing in a file is executed."""

from __future__ import annotations

import hashlib
import json
import re
from copy import deepcopy
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors

from aframe_env.scenario.sensors import Sensors
from aframe_env.serialization import strict_converter, structure
from aframe_env.suite import find_task
from aframe_env.validation import InvalidValue
from agents import cards, shipped
from agents.control.expected_waves import ExpectedWaves
from agents.learned.feature_policy import OnFeatures
from agents.learned.feature_sets import feature_names
from agents.learned.features import WINCH_FEATURES, Action, FeatureConfig
from agents.learned.network import Actor
from agents.policy import FloatArray, Knowledge

FORMAT = 5
WEIGHTS = "agent.safetensors"
CARD = "agent.json"
_BLOCK = 64


@dataclass(frozen=True, kw_only=True)
class AgentCard:
    """Description of an agent: how to use it, and where it came from."""

    algorithm: str
    observation: str
    """"state" or "sensors"."""
    sensors: Sensors | None
    """The sensors that it was trained with."""
    waves: ExpectedWaves
    """The motion that its filters expect."""
    action: Action
    """What its output is, see ``FeatureConfig``."""
    features: tuple[str, ...]
    hidden: int
    control_period: float
    """s."""
    seed: int
    timesteps: int
    versions: dict[str, str]
    sha256: str
    """sha256 of the file of weights."""
    squashed: bool = False
    """True if the action passes through tanh instead of being clipped."""
    task: str = ""
    """What it was trained on: id of a task of the suite; empty for other scenarios."""
    adapts: bool = False
    """As in ``FeatureConfig``."""
    light: bool = True
    """As in ``FeatureConfig``."""
    format: int = FORMAT

    @property
    def made_for(self) -> FeatureConfig:
        """What its features are made for."""
        return FeatureConfig(
            control_period=self.control_period,
            sensors=self.sensors,
            waves=self.waves,
            action=self.action,
            winch=self.action != "predictive" and WINCH_FEATURES[-1] in self.features,
            adapts=self.adapts,
            light=self.light,
        )

    @property
    def name(self) -> str:
        """Name of the agent, as in "predictive PPO on sensors, trained on Storm"."""
        sensed = self.observation != "state"
        trained_on = f", trained on {find_task(self.task).name}" if self.task else ""
        return f"{self.algorithm} on sensors{trained_on}" if sensed else f"{self.algorithm}{trained_on}"


@dataclass
class LearnedPolicy(OnFeatures):
    """An agent as a policy: deterministic, and the same on every batch size."""

    actor: Actor
    card: AgentCard
    name: str = field(init=False)
    knows: Knowledge = field(init=False)

    def __post_init__(self) -> None:
        super().__init__(self.card.name, self.card.made_for)
        expected = feature_names(self.card.made_for)
        if self.card.features != expected:
            raise InvalidValue(f"the agent's features are {self.card.features}, this version makes {expected}")

    def exact(self) -> LearnedPolicy:
        """The same policy with its network in double precision.

        Near the winch's limit a command goes with the root of what is asked of the drum: there the last digit of a
        network in single precision, which depends on the processor, is seen.
        """
        return LearnedPolicy(deepcopy(self.actor).double(), self.card)

    def _output(self, inputs: npt.NDArray[np.float32]) -> FloatArray:
        # In blocks of one size: how a matrix product is summed depends on its shape, and a row must not on the others.
        rows = len(inputs)
        precision = next(self.actor.parameters()).dtype
        padded = torch.zeros((-(-rows // _BLOCK) * _BLOCK, inputs.shape[1]), dtype=precision)
        padded[:rows] = torch.from_numpy(inputs)
        with torch.no_grad():
            blocks = [self.actor(block) for block in torch.split(padded, _BLOCK)]
        return np.asarray(torch.cat(blocks)[:rows, 0].double().numpy())


def serialise(actor: Actor) -> bytes:
    """Weights as the bytes of a safetensors file. Raises ``InvalidValue`` for weights that are no numbers."""
    if not all(torch.isfinite(weights).all() for weights in actor.state_dict().values()):
        raise InvalidValue(
            "the network's weights are not finite: the training has diverged; try a smaller learning rate"
        )
    return save_tensors({k: v.contiguous() for k, v in actor.state_dict().items()})


def digest(weights: bytes) -> str:
    """sha256 of a file of weights."""
    return hashlib.sha256(weights).hexdigest()


def card_text(card: AgentCard) -> str:
    """The card as JSON with its digest, lists of numbers on a line each."""
    return one_line_lists(json.dumps(cards.sealed(asdict(card)), indent=2, ensure_ascii=False)) + "\n"


def one_line_lists(text: str) -> str:
    """Indented JSON with lists of numbers on a line each."""
    return re.sub(r"\[[^\[\]\"{}]*\]", lambda numbers: f"[{' '.join(numbers[0][1:-1].split())}]", text)


def seeds(folder: str | Path) -> list[Path]:
    """Folders of the agents in a folder that training with several seeds wrote, the lowest seed first."""
    numbered = {int(path.name[5:]): path for path in Path(folder).glob("seed-*") if path.name[5:].isdigit()}
    return [numbered[seed] for seed in sorted(numbered)]


def load(agent: str | Path) -> LearnedPolicy:
    """Load a shipped agent by its name, as "ppo-sensors", or one from its folder.

    The lowest seed where there are several. Raises InvalidValue where there is none, a card that was altered, or files
    that do not belong together.
    """
    path = shipped.folder(agent)
    if not path.is_dir():
        names = ", ".join(map(repr, shipped.AGENTS))
        raise InvalidValue(f"agent = {str(agent)!r}: must be one of {names}, or the folder of an agent")
    if not (path / CARD).is_file() and seeds(path):
        path = seeds(path)[0]
    try:
        weights = (path / WEIGHTS).read_bytes()
    except OSError as error:
        raise InvalidValue(f"no agent in {str(path)!r}: {WEIGHTS}: {error.strerror}") from error
    card = structure(strict_converter(), cards.read(path / CARD, "agent", FORMAT), AgentCard, str(path / CARD))
    if digest(weights) != card.sha256:
        raise InvalidValue(f"{path / WEIGHTS}: does not match the sha256 in {CARD}: damaged or not its file")
    actor = Actor(len(card.features), card.hidden, squashed=card.squashed)
    try:
        actor.load_state_dict(load_tensors(weights))
    except (RuntimeError, SafetensorError) as error:
        raise InvalidValue(f"{path / WEIGHTS}: not the weights of the network in {CARD}: {error}") from error
    return LearnedPolicy(actor, card)


def output_zero(config: FeatureConfig) -> LearnedPolicy:
    """Return an agent whose network says nothing: the hand-written base of all agents, alone.

    What a trained agent removes beyond this is learned.
    """
    sensors = config.sensors
    features = feature_names(config)
    actor = Actor(len(features), 1)
    for parameter in actor.parameters():
        torch.nn.init.zeros_(parameter)
    card = AgentCard(
        algorithm="output zero",
        observation="state" if sensors is None else "sensors",
        sensors=sensors,
        waves=config.waves,
        action=config.action,
        features=features,
        hidden=1,
        control_period=config.control_period,
        seed=0,
        timesteps=0,
        versions={},
        sha256=digest(serialise(actor)),
        adapts=config.adapts,
        light=config.light,
    )
    return LearnedPolicy(actor, card)
