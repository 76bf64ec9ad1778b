"""The agents' networks in Stable-Baselines3's terms, and back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import nn

from agents.network import Actor, perceptron


class TwoPathExtractor(nn.Module):
    """Latents of actor and critic: perceptron's output beside the inputs (and their squares, for the critic)."""

    def __init__(self, inputs: int, hidden: int) -> None:
        super().__init__()
        self.actor = perceptron(inputs, hidden)
        self.critic = perceptron(inputs, hidden)
        self.latent_dim_pi = hidden + inputs
        self.latent_dim_vf = hidden + 2 * inputs

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Latents of actor and critic."""
        return self.forward_actor(x), self.forward_critic(x)

    def forward_actor(self, x: torch.Tensor) -> torch.Tensor:
        """Latent of the actor, (N, hidden + inputs)."""
        return torch.cat([self.actor(x), x], dim=-1)

    def forward_critic(self, x: torch.Tensor) -> torch.Tensor:
        """Latent of the critic, (N, hidden + 2 inputs)."""
        return torch.cat([self.critic(x), x, torch.clamp(x * x, max=10.0)], dim=-1)


class TwoPathPolicy(ActorCriticPolicy):
    """Actor-critic policy on ``TwoPathExtractor``."""

    def __init__(
        self,
        observation_space: Any,
        action_space: Any,
        lr_schedule: Callable[[float], float],
        *,
        hidden: int,
        **kwargs: Any,
    ) -> None:
        self._hidden = hidden
        super().__init__(observation_space, action_space, lr_schedule, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = TwoPathExtractor(self.features_dim, self._hidden)  # type: ignore[assignment]

    def to_actor(self) -> Actor:
        """Return the mean action as a plain network of its own."""
        actor = Actor(self.features_dim, self._hidden)
        own = self.state_dict()
        actor.load_state_dict(
            {
                **{f"perceptron.{k}": own[f"mlp_extractor.actor.{k}"] for k in actor.perceptron.state_dict()},
                **{f"head.{k}": own[f"action_net.{k}"] for k in actor.head.state_dict()},
            }
        )
        return actor
