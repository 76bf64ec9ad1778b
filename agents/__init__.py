"""Policies for AFrameHeave: optimised drives, feedback laws, learned agents, all behind one protocol."""
