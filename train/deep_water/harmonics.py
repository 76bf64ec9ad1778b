"""The drive map made anew in deep water: best harmonic drives, and what interpolation between them costs."""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aframe_env.scenario import Scenario, Water
from aframe_env.scenario.motion import Harmonic, HarmonicMotion
from aframe_env.suite.deep_rope import DEEP_CRANE, steel_load
from agents.drives.functions import RampedDrive
from agents.drives.map import DriveMap, Node, NodeDrive, ideal_ratio, optimise_node
from agents.drives.objectives import Objective, coarse_step
from agents.policy import FloatArray


@dataclass(frozen=True, kw_only=True)
class WetNode(Node):
    """A regular heave of the crane's tip over a load in water on a heavy rope; ``damping_ratio`` has no meaning."""

    @property
    def scenario(self) -> Scenario:
        """Scenario of the node: the load starts at rest, the tip moving upwards from the middle of its stroke."""
        return Scenario(
            crane=self.crane,
            motion=HarmonicMotion(
                harmonics=(Harmonic(coordinate="heave", amplitude=self.amplitude, period=self.period),)
            ),
            load_mass=self.mass,
            target_level=self.crane.pulley_position[2] - self.length,
            initial="rest",
            water=Water(),
            load=steel_load(self.mass),
        )


@dataclass(frozen=True)
class Found:
    """The best drive of a node, and what is left without it."""

    best: NodeDrive
    still: float
    """RMS depth error with the drum still, m."""
    mistuned: float
    """RMS depth error where the drum pays out a hundredth more than the best drive, m."""
    closed_form: float
    """RMS depth error where it pays out 1 / (1 + strain at the pulley) of the heave, m."""

    @property
    def ratio(self) -> complex:
        """Rope paid out over heave."""
        return complex(self.best.real, self.best.imaginary)


def find(node: WetNode) -> Found:
    """Find the best drive of a node."""
    best = optimise_node(node)
    ratio = complex(best.real, best.imaginary)
    return Found(best, left(node, 0.0), left(node, 1.01 * ratio), left(node, complex(ideal_ratio(node.scenario))))


def left(node: WetNode, ratio: complex) -> float:
    """RMS depth error [m] where the drum pays out ``ratio`` of the heave."""
    scenario, duration = node.scenario, node.periods * node.period
    amplitude = abs(ratio) * node.amplitude / scenario.crane.winch.drum_radius
    variables = np.array([amplitude, 2.0 * np.pi / node.period, cmath.phase(ratio)])
    objective = Objective(scenario, duration, coarse_step(scenario))
    return objective.drive(RampedDrive(duration=duration, variables=variables)).rms


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Nodes of the map."""

    amplitudes: tuple[float, ...]
    periods: tuple[float, ...]
    masses: tuple[float, ...]
    depths: tuple[float, ...]

    @property
    def nodes(self) -> list[WetNode]:
        """Every node, in the order of the map's axes."""
        grid = itertools.product(self.amplitudes, self.periods, self.masses, self.depths)
        return [WetNode(amplitude=a, period=p, mass=m, length=d, crane=DEEP_CRANE) for a, p, m, d in grid]

    @property
    def middles(self) -> list[WetNode]:
        """Middles of the cells, as the map interpolates: periods and depths in their logarithms."""
        amplitudes, masses = (_middles(axis) for axis in (self.amplitudes, self.masses))
        periods, depths = (np.exp(_middles(np.log(axis).tolist())) for axis in (self.periods, self.depths))
        grid = itertools.product(amplitudes, periods.tolist(), masses, depths.tolist())
        return [WetNode(amplitude=a, period=p, mass=m, length=d, crane=DEEP_CRANE) for a, p, m, d in grid]

    def map_of(self, found: Sequence[Found]) -> DriveMap:
        """The map of the best drives of its nodes."""
        amplitude, period, mass, depth = map(np.array, (self.amplitudes, self.periods, self.masses, self.depths))
        shape_of_grid = len(amplitude), len(period), len(mass), len(depth)
        ratio = np.array([each.ratio for each in found]).reshape(shape_of_grid)
        remaining = np.array([each.best.remaining for each in found]).reshape(shape_of_grid)
        return DriveMap(amplitude, period, mass, depth, ratio, remaining)


def _middles(axis: Sequence[float]) -> list[float]:
    return [0.5 * (a + b) for a, b in itertools.pairwise(axis)]


@dataclass(frozen=True, kw_only=True)
class Between:
    """The middle of a cell, and the map's answer to it."""

    node: WetNode
    real: float
    imaginary: float


@dataclass(frozen=True)
class Checked:
    """A middle's own best drive, and what the map's leaves."""

    optimum: Found
    ratio_error: float
    """|map's ratio - optimum's|."""
    interpolated: float
    """RMS depth error under the map's drive, m."""


def check(between: Between) -> Checked:
    """Hold the map's drive against the middle's own best one."""
    optimum, ratio = find(between.node), complex(between.real, between.imaginary)
    return Checked(optimum, abs(ratio - optimum.ratio), left(between.node, ratio))


def between(drive_map: DriveMap, grid: Grid) -> list[Between]:
    """The middles of the cells with the map's answers."""
    found = []
    for node in grid.middles:
        ratio = complex(drive_map.ratio_at(node.amplitude, node.period, node.mass, node.length).item())
        found.append(Between(node=node, real=ratio.real, imaginary=ratio.imag))
    return found


def rms_of_heave(node: Node) -> float:
    """RMS of the tip's heave, m."""
    return node.amplitude / math.sqrt(2.0)


def closed_forms(nodes: Sequence[WetNode]) -> FloatArray:
    """1 / (1 + strain at the pulley) of the nodes, (N,)."""
    return np.array([ideal_ratio(node.scenario) for node in nodes])
