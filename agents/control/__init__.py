"""Feedback laws for the drum: feed-forward with feedback, inverse dynamics, predictive control."""
