"""Learned agents: what their networks see and do, and how they are stored."""
