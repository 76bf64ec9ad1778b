"""Active heave compensation of a load under an offshore A-frame crane, as a Gymnasium environment.

Importing this package registers ``AFrameHeave-v0``.
"""

from __future__ import annotations

import gymnasium

from aframe_env.crane import Crane, Frame, Rope, Winch
from aframe_env.motion import Harmonic, HarmonicMotion
from aframe_env.record import RecordedMotion
from aframe_env.scenario import Scenario, ScenarioDistribution
from aframe_env.scenario_file import read_scenario, scenario_text
from aframe_env.sea import Sea, SeaMotion
from aframe_env.sensors import Channel, Sensors
from aframe_env.validation import InvalidValue, SmallRotationWarning
from aframe_env.vessel import Vessel

ENV_ID = "AFrameHeave-v0"

if ENV_ID not in gymnasium.registry:
    # The environment truncates by itself, after `episode_duration`; a TimeLimit wrapper would cut a longer one short.
    gymnasium.register(
        id=ENV_ID,
        entry_point="aframe_env.env:AFrameHeaveEnv",
        vector_entry_point="aframe_env.vector_env:AFrameHeaveVectorEnv",
    )

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
