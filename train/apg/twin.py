"""The linear twin: load on its rope and winch of many lifts, in torch, so that a score can be differentiated.

The load answers the rope's end as ``agents.control.rope.RopeModel`` has it, the drum ramps up to its new speed at the
winch's greatest acceleration and holds it, and the pulley goes its true way, which the engine told. What is left out is
the rope's going slack, the swinging of the load while it is not where it should be, and the drum's ramp within a step:
``tests/train/apg/test_twin.py`` holds what that makes against the engine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch

from agents.learned.recurrent_network import Load, RecurrentNetwork, clip_one_sided
from train.apg.data import Recordings


@dataclass(frozen=True)
class Twin:
    """Lifts of B rows."""

    transition: torch.Tensor
    """(B, 3, 4): depth error, its rate and the rope's end after a step, of these and of its mean speed."""
    most_change: torch.Tensor
    """(B,) greatest change of the rope's speed at the drum in a step, m/s."""
    most_speed: torch.Tensor
    """(B,) m/s."""
    period: float
    """Control step, s."""

    def advance(
        self, state: torch.Tensor, speed: torch.Tensor, share: torch.Tensor, rise: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Take a control step: state (B, 3) and the rope's speed (B,) m/s at its end.

        ``share`` (B,): change of the speed that is asked for, as a share of what the winch can; ``rise`` (B,) m of the
        length of rope that would hold the load still.
        """
        asked = speed + self.most_change * clip_one_sided(share, torch.ones_like(share))
        reached = clip_one_sided(asked, self.most_speed)
        change = reached - speed
        # It ramps up at once, and then holds.
        mean = reached - change * change.abs() / (2.0 * self.most_change)
        moved = torch.cat([state, (rise / self.period - mean)[:, None]], dim=1)
        return (self.transition @ moved[:, :, None])[:, :, 0], reached


class Rollout(NamedTuple):
    """What a network did on the twin in B episodes of n steps."""

    rms: torch.Tensor
    """(B,) root mean square depth error, m."""
    z: torch.Tensor
    """(B, n, 4) true states of ``RopeModel`` at the steps' starts; (B, 0, 4) where they were not kept."""
    speed: torch.Tensor
    """(B, n) of the rope at the drum, m/s; likewise."""


def roll_out(network: RecurrentNetwork, recordings: Recordings, *, keep: bool = False) -> Rollout:
    """Let a network act through the recorded episodes, on what the filters would have estimated.

    Estimates are the twin's state and the error that the filters made when the episode was recorded: it comes from
    waves and noise, hardly from what the drum does.
    """
    r = recordings.tensors()
    twin = Twin(r["transition"], r["most_change"], r["most_speed"], recordings.period)
    context, _ = network.remember(r["series"], r["figures"])
    prepared = network.prepare(context).unbind(1)
    rise = r["path"].diff(dim=1)
    count, steps = r["rise"].shape
    state, speed = rise.new_zeros(count, 3), rise.new_zeros(count)
    square, states, speeds = rise.new_zeros(count), [], []
    for step in range(steps):
        z = torch.cat([state, (r["path_speed"][:, step] - speed)[:, None]], dim=1)
        if keep:
            states.append(z)
            speeds.append(speed)
        seen = Load(z + r["error"][:, step], r["rise"][:, step], speed, r["gains"], r["told_change"], r["told_speed"])
        before = state[:, 0]
        state, speed = twin.advance(state, speed, network.share(prepared[step], seen), rise[:, step])
        square = square + 0.5 * (before**2 + state[:, 0] ** 2)
    return Rollout(
        torch.sqrt(square / steps + 1e-12),
        torch.stack(states, dim=1) if keep else rise.new_zeros(count, 0, 4),
        torch.stack(speeds, dim=1) if keep else rise.new_zeros(count, 0),
    )
