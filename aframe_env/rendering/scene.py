"""The scene to be drawn, in numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass

import gymnasium
import numpy as np
import numpy.typing as npt

from aframe_env import task
from aframe_env.dynamics import layout as at
from aframe_env.rendering.water import Water, water_of
from aframe_env.scenario.crane import Crane
from aframe_env.scenario.motion import HarmonicMotion, ShipMotion, is_tabled
from aframe_env.scenario.sea import SeaMotion
from aframe_env.simulation import Simulation

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Scene:
    """One row at one moment. Positions in the base frame, m; SI units, angles in radians."""

    time: float
    """s."""
    motion: str
    """The ship's motion in words."""
    crane: Crane
    water: Water
    deck: FloatArray
    """Place of the deck's origin (3,)."""
    rotation: FloatArray
    """Rotation of the deck frame into the base frame (3, 3)."""
    pulley: FloatArray
    """Place of the pulley S (3,)."""
    luffing_angle: float
    """Of the frame, now."""
    furthest: tuple[float, float]
    """Greatest x and z of the pulley on the deck in the whole episode."""
    pulley_heave: float
    """Height of S above its place with the ship at rest."""
    load: FloatArray
    """Place of the load L (3,)."""
    load_mass: float
    """kg."""
    weight: float
    """Of load and rope, less their buoyancy, N."""
    target_level: float
    """h, now."""
    ground: float
    """Level of the load's middle when it stands on the seabed, m; -inf where there is none."""
    rope_length: float
    """Unstretched, between drum and load."""
    tension: float
    """N."""
    slack: bool
    """True if the rope was slack within the last control step."""
    parted: bool
    """True if the rope has parted."""
    drum_angle: float
    drum_speed: float
    """rad/s, positive pays out."""
    drum_command: float
    """rad/s."""

    @property
    def depth_error(self) -> float:
        """x_L3 - h, m."""
        return float(self.load[2]) - self.target_level

    def on_deck(self, points: npt.ArrayLike) -> FloatArray:
        """Places in the base frame (..., 3) of points fixed in the deck frame (..., 3), m."""
        return np.asarray(np.asarray(points, dtype=np.float64) @ self.rotation.T + self.deck)


def scene_of(simulation: Simulation, row: int) -> Scene:
    """Take a row's scene out of the simulation."""
    scenario = simulation.scenarios[row]
    if scenario is None:
        raise gymnasium.error.ResetNeeded("render() before the first reset()")
    engine, state, results = simulation.engine, simulation.state[row], simulation.results[row]
    coordinates = engine.deck()[row]
    pulleys = [crane.pulley_position for crane in scenario.cranes]
    return Scene(
        time=float(results[task.TIME]),
        motion=motion_in_words(scenario.motion),
        crane=scenario.crane,
        water=water_of(scenario),
        deck=coordinates[:3],
        rotation=rotation(*coordinates[3:].tolist()),
        pulley=engine.read_many(at.PULLEY, 3)[row],
        luffing_angle=float(results[task.LUFFING_ANGLE]),
        furthest=(max(x for x, _, _ in pulleys), max(z for _, _, z in pulleys)),
        pulley_heave=float(state[task.PULLEY_HEAVE]),
        load=results[task.LOAD : task.LOAD + 3].copy(),
        load_mass=scenario.load_mass,
        weight=scenario.hanging_weight,
        target_level=float(results[task.TARGET]),
        ground=scenario.bed_level + 0.5 * scenario.load.height,
        rope_length=float(state[task.ROPE_LENGTH]),
        tension=float(results[task.TENSION]),
        slack=bool(results[task.SLACK] > 0.0),
        parted=bool(results[task.PARTED] > 0.0),
        drum_angle=float(state[task.DRUM_ANGLE]),
        drum_speed=float(state[task.DRUM_SPEED]),
        drum_command=float(engine.read(at.COMMAND)[row]),
    )


def rotation(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Rz(yaw) Ry(pitch) Rx(roll), eq. (38): (3, 3)."""
    sx, cx = math.sin(roll), math.cos(roll)
    sy, cy = math.sin(pitch), math.cos(pitch)
    sz, cz = math.sin(yaw), math.cos(yaw)
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cx, -sx], [0.0, sx, cx]])
    about_y = np.array([[cy, 0.0, sy], [0.0, 1.0, 0.0], [-sy, 0.0, cy]])
    about_z = np.array([[cz, -sz, 0.0], [sz, cz, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


def motion_in_words(motion: ShipMotion) -> str:
    """Describe the ship's motion in a few words."""
    if isinstance(motion, SeaMotion):
        sea = motion.sea
        heading = math.degrees(sea.heading) % 360.0
        return f"Hs {sea.hs:.1f} m    Tp {sea.tp:.1f} s    heading {heading:.0f}°"
    if isinstance(motion, HarmonicMotion):
        return "harmonic motion" if motion.harmonics else "ship at rest"
    return "recorded motion" if is_tabled(motion) else "ship motion"
