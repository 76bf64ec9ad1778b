"""Policies for AFrameHeave: optimised drives, feedback laws, learned agents, all behind one protocol."""

from agents.learned import load

__all__ = ["load"]
