"""Rope law, eqs. (25), (26) and (40), (41): elastic and damped, with no compression."""

from __future__ import annotations

from aframe_env.dynamics.compiling import scalar


@scalar
def tension(elongation: float, elongation_rate: float, length: float, axial_stiffness: float, damping: float) -> float:
    """Rope tension max(0, c_R Δ + d_R Δ'), N, with c_R = E_R F_R / l.

    ``length`` is the unstretched length l [m] between drum and load, ``elongation`` is Δ [m], ``damping`` is
    d_R [N s/m]. A rope never pushes, not even a damped one.
    """
    force = axial_stiffness / length * elongation + damping * elongation_rate
    return force if force > 0.0 else 0.0
