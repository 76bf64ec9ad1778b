"""Recurrent agents as actors of Stable-Baselines3: what is learned is the perceptron, what the memory does stays.

A row's observation is what the perceptron sees, ``RecurrentFeatures``, and then what is for critics alone. The mean
action is the agent's output. It counts up to ±1; actions go a little further, so that these are not at the ends of
SAC's tanh.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import Any, Final

import torch
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.sac.policies import Actor as SACActor
from torch import nn
from torch.optim import Optimizer

from agents.learned.recurrent_network import LOAD_FEATURES, LOAD_NUMBERS, Load, RecurrentNetwork
from train.learn.actor_critic import (
    ActionCriticLatent,
    CriticLatent,
    TwoPathPolicy,
    TwoPathSACPolicy,
    aligned,
    constant,
)

REACH: Final = 1.25
"""How far actions go; what is beyond 1 the winch cannot follow."""
FARTHEST: Final = 1.2
"""How far the mean does where it passes through tanh."""


class First(nn.Module):
    """The first ones of x, those that are the agent's."""

    def __init__(self, inputs: int) -> None:
        super().__init__()
        self._inputs = inputs

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return (N, inputs)."""
        return aligned(x[:, : self._inputs])


class Share(nn.Module):
    """Mean action of a copy of a recurrent network."""

    def __init__(self, network: RecurrentNetwork, *, squashed: bool) -> None:
        """``squashed``: the action will pass through tanh and be stretched to ± ``REACH``."""
        super().__init__()
        self.network = deepcopy(network)
        self._squashed = squashed

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the mean (N, 1).

        Gradients that are mostly noise must not come through one-sided, as those of ``train.apg`` do: what leads back
        inside would always win.
        """
        share = self.network.act(x)[:, None]
        return torch.atanh(share.clamp(-FARTHEST, FARTHEST) / REACH) if self._squashed else share


class CriticView(nn.Module):
    """What critics see of x: the features of the load in the place of its numbers, and all the rest."""

    MORE: Final = LOAD_FEATURES - LOAD_NUMBERS

    def __init__(self, actor_inputs: int) -> None:
        super().__init__()
        self._before, self._after = actor_inputs - LOAD_NUMBERS, actor_inputs

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return (N, inputs + ``MORE``)."""
        load = Load.of(x[:, self._before : self._after])
        return torch.cat([x[:, : self._before], load.features(load.regulating()), x[:, self._after :]], dim=1)


class ShareExtractor(nn.Module):
    """What the actor sees, and the latent of the critic."""

    def __init__(self, inputs: int, actor_inputs: int, hidden: int) -> None:
        super().__init__()
        self.actor = First(actor_inputs)
        self.critic = nn.Sequential(CriticView(actor_inputs), CriticLatent(inputs + CriticView.MORE, hidden))
        self.latent_dim_pi = actor_inputs
        self.latent_dim_vf = hidden + 2 * (inputs + CriticView.MORE)

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Latents of actor and critic."""
        return self.forward_actor(x), self.forward_critic(x)

    def forward_actor(self, x: torch.Tensor) -> torch.Tensor:
        """What the actor sees."""
        seen: torch.Tensor = self.actor(x)
        return seen

    def forward_critic(self, x: torch.Tensor) -> torch.Tensor:
        """Latent of the critic."""
        latent: torch.Tensor = self.critic(x)
        return latent


SLOWER: Final = "slower"
"""Key of an optimiser's group whose learning rate is a share of that of all."""


def slow_down(optimizers: Optimizer | list[Optimizer]) -> None:
    """Make rates slower, where groups are to be slower, that were set to the same one for all."""
    for optimizer in optimizers if isinstance(optimizers, list) else [optimizers]:
        for group in optimizer.param_groups:
            group["lr"] *= group.get(SLOWER, 1.0)


class SharePolicy(TwoPathPolicy):
    """PPO's policy: a recurrent agent's perceptron, and a critic of its own."""

    def __init__(self, *args: Any, network: RecurrentNetwork, actor_rate: float, **kwargs: Any) -> None:
        """``actor_rate``: learning rate of the actor, as a share of the critic's."""
        self._actor_rate = actor_rate
        self._make_share: Callable[[], Share] = partial(Share, network, squashed=False)
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = ShareExtractor(  # type: ignore[assignment]
            self.features_dim, self._actor_inputs, self._hidden
        )

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        self.action_net = self._make_share()
        actor = [*self.action_net.parameters(), self.log_std]
        ours = set(map(id, actor))
        critic = [parameter for parameter in self.parameters() if id(parameter) not in ours]
        groups: list[dict[str, Any]] = [{"params": actor, SLOWER: self._actor_rate}, {"params": critic}]
        self.optimizer = self.optimizer_class(groups, lr=lr_schedule(1), **self.optimizer_kwargs)  # type: ignore[call-arg]

    def to_actor(self) -> nn.Module:
        """Return the agent's network, a copy."""
        assert isinstance(self.action_net, Share)
        return deepcopy(self.action_net.network)


class ShareSACPolicy(TwoPathSACPolicy):
    """SAC's policy: a recurrent agent's perceptron, and critics of its own."""

    def __init__(
        self, *args: Any, network: RecurrentNetwork, actor_rate: float, log_std_init: float, **kwargs: Any
    ) -> None:
        """``log_std_init``: logarithm of the first standard deviation of an action about zero."""
        self._actor_rate = actor_rate
        self._make_share: Callable[[], Share] = partial(Share, network, squashed=True)
        self._log_std_init = log_std_init
        super().__init__(*args, **kwargs)

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        for group in self.actor.optimizer.param_groups:
            group[SLOWER] = self._actor_rate

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> SACActor:
        """Return an actor that does what the agent does, and something near it."""
        actor = super().make_actor(features_extractor)
        actor.latent_pi = First(self._actor_inputs)  # type: ignore[assignment]
        actor.mu = self._make_share()
        actor.log_std = constant(self._actor_inputs, self._log_std_init - math.log(REACH))  # type: ignore[assignment]
        return actor

    def _make_value(self, inputs: int) -> nn.Module:
        latent = ActionCriticLatent(inputs + CriticView.MORE, self._critic_hidden)
        return nn.Sequential(CriticView(self._actor_inputs), latent, nn.Linear(latent.outputs, 1))

    def to_actor(self) -> nn.Module:
        """Return the agent's network, a copy."""
        share = self.actor.mu
        assert isinstance(share, Share)
        return deepcopy(share.network)
