"""The recurrent agents' network: what it remembers of the waves, and what it does about the load."""

from __future__ import annotations

from typing import Any, NamedTuple

import torch
from torch import nn

from agents.learned.recurrent_inputs import FIGURES, FORECASTS

LOAD_FEATURES = 10
LOAD_NUMBERS = 13
"""Numbers in a ``Load`` of one lift."""


class OneSided(torch.autograd.Function):
    """Clip to ± a limit; where that bites, only a gradient that leads back inside comes through.

    Plain clipping lets none through, so that who asks for more than there is never learns to ask for less.
    """

    @staticmethod
    def forward(ctx: Any, value: torch.Tensor, limit: torch.Tensor) -> torch.Tensor:
        """``value`` within ± ``limit``, of one shape."""
        ctx.save_for_backward(value, limit)
        return torch.maximum(torch.minimum(value, limit), -limit)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None]:
        """Descent goes against the gradient: beyond the upper limit it must be positive."""
        value, limit = ctx.saved_tensors
        (gradient,) = gradients
        outwards = ((value > limit) & (gradient < 0.0)) | ((value < -limit) & (gradient > 0.0))
        return torch.where(outwards, torch.zeros_like(gradient), gradient), None


def clip_one_sided(value: torch.Tensor, limit: torch.Tensor) -> torch.Tensor:
    """Clip ``value`` to ± ``limit``, with ``OneSided`` gradients."""
    clipped: torch.Tensor = OneSided.apply(value, limit)  # type: ignore[no-untyped-call]
    return clipped


class Load(NamedTuple):
    """Load, drum and winch of B lifts, as the network sees them: tensors (B,) or (B, 4)."""

    z: torch.Tensor
    """(B, 4) estimated state of ``RopeModel``."""
    rise: torch.Tensor
    """Foretold mean speed of the pulley over the coming control step, m/s; at its end, where the winch lags."""
    speed: torch.Tensor
    """Of the rope at the drum, paid out, m/s, as reckoned."""
    gains: torch.Tensor
    """(B, 4) of the regulator."""
    most_change: torch.Tensor
    """Greatest change of the rope's speed in a control step, m/s."""
    most_speed: torch.Tensor
    """m/s."""
    lag: torch.Tensor
    """Of the winch, in control steps."""

    @classmethod
    def of(cls, numbers: torch.Tensor) -> Load:
        """From numbers (B, ``LOAD_NUMBERS``) one beside the other, in this order."""
        z, (rise, speed), gains = numbers[:, :4], numbers[:, 4:6].unbind(1), numbers[:, 6:10]
        return cls(z, rise, speed, gains, *numbers[:, 10:].unbind(1))

    def regulating(self) -> torch.Tensor:
        """Speed (B,) of the rope's end that the regulator asks for, m/s up."""
        return self.z[..., 3] - (self.gains * self.z).sum(-1)

    def features(self, p: torch.Tensor) -> torch.Tensor:
        """What a network is shown of it, (B, ``LOAD_FEATURES``), of order one; ``p`` as from ``regulating``."""
        z, change = self.z, self.most_change
        following, regulated = (self.rise - self.speed) / change, (self.rise - p - self.speed) / change
        return torch.stack(
            [
                4.0 * torch.tanh(0.5 * z[..., 0]),
                2.0 * torch.tanh(10.0 * z[..., 0]),
                3.0 * z[..., 1],
                10.0 * (z[..., 2] - z[..., 0]),
                2.0 * z[..., 3],
                self.speed,
                self.speed / self.most_speed,
                following.clamp(-4.0, 4.0),
                regulated.clamp(-4.0, 4.0),
                3.0 * p.clamp(-1.0, 1.0),
            ],
            dim=-1,
        )


