from .crane import Crane, Frame, Rope, Winch
from .motion import Harmonic, HarmonicMotion
from .record import RecordedMotion
from .scenario import Scenario, ScenarioDistribution
from .scenario_file import read_scenario, scenario_text
from .sea import Sea, SeaMotion
from .sensors import Channel, Sensors
from .validation import InvalidValue, SmallRotationWarning
from .vessel import Vessel

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
