"""The full model for many rows at once: the frame in its modes, stepped by compiled kernels."""
