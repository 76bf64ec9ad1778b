"""Sensitivity of policies to wrong information."""
