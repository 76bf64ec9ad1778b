"""What a learner has learned: the agent as a policy, and as files."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from aframe_env.suite import find_task
from agents.learned.agent import CARD, WEIGHTS, AgentCard, LearnedPolicy, card_text, digest, serialise
from agents.learned.feature_sets import feature_names
from agents.learned.features import Action
from agents.learned.network import Actor
from train.learn.learner import Learner
from train.learn.options import LearningOptions
from train.shared.run_folder import versions, write_atomically, write_text

AGENT_NAMES: Final[dict[Action, str]] = {
    "speed": "{}",
    "residual": "residual {}",
    "predictive": "predictive {}",
}
"""Names of agents by their action, to be filled in with the learner's."""


def to_policy(learner: Learner, options: LearningOptions) -> tuple[LearnedPolicy, bytes]:
    """The agent as it is, as a policy, and the bytes of its weights."""
    return _policy(learner.to_actor(), learner, options, learner.model.num_timesteps)


def best_policy(learner: Learner, options: LearningOptions) -> tuple[LearnedPolicy, bytes]:
    """The best agent that was looked at, or the one that is there if none was."""
    best = learner.best
    return to_policy(learner, options) if best.actor is None else _policy(best.actor, learner, options, best.timesteps)


def _policy(actor: Actor, learner: Learner, options: LearningOptions, timesteps: int) -> tuple[LearnedPolicy, bytes]:
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
        task="" if options.task is None else find_task(options.task).id,
        adapts=options.features.adapts,
        light=options.features.light,
    )
    return LearnedPolicy(actor, card), weights


def save(folder: Path, policy: LearnedPolicy, weights: bytes) -> None:
    """Write the agent: weights first, the card that vouches for them last."""
    write_atomically(folder / WEIGHTS, lambda path: path.write_bytes(weights))
    write_text(folder / CARD, card_text(policy.card))
