"""The linear twin: load on its rope and winch of many lifts, in torch, so that a score can be differentiated.

The load answers the rope's end as ``agents.control.chain`` has it, the drum follows its command within the
winch's greatest acceleration and with its lag, and the pulley goes its true way, which the engine told. What is left
out is the rope's going slack, the swinging of the load while it is not where it should be, and the drum's ramp within a
step: ``tests/train/apg/test_twin.py`` holds what that makes against the engine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

import torch

from agents.learned.recurrent_network import Load, RecurrentNetwork, clip_one_sided
from train.apg.data import Recordings
from train.apg.estimates import Estimates

SAME: Final = 1e-3
"""Share by which a winch may differ from what was told and still count as that."""


@dataclass(frozen=True)
class Winches:
    """Drums that follow their commands, in closed form over a control step, as ``aframe_env.dynamics.drum``.

    All tensors of one shape (…,), that of the commands.
    """

    most_change: torch.Tensor
    """Greatest change of the rope's speed at the drum in a step, m/s."""
    most_speed: torch.Tensor
    """m/s."""
    lag: torch.Tensor
    """Time constant, in control steps."""

    def follow(self, speed: torch.Tensor, command: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Mean speed of the rope over a step, m/s, and its speed at the end, from ``speed`` at its beginning."""
        most, lag = self.most_change, self.lag
        gap = clip_one_sided(command, self.most_speed) - speed
        size = gap.abs()
        # Within most x lag of its command a drum approaches it exponentially, from further off it ramps up first.
        nearby = torch.minimum(size, most * lag)
        ramp = ((size - nearby) / most).clamp(max=1.0)
        rest = 1.0 - ramp
        come = -torch.expm1(-rest / lag.clamp(min=1e-6))
        gained = most * ramp
        reached = gained + nearby * come
        mean = gained * (0.5 * ramp + rest) + nearby * (rest - lag * come)
        sign = gap.sign()
        return speed + sign * mean, speed + sign * reached


@dataclass(frozen=True)
class Twin:
    """Lifts of B rows.

    Their drums are (D, B): those that turn and, where they are not what was told and their speed is not observed, those
    that the agent reckons with in their place.
    """

    transition: torch.Tensor
    """(B, S, S + 1), of ``Chains``."""
    winches: Winches
    """(D, B)."""
    reach: torch.Tensor
    """(B,) what a command is ahead of the reckoned speed for a share of 1, m/s, as told."""
    told_speed: torch.Tensor
    """(B,) greatest speed of the rope at the drum, as told, m/s."""
    first: torch.Tensor
    """(B, S) state at the start."""
    period: float
    """Control step, s."""
    drag: torch.Tensor | None = None
    """(B, S), of ``Chains``; None where all are in air."""

    @classmethod
    def of(cls, recordings: Recordings, tensors: Mapping[str, torch.Tensor]) -> Twin:
        """Of recorded lifts, whose ``tensors`` are those of the recordings."""
        r = tensors
        pairs = [(r["most_change"], r["told_change"]), (r["most_speed"], r["told_speed"]), (r["lag"], r["told_lag"])]
        # A drum's radius counts for as much more as a heavy rope is stretched, by the first reading of its tension.
        alike = recordings.made_for.sensors is None or all(
            torch.allclose(true, told, rtol=SAME, atol=0.0) for true, told in pairs
        )
        winches = Winches(*(torch.stack((true,) if alike else (true, told)) for true, told in pairs))
        reach = (1.0 + r["told_lag"]) * r["told_change"]
        drag = r["drag"] if r["drag"].any() else None
        higher = r["start"].new_zeros(len(r["start"]), r["transition"].shape[1] - 3)
        first = torch.cat([r["start"], higher], dim=1)
        return cls(r["transition"], winches, reach, r["told_speed"], first, recordings.period, drag)

    def start(self) -> tuple[torch.Tensor, torch.Tensor]:
        """State (B, S) of the lifts at the start, and speeds (D, B) of their drums, which stand still."""
        return self.first, torch.zeros_like(self.winches.lag)

    def advance(
        self, state: torch.Tensor, speed: torch.Tensor, share: torch.Tensor, rise: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Take a control step: state (B, S), speeds (D, B) m/s at its end, and rope (B,) m paid out, as reckoned.

        ``share`` (B,): change of the speed that is asked for, as a share of what the winch can; ``rise`` (B,) m of the
        length of rope that would hold the load still.
        """
        asked = speed[-1] + self.reach * clip_one_sided(share, torch.ones_like(share))
        command = clip_one_sided(asked, self.told_speed)
        mean, reached = self.winches.follow(speed, command.expand_as(speed))
        moved = torch.cat([state, (rise / self.period - mean[0])[:, None]], dim=1)
        after = (self.transition @ moved[:, :, None])[:, :, 0]
        if self.drag is not None:
            # As ``Chains.advance`` has it.
            free = 0.5 * (state[:, 1:2] + after[:, 1:2])
            velocity = 2.0 * free / (1.0 + torch.sqrt(1.0 - 2.0 * self.drag[:, 1:2] * free.abs()))
            after = after + self.drag * (velocity.abs() * velocity)
        return after, reached, self.period * mean[-1]


class Rollout(NamedTuple):
    """What a network did on the twin in B episodes of n steps."""

    rms: torch.Tensor
    """(B,) root mean square depth error, m."""
    z: torch.Tensor
    """(B, n, 4) true states of ``RopeModel`` at the steps' starts; (B, 0, 4) where they were not kept."""
    estimate: torch.Tensor
    """(B, n, 4) what the network saw of them; likewise."""
    speed: torch.Tensor
    """(B, n) of the rope at the drum, m/s; likewise."""
    reckoned: torch.Tensor
    """(B, n) the same as the agent reckons it."""


def roll_out(network: RecurrentNetwork, recordings: Recordings, *, keep: bool = False) -> Rollout:
    """Let a network act through the recorded episodes, on what the filters would have estimated.

    Estimates are the twin's state, or what the filters make of it, and the error that they made when the episode was
    recorded: it comes from waves and noise, hardly from what the drum does.
    """
    r = recordings.tensors()
    twin = Twin.of(recordings, r)
    context, _ = network.remember(r["series"], r["figures"])
    prepared = network.prepare(context).unbind(1)
    rise = r["path"].diff(dim=1)
    count, steps = r["rise"].shape
    state, speed = twin.start()
    filters = (r["told_transition"], r["reading"], r["softness"])
    estimates = Estimates(recordings.made_for, *filters) if recordings.made_for.adapts else None
    reckoned = rise.new_zeros(count)
    square, kept = rise.new_zeros(count), []
    for step in range(steps):
        rope_end = r["path_speed"][:, step] - speed
        estimate = state[:, :3]
        if estimates is not None and step:
            estimate = estimates.advance(state[:, :3], r["path"][:, step] - reckoned, r["gain"][:, step])
        z = torch.cat([estimate, rope_end[-1, :, None]], dim=1) + r["error"][:, step]
        if keep:
            kept.append((torch.cat([state[:, :3], rope_end[0, :, None]], dim=1), z, speed[0], speed[-1]))
        seen = Load(
            z,
            r["rise"][:, step],
            speed[-1],
            r["gains"],
            r["told_change"],
            r["told_speed"],
            r["told_lag"],
        )
        before = state[:, 0]
        state, speed, turned = twin.advance(state, speed, network.share(prepared[step], seen), rise[:, step])
        reckoned = reckoned + turned
        square = square + 0.5 * (before**2 + state[:, 0] ** 2)
    rms = torch.sqrt(square / steps + 1e-12)
    if not keep:
        return Rollout(rms, *rise.new_zeros(2, count, 0, 4), *rise.new_zeros(2, count, 0))
    return Rollout(rms, *(torch.stack(each, dim=1) for each in zip(*kept, strict=True)))
