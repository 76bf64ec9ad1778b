"""Checks of the full model against closed forms and independent programs."""
