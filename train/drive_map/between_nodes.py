"""The approximation's own error: regular heaves between the nodes, optimised afresh."""

from __future__ import annotations

import cmath
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from aframe_env.scenario import Crane
from agents.drives.functions import RampedDrive
from agents.drives.map import DriveMap, Node, NodeDrive, optimise_node
from agents.drives.objectives import Objective, coarse_step


@dataclass(frozen=True)
class Between:
    """A regular heave between the nodes, and the map's answer to it."""

    node: Node
    real: float
    imaginary: float

    @property
    def ratio(self) -> complex:
        """Rope paid out over heave, by the map."""
        return complex(self.real, self.imaginary)


@dataclass(frozen=True)
class Checked:
    """The map's drive beside the optimum."""

    optimum: NodeDrive
    ratio_error: float
    """\\|map's ratio - optimum's ratio\\|: share of the heave that the approximation misses."""
    remaining: float
    """RMS depth error under the map's drive over that with the drum still."""


@dataclass(frozen=True)
class HeldOut(Checked):
    """The same, and where it is."""

    node: Node

    @property
    def plain(self) -> dict[str, Any]:
        """Return it as plain data, the crane left out."""
        data = asdict(self)
        node = data.pop("node")
        del node["crane"]
        return {"node": node, **data}


def between_nodes(drive_map: DriveMap, crane: Crane, count: int, seed: int) -> list[Between]:
    """Regular heaves drawn evenly (periods and lengths in their logarithms) inside the map."""
    u = np.random.default_rng(seed).random((count, 4))
    lows, highs = (
        [a[i] for a in (drive_map.amplitude, drive_map.period, drive_map.mass, drive_map.length)] for i in (0, -1)
    )
    low, high = np.array(lows), np.array(highs)
    place = low + u * (high - low)
    for i in (1, 3):
        place[:, i] = low[i] * (high[i] / low[i]) ** u[:, i]
    ratio = drive_map.ratio_at(*place.T)
    return [
        Between(Node(amplitude=a, period=p, mass=m, length=length, crane=crane), r.real, r.imag)
        for (a, p, m, length), r in zip(place.tolist(), ratio.tolist(), strict=True)
    ]


def check(between: Between) -> Checked:
    """Optimise a heave afresh and run the map's drive beside the optimum."""
    node = between.node
    optimum = optimise_node(node)
    scenario, duration = node.scenario, node.periods * node.period
    objective = Objective(scenario, duration, coarse_step(scenario))
    amplitude = abs(between.ratio) * node.amplitude / scenario.crane.winch.drum_radius
    variables = np.array([amplitude, 2.0 * np.pi / node.period, cmath.phase(between.ratio)])
    outcome = objective.drive(RampedDrive(duration=duration, variables=variables))
    error = abs(between.ratio - complex(optimum.real, optimum.imaginary))
    return Checked(optimum, error, outcome.rms / objective.still().rms)
