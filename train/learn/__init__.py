"""Learners, and what their commands do around them."""
