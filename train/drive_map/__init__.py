"""Checks of the drive map, and their report."""
