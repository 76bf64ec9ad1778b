"""Learned agents: features, networks, and their files."""
