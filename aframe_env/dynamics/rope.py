"""Rope law, eqs. (25), (26) and (40), (41): elastic and damped, with no compression."""

from __future__ import annotations

from aframe_env.dynamics.compiling import fma, larger, scalar


@scalar
def tension(elongation: float, elongation_rate: float, stiffness: float, damping: float) -> float:
    """Rope tension max(0, c_R Δ + d_R Δ'), N.

    ``elongation`` is Δ [m], ``stiffness`` c_R = E_R F_R / l [N/m] with l the unstretched length between drum and
    load, ``damping`` d_R [N s/m]. A rope never pushes, not even a damped one.
    """
    return larger(fma(stiffness, elongation, damping * elongation_rate), 0.0)
