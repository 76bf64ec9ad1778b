"""What a learner has learned: the agent as a policy, and as files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from torch import nn

from agents.learned import recurrent
from agents.learned.agent import CARD, WEIGHTS, AgentCard, LearnedPolicy, card_text, digest, load, serialise
from agents.learned.feature_sets import feature_names
from agents.learned.features import Action
from agents.learned.network import Actor
from agents.learned.recurrent import RecurrentPolicy
from agents.learned.recurrent_network import RecurrentNetwork
from train.learn.learner import Learner
from train.learn.options import LearningOptions
from train.shared.run_folder import versions, write_agent

Trained = LearnedPolicy | RecurrentPolicy

AGENT_NAMES: Final[dict[Action, str]] = {
    "speed": "{}",
    "residual": "residual {}",
    "predictive": "predictive {}",
}
"""Names of agents by their action, to be filled in with the learner's."""


def to_policy(learner: Learner, options: LearningOptions) -> tuple[Trained, bytes]:
    """The agent as it is, as a policy, and the bytes of its weights."""
    return _policy(learner.to_actor(), learner, options, learner.model.num_timesteps)


def best_policy(learner: Learner, options: LearningOptions) -> tuple[Trained, bytes]:
    """The best agent that was looked at, or the one that is there if none was."""
    best = learner.best
    return to_policy(learner, options) if best.actor is None else _policy(best.actor, learner, options, best.timesteps)


def _policy(actor: nn.Module, learner: Learner, options: LearningOptions, timesteps: int) -> tuple[Trained, bytes]:
    if isinstance(actor, RecurrentNetwork):
        return _recurrent(actor, learner, options, timesteps)
    assert isinstance(actor, Actor)
    weights = serialise(actor)
    card = AgentCard(
        algorithm=AGENT_NAMES[options.action].format(learner.algorithm),
        observation=options.observation,
        sensors=options.features.sensors,
        waves=options.features.waves,
        action=options.action,
        features=feature_names(options.features),
        hidden=options.hidden,
        squashed=actor.squashed,
        control_period=options.control_period,
        seed=options.seed,
        timesteps=timesteps,
        versions=versions(),
        sha256=digest(weights),
        task=options.task_id,
        adapts=options.features.adapts,
        light=options.features.light,
    )
    return LearnedPolicy(actor, card), weights


def _recurrent(
    network: RecurrentNetwork, learner: Learner, options: LearningOptions, timesteps: int
) -> tuple[RecurrentPolicy, bytes]:
    assert options.start is not None
    weights, begun = recurrent.serialise(network), options.start.card
    card = replace(
        begun,
        algorithm=f"recurrent {learner.algorithm} from {begun.algorithm.removeprefix('recurrent ')}",
        task=options.task_id,
        seed=options.seed,
        versions=versions(),
        sha256=digest(weights),
        started_from=f"{begun.algorithm}, {begun.sha256}",
        timesteps=timesteps,
    )
    return RecurrentPolicy(network, card), weights


def save(folder: Path, policy: Trained, weights: bytes) -> Path:
    """Write the agent; return the place of the weights."""
    if isinstance(policy, RecurrentPolicy):
        place, card, text = folder / recurrent.WEIGHTS, recurrent.CARD, recurrent.card_text(policy.card)
    else:
        place, card, text = folder / WEIGHTS, CARD, card_text(policy.card)
    write_agent(place, weights, folder / card, text)
    return place


def load_trained(folder: Path) -> Trained:
    """Load what ``save`` wrote."""
    return recurrent.load(folder) if (folder / recurrent.CARD).is_file() else load(folder)
