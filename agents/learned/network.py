"""The networks of the agents: a multilayer perceptron beside a linear path.

A good drum speed is close to linear in the pulley's velocity and the load's state, and the value of a state is
close to a quadratic form: the linear path (and, for the value, the squares) leave the perceptron only the rest.
"""

from __future__ import annotations

import torch
from torch import nn


def perceptron(inputs: int, hidden: int) -> nn.Sequential:
    """Two hidden layers of ``hidden`` units, tanh."""
    return nn.Sequential(nn.Linear(inputs, hidden), nn.Tanh(), nn.Linear(hidden, hidden), nn.Tanh())


class Actor(nn.Module):
    """Deterministic actor: features (N, inputs) → share of the drum's speed limit (N, 1), in [-1, 1]."""

    def __init__(self, inputs: int, hidden: int, *, squashed: bool = False) -> None:
        """``squashed``: the output passes through tanh instead of being clipped."""
        super().__init__()
        self.squashed = squashed
        self.perceptron = perceptron(inputs, hidden)
        self.head = nn.Linear(hidden + inputs, 1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the action for features x (N, inputs)."""
        output = self.head(torch.cat([self.perceptron(x), x], dim=-1))
        return torch.tanh(output) if self.squashed else torch.clamp(output, -1.0, 1.0)
