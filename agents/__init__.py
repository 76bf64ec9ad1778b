"""Policies for AFrameHeave: optimised drives, feedback laws, learned agents, all behind one protocol."""

from agents.learned.agent import load

__all__ = ["load"]
