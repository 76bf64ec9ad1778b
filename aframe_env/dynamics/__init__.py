"""The physics, and nothing but physics. Compiled with numba; every face of the package runs this code."""
