"""The rows of the task on an NVIDIA GPU (extra ``cuda``): the engine's own scalar functions, one thread a row.

Nothing here is imported unless a CUDA device is asked for. With ``NUMBA_ENABLE_CUDASIM=1 NUMBA_DISABLE_JIT=1`` it runs
as plain Python in numba's simulator: without a GPU, for tests.
"""
