"""What the agent's filters make of what the load does: ``KalmanObserver`` as a linear answer to it, in torch.

The filters are linear, so that their estimate is the sum of what they make of the waves and of noise, whatever the drum
does, and of what they make of the rope's end and its stretch, as these are read: late, and by a stiffness that is told.
The first part is recorded. The second is reckoned here, as the drum decides about it: an agent that trusts old readings
too much makes its load swing.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch

from agents.learned.recurrent_inputs import LookoutConfig


@dataclass
class Estimates:
    """Of B rows that run in step."""

    made_for: LookoutConfig
    """What the filters are made for."""
    told_transition: torch.Tensor
    """(B, 3, 4) transition of ``Twin`` as the filters have it."""
    reading: torch.Tensor
    """(B, H) shares of the true values now and at the control steps before that make a reading."""
    softness: torch.Tensor
    """(B,) stretch as told by the tension over the true one."""

    def __post_init__(self) -> None:
        zero = torch.zeros_like(self.reading)
        self._past = torch.stack([zero, zero], dim=1)
        """(B, 2, H) rope's end and stretch as told, the newest first, m."""
        self._read_end = zero[:, 0]
        self._reckoned = [zero[:, 0]] * (self.made_for.delay + 1)
        """Rope's end as reckoned since the told moment of measurement, m."""
        self._x = zero.new_zeros(len(zero), 4)
        """State of ``RopeFilter``."""

    def advance(self, state: torch.Tensor, reckoned: torch.Tensor, gain: torch.Tensor) -> torch.Tensor:
        """Estimate (B, 3) of ``state`` (B, 3), which it is now: depth error, its rate, the rope's end.

        ``reckoned`` (B,) m: rope's end as it would be with the drum turned as it was reckoned; ``gain`` (B, 4) of
        ``RopeFilter`` at this step.
        """
        now = torch.stack([state[:, 2], self.softness * (state[:, 2] - state[:, 0])], dim=1)
        self._past = torch.cat([now[:, :, None], self._past[:, :, :-1]], dim=2)
        end, stretch = (self._past * self.reading[:, None]).sum(2).unbind(1)
        x, period = self._x, self.made_for.control_period
        moved = torch.cat([x[:, :3], ((end - self._read_end) / period)[:, None]], dim=1)
        foretold = torch.cat([(self.told_transition @ moved[:, :, None])[:, :, 0], x[:, 3:]], dim=1)
        missed = stretch - (foretold[:, 2] - foretold[:, 0] + foretold[:, 3])
        self._x = x = foretold + gain * missed[:, None]
        self._read_end = end
        self._reckoned = [*self._reckoned[1:], reckoned]
        z = torch.stack([end - (x[:, 2] - x[:, 0]), x[:, 1], end], dim=1)
        for before, after in zip(self._reckoned[:-1], self._reckoned[1:], strict=True):
            moved = torch.cat([z, ((after - before) / period)[:, None]], dim=1)
            z = (self.told_transition @ moved[:, :, None])[:, :, 0]
        return z
