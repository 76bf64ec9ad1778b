"""Tension of the hoisting rope, eqs. (25)–(26): the one place where the full model's runs take it from."""

from __future__ import annotations

from typing import NamedTuple


class RopeForce(NamedTuple):
    """What the rope does at one instant."""

    tension: float
    """N, 0 or more: a rope never pushes, not even a damped one."""
    elastic: float
    """The part of the stretch alone, c Δ (0 when slack), N."""
    stretch: float
    """Δ, m; negative when slack."""


def rope_force(
    *,
    geometric: float,
    geometric_rate: float,
    unstretched: float,
    unstretched_rate: float,
    stiffness: float,
    damping: float,
) -> RopeForce:
    """T = max(0, c Δ + d Δ̇) with Δ = |LS| + |SH| − l.

    Args:
        geometric: |LS| + |SH|, m.
        geometric_rate: Its rate, m/s.
        unstretched: l = l_0 + φ_H d_H/2, paid-out unstretched length, m.
        unstretched_rate: Its rate, m/s.
        stiffness: c = E_R F_R / l, N/m.
        damping: d_R, N s/m.
    """
    stretch = geometric - unstretched
    tension = max(0.0, stiffness * stretch + damping * (geometric_rate - unstretched_rate))
    return RopeForce(tension, max(0.0, stiffness * stretch), stretch)
