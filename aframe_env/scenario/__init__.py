"""Scenarios: crane, ship motion, sea, vessel, sensors and load of an episode; fixed, drawn, or read from a file."""

from aframe_env.scenario.crane import GRAVITY, Compensator, Crane, Frame, Rope, Winch
from aframe_env.scenario.distribution import NUMBERS, ScenarioDistribution, ScenarioSource
from aframe_env.scenario.drive import TorqueDrive
from aframe_env.scenario.interval import Range
from aframe_env.scenario.loads import LOADS, ReadyLoad
from aframe_env.scenario.luffing import Luffing
from aframe_env.scenario.motion import Harmonic, HarmonicMotion, ShipMotion
from aframe_env.scenario.motion_unit import MotionUnit
from aframe_env.scenario.preview import Preview
from aframe_env.scenario.recorded_motion import RecordedMotion, RecordedWindow
from aframe_env.scenario.scenario import Initial, Scenario
from aframe_env.scenario.sea import Sea, SeaMotion
from aframe_env.scenario.sensors import Channel, Sensors
from aframe_env.scenario.target import TargetPath
from aframe_env.scenario.told import Told
from aframe_env.scenario.vessel import Vessel
from aframe_env.scenario.water import LoadShape, Seabed, Water

__all__ = [
    "GRAVITY",
    "LOADS",
    "NUMBERS",
    "Channel",
    "Compensator",
    "Crane",
    "Frame",
    "Harmonic",
    "HarmonicMotion",
    "Initial",
    "LoadShape",
    "Luffing",
    "MotionUnit",
    "Preview",
    "Range",
    "ReadyLoad",
    "RecordedMotion",
    "RecordedWindow",
    "Rope",
    "Scenario",
    "ScenarioDistribution",
    "ScenarioSource",
    "Sea",
    "SeaMotion",
    "Seabed",
    "Sensors",
    "ShipMotion",
    "TargetPath",
    "Told",
    "TorqueDrive",
    "Vessel",
    "Water",
    "Winch",
]
