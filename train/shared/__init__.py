"""Shared parts of the commands: options, run folders, jobs, tables."""
