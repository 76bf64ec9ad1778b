"""The agents' networks in Stable-Baselines3's terms, and back.

A learner's observation is the agent's features, followed, where the agent sees sensors only, by those of the full
state: the critics see both, the actor the first alone (an asymmetric actor-critic). The critics are not part of the
agent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy, ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor as SACActor
from stable_baselines3.sac.policies import SACPolicy
from torch import nn

from agents.learned.network import Actor, perceptron


def aligned(x: torch.Tensor) -> torch.Tensor:
    """A copy that begins where PyTorch's own tensors do, at a multiple of 64 bytes.

    The last bits of a product with two or three rows depend on that, and NumPy's arrays lie where they happen to: a
    training could not be repeated.
    """
    return x.clone(memory_format=torch.contiguous_format)


class ActorLatent(nn.Module):
    """The perceptron's output beside its inputs, which are the first ones of x."""

    def __init__(self, inputs: int, hidden: int) -> None:
        super().__init__()
        self.inputs = inputs
        self.perceptron = perceptron(inputs, hidden)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the latent (N, hidden + inputs)."""
        x = aligned(x[:, : self.inputs])
        return torch.cat([self.perceptron(x), x], dim=-1)


class CriticLatent(nn.Module):
    """The perceptron's output beside its inputs and their squares."""

    def __init__(self, inputs: int, hidden: int) -> None:
        super().__init__()
        self.perceptron = perceptron(inputs, hidden)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the latent (N, hidden + 2 inputs)."""
        x = aligned(x)
        return torch.cat([self.perceptron(x), x, torch.clamp(x * x, max=10.0)], dim=-1)


class ActionCriticLatent(nn.Module):
    """As ``CriticLatent``, and the products of the action, the last input, with the others.

    Where the value is close to a quadratic form, the best action is close to linear in the state: these products are
    what it takes to say so.
    """

    def __init__(self, inputs: int, hidden: int) -> None:
        super().__init__()
        self.states = CriticLatent(inputs, hidden)
        self.outputs = hidden + 3 * inputs - 1

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the latent (N, hidden + 3 inputs - 1)."""
        return torch.cat([self.states(x), torch.clamp(x[:, :-1] * x[:, -1:], -10.0, 10.0)], dim=-1)


def constant(inputs: int, value: float) -> nn.Linear:
    """A linear layer that begins with the same output whatever its inputs."""
    layer = nn.Linear(inputs, 1)
    nn.init.zeros_(layer.weight)
    nn.init.constant_(layer.bias, value)
    return layer


def actor_of(latent: ActorLatent, head: Mapping[str, torch.Tensor], *, squashed: bool) -> Actor:
    """The agent's network, from a learner's actor."""
    with torch.random.fork_rng(devices=()):  # a look at the agent must not change how the learner goes on
        actor = Actor(latent.inputs, latent.perceptron[0].out_features, squashed=squashed)  # type: ignore[arg-type]
    actor.perceptron.load_state_dict(latent.perceptron.state_dict())
    actor.head.load_state_dict(head)
    return actor


class TwoPathExtractor(nn.Module):
    """Latents of actor and critic."""

    def __init__(self, inputs: int, actor_inputs: int, hidden: int) -> None:
        super().__init__()
        self.actor = ActorLatent(actor_inputs, hidden)
        self.critic = CriticLatent(inputs, hidden)
        self.latent_dim_pi = hidden + actor_inputs
        self.latent_dim_vf = hidden + 2 * inputs

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Latents of actor and critic."""
        return self.forward_actor(x), self.forward_critic(x)

    def forward_actor(self, x: torch.Tensor) -> torch.Tensor:
        """Latent of the actor."""
        latent: torch.Tensor = self.actor(x)
        return latent

    def forward_critic(self, x: torch.Tensor) -> torch.Tensor:
        """Latent of the critic."""
        latent: torch.Tensor = self.critic(x)
        return latent


class TwoPathPolicy(ActorCriticPolicy):
    """PPO's policy on ``TwoPathExtractor``."""

    def __init__(
        self,
        observation_space: Any,
        action_space: Any,
        lr_schedule: Callable[[float], float],
        *,
        actor_inputs: int,
        hidden: int,
        **kwargs: Any,
    ) -> None:
        self._actor_inputs = actor_inputs
        self._hidden = hidden
        super().__init__(observation_space, action_space, lr_schedule, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = TwoPathExtractor(  # type: ignore[assignment]
            self.features_dim, self._actor_inputs, self._hidden
        )

    def freeze_actor(self, frozen: bool) -> None:
        """Keep the actor as it is, or let it learn again."""
        for part in (self.mlp_extractor.actor, self.action_net):
            part.requires_grad_(not frozen)
        self.log_std.requires_grad_(not frozen)

    def to_actor(self) -> nn.Module:
        """Return the mean action as a plain network of its own."""
        latent = self.mlp_extractor.actor
        assert isinstance(latent, ActorLatent)
        return actor_of(latent, self.action_net.state_dict(), squashed=False)


class TwoPathSACPolicy(SACPolicy):
    """SAC's policy: the actor of ``Actor``, critics with a quadratic path."""

    def __init__(
        self,
        observation_space: Any,
        action_space: Any,
        lr_schedule: Callable[[float], float],
        *,
        actor_inputs: int,
        hidden: int,
        critic_hidden: int,
        **kwargs: Any,
    ) -> None:
        self._actor_inputs = actor_inputs
        self._hidden = hidden
        self._critic_hidden = critic_hidden
        super().__init__(observation_space, action_space, lr_schedule, **kwargs)

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> SACActor:
        """Return an actor with a linear path; its first standard deviation is the entropy target's or so."""
        actor = super().make_actor(features_extractor)
        latent = self._actor_inputs + self._hidden
        actor.latent_pi = ActorLatent(self._actor_inputs, self._hidden)  # type: ignore[assignment]
        actor.mu = constant(latent, 0.0)
        actor.log_std = constant(latent, -1.5)  # type: ignore[assignment]
        return actor

    def make_critic(self, features_extractor: BaseFeaturesExtractor | None = None) -> ContinuousCritic:
        """Return two critics with linear and quadratic paths, the action's products with the state among them."""
        critic = super().make_critic(features_extractor)
        inputs = critic.features_extractor.features_dim + 1
        for i in range(critic.n_critics):
            network = self._make_value(inputs)
            critic.q_networks[i] = network
            setattr(critic, f"qf{i}", network)
        return critic

    def _make_value(self, inputs: int) -> nn.Module:
        """A critic's network of so many inputs, the action the last."""
        latent = ActionCriticLatent(inputs, self._critic_hidden)
        return nn.Sequential(latent, nn.Linear(latent.outputs, 1))

    def to_actor(self) -> nn.Module:
        """Return the mean action as a plain network of its own."""
        latent = self.actor.latent_pi
        assert isinstance(latent, ActorLatent)
        return actor_of(latent, self.actor.mu.state_dict(), squashed=True)
