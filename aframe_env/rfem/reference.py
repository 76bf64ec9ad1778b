"""Figures of independent programs for the reference crane, shipped with the package."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any, Literal, TypeAlias

import numpy as np

from aframe_env.rfem.beam import Array

_DATA = files("aframe_env") / "data" / "reference"


def static_cases() -> dict[str, dict[str, Any]]:
    """Static load cases G, V and L1 of a beam finite-element program (elements of 0.1 m); N, m, rad, {D}."""
    cases: dict[str, dict[str, Any]] = json.loads((_DATA / "static.json").read_text())["cases"]
    return cases


def second_order_cases() -> list[dict[str, Any]]:
    """Static cases of a multibody program with geometrically exact beams: L1, with a side force [N] at S or without,
    the rope to the drum following S or not; u_S along {D} [m] and both servomotors' tension [N]."""
    cases: list[dict[str, Any]] = json.loads((_DATA / "second_order.json").read_text())["cases"]
    return cases


def natural_frequencies() -> Array:
    """First ten natural frequencies of the frame, Hz, of that program (elements of 0.05 m); (10,)."""
    return np.array(json.loads((_DATA / "modal.json").read_text())["A_lumped_rotary"])


Run: TypeAlias = Literal[
    "release_ramp", "release_instant", "paper_rigid", "paper_flexible", "shock", "swing", "swing_stiff"
]


def time_series(name: Run) -> dict[str, Array]:
    """Columns of a dynamic reference run, by their names; each (k,).

    The shock is the paper's case with its load at rest in space, the instant release that of load case V; both by
    Timoshenko elements with a consistent mass (120 and 240 a leg), in all their modes, the force of the rope a straight
    line over steps of 0.1 ms.

    The swings are exudyn 1.13.6's, with geometrically exact beams (80, 64 and 80 elements, built as in
    ``benchmarks/exudyn_peer.py``; generalised α with a spectral radius of 0.8, steps of 5 ms; half as many elements
    change no column by more than 0.15 % of its peak-to-peak, half the step by 0.01 %). The frame goes from −20° to
    25°: the lengths of both servomotors, distance constraints, follow the quintic smoothstep from 1 s to 21 s. The
    paper's surge and heave build up along it over 5 s; 100 t at h = -300 m, the drum still, d_R = 2e4 N s/m, all at
    rest at first. u_S is relative to the rigid frame at ``luffing_rad``. ``swing_stiff``: E and G ten times as great,
    the mass as it is, so that what is of second order in the displacements, which a linear frame leaves out, is a
    tenth.
    """
    lines = (_DATA / f"dynamic_{name}.csv").read_text().splitlines()
    values = np.array([[float(item) for item in line.split(",")] for line in lines[1:]])
    return {column: values[:, index] for index, column in enumerate(lines[0].split(","))}
