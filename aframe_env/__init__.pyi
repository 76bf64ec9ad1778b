from .scenario.crane import Crane, Frame, Rope, Winch
from .scenario.distribution import ScenarioDistribution
from .scenario.file import read_scenario, scenario_text
from .scenario.motion import Harmonic, HarmonicMotion
from .scenario.recorded_motion import RecordedMotion
from .scenario.scenario import Scenario
from .scenario.sea import Sea, SeaMotion
from .scenario.sensors import Channel, Sensors
from .scenario.vessel import Vessel
from .validation import InvalidValue, SmallRotationWarning

ENV_ID: str

__all__ = [
    "ENV_ID",
    "Channel",
    "Crane",
    "Frame",
    "Harmonic",
    "HarmonicMotion",
    "InvalidValue",
    "RecordedMotion",
    "Rope",
    "Scenario",
    "ScenarioDistribution",
    "Sea",
    "SeaMotion",
    "Sensors",
    "SmallRotationWarning",
    "Vessel",
    "Winch",
    "read_scenario",
    "scenario_text",
]
