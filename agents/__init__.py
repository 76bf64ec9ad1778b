"""Policies for AFrameHeave: optimised drives, feedback laws, learned agents, all behind one protocol."""

from aframe_env import __version__
from agents.learned.agent import load
from agents.learned.feature_policy import FeaturePolicy
from agents.learned.features import FeatureConfig
from agents.learned.interface import InterfaceConfig
from agents.learned.wrappers import AgentInterface, AgentVectorInterface

__all__ = [
    "AgentInterface",
    "AgentVectorInterface",
    "FeatureConfig",
    "FeaturePolicy",
    "InterfaceConfig",
    "__version__",
    "load",
]