class RecurrentNetwork(nn.Module):
    """A GRU on the series of an ``Outlook``, and a perceptron on what it remembers and on the load.

    The perceptron's three outputs weigh the regulator, correct the speed that is aimed at, and push the drum directly;
    while they are small the whole is nearly the regulator above a feed-forward of the pulley.
    """

    def __init__(self, readings: int, memory: int = 96, hidden: int = 128) -> None:
        """``readings``: numbers of the series beside the forecasts and the surprise."""
        super().__init__()
        self.memory_size, self.hidden_size = memory, hidden
        self.gru = nn.GRU(FORECASTS + readings + 1 + len(FIGURES), memory, batch_first=True)
        self.forecast = nn.Linear(memory, FORECASTS)
        self.of_context = nn.Linear(memory + FORECASTS + len(FIGURES), hidden)
        self.of_load = nn.Linear(LOAD_FEATURES, hidden, bias=False)
        self.second = nn.Linear(hidden, hidden)
        self.last = nn.Linear(hidden, 3)
        with torch.no_grad():
            self.forecast.weight.zero_()
            self.forecast.bias.zero_()
            self.last.weight.mul_(0.1)
            self.last.bias.zero_()

    def remember(
        self, series: torch.Tensor, figures: torch.Tensor, memory: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Take series (B, n, S) of lifts with these figures (B, F).

        Return contexts (B, n, C), memory and corrected forecasts in the first places, and the memory for what follows.
        """
        told = figures[:, None].expand(-1, series.shape[1], -1)
        seen, last = self.gru(torch.cat([series, told], dim=-1), memory)
        forecast = series[..., :FORECASTS] + self.forecast(seen)
        return torch.cat([seen, forecast, told], dim=-1), last

    @property
    def context_size(self) -> int:
        """Numbers of a context."""
        return self.of_context.in_features

    def forecasts(self, context: torch.Tensor) -> torch.Tensor:
        """Corrected forecasts (…, FORECASTS) in contexts (…, C): heave rates, then rises."""
        return context[..., self.memory_size : self.memory_size + FORECASTS]

    def prepare(self, context: torch.Tensor) -> torch.Tensor:
        """The part of the perceptron's first layer (…, H) that does not wait for the load."""
        prepared: torch.Tensor = self.of_context(context)
        return prepared

    def act(self, seen: torch.Tensor) -> torch.Tensor:
        """The same as ``share``, from contexts and the numbers of loads one beside the other, (B, C + 13)."""
        context, load = seen[:, : self.context_size], Load.of(seen[:, self.context_size :])
        return self.share(self.prepare(context), load)

    def share(self, prepared: torch.Tensor, load: Load) -> torch.Tensor:
        """Change of the rope's speed (B,) over the coming step, as a share of what the winch can; not clipped yet."""
        change, p = load.most_change, load.regulating()
        hidden = nn.functional.silu(prepared + self.of_load(load.features(p)))
        weight, correction, push = self.last(nn.functional.silu(self.second(hidden))).unbind(-1)
        goal = load.rise - torch.sigmoid(weight + 1.0) * p.clamp(-0.5, 0.5) - 0.5 * correction
        wanted = (goal - load.speed) / change
        share: torch.Tensor = (
            torch.where(load.lag > 0.0, change_in_lag(wanted, load.lag), change_for(wanted)) + 2.0 * push
        )
        return share


def change_for(mean: torch.Tensor) -> torch.Tensor:
    """Change of a drum's speed over a step after which its mean speed lies ``mean`` above that at the start.

    Both as shares of what the winch can change in a step: it ramps up at once and then holds, 2 |x| = 1 - (1 - y)².
    Beyond what can be reached it goes on linearly, to 1.3 at the most.
    """
    twice = 2.0 * mean.abs()
    within = 1.0 - torch.sqrt((1.0 - twice).clamp(min=0.04))
    beyond = (0.8 + 2.5 * (twice - 0.96)).clamp(max=1.3)
    return torch.where(twice < 0.96, within, beyond) * mean.sign()


def change_in_lag(reached: torch.Tensor, lag: torch.Tensor) -> torch.Tensor:
    """Share of a command's change beyond which a winch that lags gains no more, for a change that is reached in a step.

    ``reached`` as a share of what the winch can, ``lag`` in control steps: commands within ``lag`` times what it can in
    a step are approached exponentially, and one that is further off by up to a step's change ramps for part of it.
    Beyond what can be reached it goes on linearly, to 1.3 at the most.
    """
    size, near = reached.abs(), lag / (1.0 + lag)
    slowly = lag * -torch.expm1(-1.0 / lag.clamp(min=1e-3))
    within = near * size / slowly.clamp(min=1e-6)
    beyond = near + (1.0 - near) * (size - slowly) / (1.0 - slowly).clamp(min=1e-3)
    return torch.where(size < slowly, within, beyond.clamp(max=1.3)) * reached.sign()
