"""Analytic policy gradient: imitation of the optimum, then gradients of the score through a linear twin."""
