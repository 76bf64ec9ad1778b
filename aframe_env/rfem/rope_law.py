"""Tension of the hoisting rope in the full model's stand-alone runs, eqs. (25)–(26).

It is the reference runs' own statement of these equations. The compiled physics has its own, in
``aframe_env.dynamics.load``, so that each can be checked against the other.
"""

from __future__ import annotations

from typing import NamedTuple


class RopeForce(NamedTuple):
    """Rope at one instant."""

    tension: float
    """N, 0 or more: a rope never pushes, not even a damped one."""
    elastic: float
    """Its part from the stretch alone, c Δ (0 when slack), N."""
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
    """Tension T = max(0, c Δ + d Δ̇) with Δ = |LS| + |SH| − l, as the reference runs state it.

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
