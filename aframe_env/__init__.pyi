from .config import TaskConfig
from .scenario.crane import Compensator, Crane, Frame, Rope, Winch
from .scenario.distribution import ScenarioDistribution
from .scenario.drive import TorqueDrive
from .scenario.file import read_scenario, read_scenarios, scenario_text
from .scenario.loads import LOADS, ReadyLoad
from .scenario.luffing import Luffing
from .scenario.motion import Harmonic, HarmonicMotion
from .scenario.motion_unit import MotionUnit
from .scenario.preview import Preview
from .scenario.recorded_motion import RecordedMotion, RecordedWindow
from .scenario.scenario import Scenario
from .scenario.sea import Sea, SeaMotion
from .scenario.sensors import Channel, Sensors
from .scenario.target import TargetPath
from .scenario.told import Told
from .scenario.vessel import Vessel
from .scenario.water import LoadShape, Seabed, Water
from .suite import TASKS, Task, find_task
from .validation import (
    InvalidValue,
    RecordNoiseWarning,
    ResponseTableWarning,
    SeaBeyondTableWarning,
    SmallRotationWarning,
)

ENV_ID: str
__version__: str

__all__ = [
    "ENV_ID",
    "LOADS",
    "TASKS",
    "Channel",
    "Compensator",
    "Crane",
    "Frame",
    "Harmonic",
    "HarmonicMotion",
    "InvalidValue",
    "LoadShape",
    "Luffing",
    "MotionUnit",
    "Preview",
    "ReadyLoad",
    "RecordNoiseWarning",
    "RecordedMotion",
    "RecordedWindow",
    "ResponseTableWarning",
    "Rope",
    "Scenario",
    "ScenarioDistribution",
    "Sea",
    "SeaBeyondTableWarning",
    "SeaMotion",
    "Seabed",
    "Sensors",
    "SmallRotationWarning",
    "TargetPath",
    "Task",
    "TaskConfig",
    "Told",
    "TorqueDrive",
    "Vessel",
    "Water",
    "Winch",
    "find_task",
    "read_scenario",
    "read_scenarios",
    "scenario_text",
]
